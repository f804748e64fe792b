#include "worker/mcmc/image_importance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "worker/core/math.h"

namespace candela::mcmc {
namespace {

constexpr double kFloor = 0.01;  // of the squared mean
// A chain that stays at one place adds at most its inverse to the film for each state, in units of b0:
// chains::film_scale_log2() leaves room for that.
constexpr double kMinImportance = 1.0 / 64, kMinOfSplat = 1.0 / 1024;
// The limit of luminance times importance, as a share of the sum over the first stage's samples. Few samples
// have a wide range of luminances: a splat as bright as the first stage believes (first_stage.cpp) is not
// limited.
constexpr double kMaxShare = 1.0 / 16, kMinLimit = 32;
constexpr double kLevelsPerOctave = 16, kLevelOfOne = 128;

std::uint32_t divide_up(std::uint32_t a, std::uint32_t b) {
  return (a - 1) / b + 1;
}

double value_of(std::uint8_t level) {
  constexpr double kLog2 = 0.69314718055994531;
  return math::exp((level - kLevelOfOne) / kLevelsPerOctave * kLog2);
}

std::uint8_t level_of(double importance) {
  constexpr double kLog2 = 0.69314718055994531;
  const double level = kLevelOfOne + kLevelsPerOctave * math::log(importance) / kLog2;
  return static_cast<std::uint8_t>(
      std::clamp(std::floor(level + 0.5), 0.0, static_cast<double>(ImageImportance::kMaxLevel)));
}

// Weights 1/4, 1/2, 1/4 along rows and along columns; cells beyond the border have none.
std::vector<double> smoothed(const CoarseGrid& grid, std::span<const double> cells) {
  constexpr std::array<double, 2> kWeights{0.5, 0.25};  // by distance
  std::vector<double> out(cells.size());
  for (std::uint32_t y = 0; y < grid.rows; ++y)
    for (std::uint32_t x = 0; x < grid.columns; ++x) {
      double sum = 0, weights = 0;
      for (std::uint32_t v = y - std::min(y, 1U); v < std::min(y + 2, grid.rows); ++v)
        for (std::uint32_t u = x - std::min(x, 1U); u < std::min(x + 2, grid.columns); ++u) {
          const double weight = kWeights[u == x ? 0 : 1] * kWeights[v == y ? 0 : 1];
          sum += weight * cells[std::size_t{v} * grid.columns + u];
          weights += weight;
        }
      out[std::size_t{y} * grid.columns + x] = sum / weights;
    }
  return out;
}

}  // namespace

CoarseGrid::CoarseGrid(std::uint32_t film_width, std::uint32_t film_height)
    : width(film_width), height(film_height), extent(kMinExtent), columns(0), rows(0) {
  const double pixels = static_cast<double>(width) * height;
  extent = std::max(extent, static_cast<std::uint32_t>(std::ceil(std::sqrt(pixels / kMaxCells))));
  for (;; ++extent) {
    columns = divide_up(width, extent);
    rows = divide_up(height, extent);
    if (std::uint64_t{columns} * rows <= kMaxCells) return;
  }
}

std::uint32_t CoarseGrid::cell_of(transport::FilmPosition at) const {
  const transport::Pixel pixel = transport::pixel_of(at, width, height);
  return pixel.y / extent * columns + pixel.x / extent;
}

double CoarseGrid::pixels_of(std::uint32_t cell) const {
  const std::uint32_t x = cell % columns * extent, y = cell / columns * extent;
  return static_cast<double>(std::min(extent, width - x)) * std::min(extent, height - y);
}

ImageImportance::ImageImportance(const CoarseGrid& grid, std::vector<std::uint8_t> levels, double max_scalar)
    : levels_(std::move(levels)),
      max_scalar_(max_scalar),
      per_pixel_(1.0 / grid.extent),
      last_column_(grid.columns - 1),
      last_row_(grid.rows - 1),
      columns_(grid.columns) {
  for (const std::uint8_t level : levels_) values_.push_back(value_of(level));
}

double ImageImportance::at(transport::FilmPosition place, double luminance) const {
  if (values_.empty()) return 1;
  const double x = std::clamp(static_cast<double>(place.x) * per_pixel_ - 0.5, 0.0, last_column_),
               y = std::clamp(static_cast<double>(place.y) * per_pixel_ - 0.5, 0.0, last_row_);
  const auto column = static_cast<std::size_t>(x), row = static_cast<std::size_t>(y);
  const double u = x - static_cast<double>(column), v = y - static_cast<double>(row);
  const double* here = &values_[row * columns_ + column];
  const std::size_t right = u > 0 ? 1 : 0, below = v > 0 ? columns_ : 0;
  const double of_place =
      (here[0] * (1 - u) + here[right] * u) * (1 - v) + (here[below] * (1 - u) + here[below + right] * u) * v;
  if (!(luminance * of_place > max_scalar_)) return of_place;
  return std::max(max_scalar_ / luminance, kMinOfSplat);
}

ImageImportance importance_of(const CoarseGrid& grid, std::span<const double> luminances,
                              std::uint64_t samples, double sample_mean) {
  const std::vector<double> cells = smoothed(grid, luminances);
  double mean = 0;
  for (const double cell : cells) mean += cell / static_cast<double>(cells.size());
  if (!(mean > 0) || !std::isfinite(mean)) return {};
  std::vector<std::uint8_t> levels;
  for (const double cell : cells) {
    const double relative = cell / mean;
    levels.push_back(level_of(std::max(kMinImportance, 1 / std::sqrt(relative * relative + kFloor))));
  }
  const double limit = std::max(kMinLimit, kMaxShare * static_cast<double>(samples));
  return {grid, std::move(levels), limit * sample_mean};
}

}  // namespace candela::mcmc
