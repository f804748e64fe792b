// Free flights and transmittance through a grid of extinction.
//
// Space is cut into coarse cells; each knows the least extinction in it, per channel, and the most. A ray
// walks them one by one [Amanatides and Woo 1987]. Inside a cell tentative collisions are drawn from the
// bound, and made real or null by what the grid says there (delta tracking [Woodcock 1965]); transmittance
// takes the cell's least extinction in closed form and estimates what is above it (residual ratio tracking
// [Novak 2014]), so that a uniform grid has no noise at all.
//
// Channels share their collisions. Whether one is real is decided with probabilities in proportion to the
// extinctions seen by the walk's weights so far (history-aware spectral tracking [Kutz 2017, Sec. 5]), which
// keeps the sum of the weights over the channels from ever growing.
#pragma once

#include <memory>
#include <vector>

#include "common/rng/stream.h"
#include "worker/core/vec.h"
#include "worker/scene/media/volume.h"

namespace candela::scene {

class Tracking {
 public:
  Tracking(std::shared_ptr<const GridVolume> grid, float scale);

  // A real collision before t_max; false: none. sigma_weight: T sigma_t / pdf_distance at the collision, or
  // T / P(passing). channels: see Medium::sample_distance; they have a positive sum.
  bool collide(const Ray& ray, Spectrum channels, rng::Stream& stream, double& t, Spectrum& weight) const;
  // An unbiased estimate in [0, 1].
  Spectrum transmittance(const Ray& ray, rng::Stream& stream) const;

  Spectrum sigma_t(Vec3d world) const { return grid_->eval(grid_->to_local(world)) * scale_; }
  Spectrum maximum() const { return grid_->maximum() * scale_; }
  // An upper bound of the optical thickness of the grid along any line.
  double max_thickness() const;

 private:
  struct Cell {
    Spectrum least;
    float most;      // over all channels
    float residual;  // the largest of most - least over the channels
  };
  // The walk of a ray through the cells.
  class Walk;

  std::shared_ptr<const GridVolume> grid_;
  float scale_;
  std::array<std::uint32_t, 3> size_{};
  std::vector<Cell> cells_;
};

}  // namespace candela::scene
