// Pictures of numbers: each pixel's number as a color, with a scale below.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/image/color_map.h"
#include "common/image/lettering.h"

namespace candela::image {

// Maps numbers to places on the color map.
struct ColorScale {
  double low = 0, high = 1;  // low < high; of a logarithmic scale both above 0
  bool logarithmic = false;

  // 0 at low, 1 at high. Precondition: value is finite, and above 0 if the scale is logarithmic.
  double position(double value) const;
  double value_at(double position) const;  // its inverse
};

// Numbers that are finite have a minimum, a maximum and a mean (NaN if there is none). On a logarithmic scale
// those of 0 or less have no color. below, above: of the numbers with a color, those beyond the scale.
struct ValueSummary {
  std::uint64_t pixels = 0, not_finite = 0, not_positive = 0, below = 0, above = 0;
  double minimum = 0, maximum = 0, mean = 0;
};
ValueSummary summarize(std::span<const float> values, const ColorScale& scale);

// The range between two percentiles (0 <= low < high <= 100) of the numbers that can have a color, each
// interpolated between the two nearest ranks. If both are equal: from the smallest to the largest number; if
// these are equal, too, a range around them. With `is_signed`: from -X to X, X the larger absolute value of
// the two. An error if no number can have a color.
Result<ColorScale> percentile_scale(std::span<const float> values, double low, double high, bool logarithmic,
                                    bool is_signed);

// A number on the scale with its label.
struct Tick {
  double value = 0;
  Label label = {};
};
// Round numbers, as many as `length` pixels have room for: at least two, or the ends of the scale. `exponent`
// is the power of ten by which the labels must be multiplied.
struct Ticks {
  std::vector<Tick> labeled;
  std::vector<double> minor;
  int exponent = 0;
};
Ticks ticks_of(const ColorScale& scale, double length, double capital);

// A rectangle of pixels.
struct PixelBox {
  std::uint32_t x = 0, y = 0, width = 0, height = 0;
};
struct Figure {
  Canvas canvas;
  PixelBox picture;  // the image, pixel by pixel
  PixelBox bar;      // from low (left edge) to high (right edge)
};

// Colors of the pixels that have none on the map.
inline constexpr Color8 kNotFiniteColor = {255, 0, 255};
Color8 not_positive_color(ColorMap map);

// The picture, below it the scale with ticks, `title`, and a legend for pixels without a color on the map.
// Preconditions: values.size() == width * height; `summary` is that of the values and the scale.
Figure draw_false_color(std::span<const float> values, std::uint32_t width, std::uint32_t height,
                        ColorMap map, const ColorScale& scale, const ValueSummary& summary,
                        const std::string& title);

// As PNG.
Result<std::string> encode_png(const Canvas& canvas);

}  // namespace candela::image
