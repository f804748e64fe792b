// Lines and text for figures, anti-aliased, in a stroke font.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/image/color_map.h"

namespace candela::image {

// Pixels of sRGB, row by row from the top. Coordinates of drawing are pixels: (0, 0) is the upper left corner
// of the canvas, (0.5, 0.5) the center of its first pixel. Drawing beyond the canvas is cut off.
struct Canvas {
  Canvas(std::uint32_t width, std::uint32_t height, Color8 paper);

  void set(std::uint32_t x, std::uint32_t y, Color8 color);
  Color8 at(std::uint32_t x, std::uint32_t y) const;
  // Mixes `color` into a pixel; coverage in [0, 1].
  void blend(std::uint32_t x, std::uint32_t y, Color8 color, double coverage);

  std::uint32_t width, height;
  std::vector<std::uint8_t> rgb;  // width * height * 3
};

struct Point2 {
  double x = 0, y = 0;
};

// A line through `points` with round ends, `thickness` pixels wide.
void draw_line(Canvas& canvas, std::span<const Point2> points, double thickness, Color8 color);

// A text of which a part may be raised, as an exponent: base, then raised.
struct Label {
  std::string base;
  std::string raised = {};
  bool operator==(const Label&) const = default;
};

// Width of the text in pixels, from the beginning of the first character to the end of the last. `capital`:
// height of a capital letter in pixels.
double text_width(const Label& label, double capital);
// `x`: beginning of the text, `baseline`: lower end of its capitals. The font has letters, digits and
// punctuation of ASCII; any other character is a box.
void draw_text(Canvas& canvas, double x, double baseline, double capital, const Label& label, Color8 color);

// The text, or its beginning and "..", that is at most `width` pixels wide.
std::string fit_text(std::string_view text, double capital, double width);

}  // namespace candela::image
