// Importance of places on the film, for the second stage of two-stage Metropolis [Veach 1997, ch. 11]: chains
// follow luminance times importance. Importance falls with the brightness of the image, so that dark parts of
// the film get as many states as bright ones, and have no larger relative error. Estimators divide it out: it
// decides noise, never the mean.
//
// A first stage estimates the mean luminance L of each cell of a coarse grid. With m, the mean of all cells,
//   importance = m / sqrt(L^2 + m^2 / 100)
// which minimizes the sum of squared errors over L^2 + m^2 / 100 if the states of a chain are independent
// (common/stats/image_error.h has the same floor). It is interpolated between the centers of cells.
//
// The first stage may miss a small bright light: its cell is then dark, its importance high, and luminance
// times importance is far above the light's share of the image. So the importance also falls with the
// luminance of a single splat: luminance times importance is at most the larger of 32 means and kMaxShare of
// the sum over all N samples of the first stage, which such a sample would have shown, as long as the
// importance is above kMinOfSplat. Light that N samples miss, of a probability of 1 / N or little more, then
// has at most about kMaxShare m of the mean of luminance times importance.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "worker/transport/film_position.h"

namespace candela::mcmc {

// Square cells of a film of this size; those at the right and below may reach beyond it.
struct CoarseGrid {
  static constexpr std::uint32_t kMinExtent = 4, kMaxCells = 1024;  // pixels a side; cells in all

  CoarseGrid(std::uint32_t width, std::uint32_t height);
  std::uint32_t cells() const { return columns * rows; }
  // The cell that a place is in; of a place beside the film, the nearest cell.
  std::uint32_t cell_of(transport::FilmPosition at) const;
  // Pixels of the film in a cell.
  double pixels_of(std::uint32_t cell) const;

  std::uint32_t width, height, extent, columns, rows;
};

class ImageImportance {
 public:
  // A level stands for the importance 2^(level / 16 - 8).
  static constexpr std::uint8_t kMaxLevel = 254;

  // 1 everywhere.
  ImageImportance() = default;
  // levels: of each cell, row by row, at most kMaxLevel. max_scalar: of luminance times importance.
  ImageImportance(const CoarseGrid& grid, std::vector<std::uint8_t> levels,
                  double max_scalar = std::numeric_limits<double>::infinity());

  bool even() const { return levels_.empty(); }
  // Null if even.
  const ImageImportance* used() const { return even() ? nullptr : this; }
  std::span<const std::uint8_t> levels() const { return levels_; }
  double max_scalar() const { return max_scalar_; }
  // The importance of a splat of this luminance.
  double at(transport::FilmPosition place, double luminance) const;

 private:
  std::vector<std::uint8_t> levels_;
  double max_scalar_ = std::numeric_limits<double>::infinity();
  std::vector<double> values_;
  double per_pixel_ = 1, last_column_ = 0, last_row_ = 0;
  std::size_t columns_ = 1;
};

// luminances: the mean of each cell, >= 0. Cells are smoothed with their neighbors first. Even if all are 0.
// samples: of the first stage; sample_mean: the mean luminance of one.
ImageImportance importance_of(const CoarseGrid& grid, std::span<const double> luminances,
                              std::uint64_t samples, double sample_mean);

}  // namespace candela::mcmc
