#include "client/embedded/volume_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "worker/core/vec.h"

namespace candela::client {
namespace {

using loaders::VolumeData;

constexpr std::uint32_t kMaxSlices = 16, kWantedExtent = 480, kMaxTimes = 64;  // pixels
constexpr double kBrightest = 99.5;                                            // percentile

struct Axes {
  std::size_t right = 0, down = 1;
  bool up = true;  // the second axis points up
};
Axes axes_of(std::size_t axis) {
  return axis == 0 ? Axes{2, 1, true} : axis == 1 ? Axes{0, 2, false} : Axes{0, 1, true};
}

float luminance_at(const VolumeData& volume, const std::array<std::uint32_t, 3>& at) {
  const std::size_t cell = (std::size_t{at[2]} * volume.size[1] + at[1]) * volume.size[0] + at[0];
  const float* v = &volume.values[cell * volume.channels];
  return volume.channels == 3 ? luminance({v[0], v[1], v[2]}) : v[0];
}

// value(at): of the cell that the pixel shows, whose coordinate along the axis is not set.
template <class Value>
VolumePicture picture_of(const VolumeData& volume, std::size_t axis, const Value& value) {
  const Axes axes = axes_of(axis);
  VolumePicture picture{volume.size[axes.right], volume.size[axes.down], {}};
  picture.values.reserve(std::size_t{picture.width} * picture.height);
  std::array<std::uint32_t, 3> at{};
  for (std::uint32_t y = 0; y < picture.height; ++y)
    for (std::uint32_t x = 0; x < picture.width; ++x) {
      at[axes.right] = x;
      at[axes.down] = axes.up ? picture.height - 1 - y : y;
      picture.values.push_back(value(at));
    }
  return picture;
}

std::uint32_t times_for(std::uint32_t width, std::uint32_t height) {
  return std::clamp(kWantedExtent / std::max({width, height, 1u}), 1u, kMaxTimes);
}

// From 0, or from the smallest value above 0, to nearly the brightest.
image::ColorScale volume_scale(const std::vector<float>& values, bool logarithmic) {
  std::vector<float> lit;
  std::copy_if(values.begin(), values.end(), std::back_inserter(lit), [](float v) { return v > 0; });
  image::ColorScale scale;
  if (auto found = image::percentile_scale(lit, 0, kBrightest, logarithmic, false); found.ok())
    scale = *found;
  else if (logarithmic)
    scale.low = 0.1;  // all is black
  scale.logarithmic = logarithmic;
  if (!logarithmic) scale.low = 0;
  if (!(scale.high > scale.low)) scale.high = scale.low + 1;
  return scale;
}

// Copies a picture, each pixel `times` wide and high, to a place of a wider one.
void place_picture(const VolumePicture& picture, std::uint32_t times, std::uint32_t x0, std::uint32_t y0,
                   VolumePicture& on) {
  for (std::uint32_t y = 0; y < picture.height * times; ++y)
    for (std::uint32_t x = 0; x < picture.width * times; ++x)
      on.values[std::size_t{y0 + y} * on.width + x0 + x] =
          picture.values[std::size_t{y / times} * picture.width + x / times];
}

const char* axis_name(std::size_t axis) {
  constexpr std::array<const char*, 3> names = {"x", "y", "z"};
  return names[axis];
}

}  // namespace

VolumePicture project_volume(const VolumeData& volume, std::size_t axis) {
  return picture_of(volume, axis, [&](std::array<std::uint32_t, 3> at) {
    double sum = 0;
    for (at[axis] = 0; at[axis] < volume.size[axis]; ++at[axis])
      sum += static_cast<double>(luminance_at(volume, at));
    return static_cast<float>(sum / volume.size[axis]);
  });
}

VolumePicture slice_volume(const VolumeData& volume, std::size_t axis, std::uint32_t slice) {
  return picture_of(volume, axis, [&](std::array<std::uint32_t, 3> at) {
    at[axis] = slice;
    return luminance_at(volume, at);
  });
}

image::Figure draw_projection(const VolumeData& volume, const VolumePictures& pictures) {
  const VolumePicture small = project_volume(volume, pictures.axis);
  const std::uint32_t times = times_for(small.width, small.height);
  VolumePicture large{small.width * times, small.height * times, {}};
  large.values.resize(std::size_t{large.width} * large.height);
  place_picture(small, times, 0, 0, large);
  const image::ColorScale scale = volume_scale(small.values, pictures.logarithmic);
  return image::draw_false_color(large.values, large.width, large.height, pictures.map, scale,
                                 image::summarize(small.values, scale),
                                 fmt::format("light in space, mean along {}", axis_name(pictures.axis)));
}

image::Figure draw_slices(const VolumeData& volume, const VolumePictures& pictures) {
  const std::uint32_t depth = volume.size[pictures.axis], count = std::min(depth, kMaxSlices);
  std::vector<VolumePicture> slices;
  std::vector<float> values;
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto slice = static_cast<std::uint32_t>((2 * std::uint64_t{i} + 1) * depth / (2 * count));
    slices.push_back(slice_volume(volume, pictures.axis, slice));
    values.insert(values.end(), slices.back().values.begin(), slices.back().values.end());
  }
  const auto columns = static_cast<std::uint32_t>(std::ceil(std::sqrt(count)));
  const std::uint32_t rows = (count + columns - 1) / columns;
  const VolumePicture& first = slices.front();
  constexpr std::uint32_t gap = 4;
  const std::uint32_t times = times_for(first.width * columns / 2, first.height * rows / 2);
  const std::uint32_t step_x = first.width * times + gap, step_y = first.height * times + gap;
  VolumePicture sheet{columns * step_x - gap, rows * step_y - gap, {}};
  sheet.values.resize(std::size_t{sheet.width} * sheet.height);
  for (std::uint32_t i = 0; i < count; ++i)
    place_picture(slices[i], times, i % columns * step_x, i / columns * step_y, sheet);
  const image::ColorScale scale = volume_scale(values, pictures.logarithmic);
  image::Figure figure = image::draw_false_color(
      sheet.values, sheet.width, sheet.height, pictures.map, scale, image::summarize(values, scale),
      fmt::format("light in space, {} slices along {}", count, axis_name(pictures.axis)));
  // The gaps, and places without a slice, are white.
  for (std::uint32_t y = 0; y < sheet.height; ++y)
    for (std::uint32_t x = 0; x < sheet.width; ++x)
      if (x % step_x >= step_x - gap || y % step_y >= step_y - gap ||
          y / step_y * columns + x / step_x >= count)
        figure.canvas.set(figure.picture.x + x, figure.picture.y + y, {255, 255, 255});
  return figure;
}

}  // namespace candela::client
