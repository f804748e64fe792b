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
#include <span>
#include <vector>

#include "common/rng/stream.h"
#include "worker/core/vec.h"
#include "worker/scene/media/volume.h"

namespace candela::scene {

// From this distance on a flight that is still under way has this weight: an unbiased estimate of T over the
// probability of passing, per channel. Before its first step it is 1.
struct FlightStep {
  float distance;
  Spectrum weight;
};

// The weight of a flight at a distance that it passes.
Spectrum weight_at(std::span<const FlightStep> steps, float distance);

class Tracking {
 public:
  Tracking(std::shared_ptr<const GridVolume> grid, float scale);

  // A real collision before t_max; false: none. sigma_weight: T sigma_t / pdf_distance at the collision, or
  // T / P(passing). channels: see Medium::sample_distance; they have a positive sum. steps, where it is not
  // null and the grid has colors: those of the flight are added to it. In a gray grid the weight is 1 all
  // along.
  bool collide(const Ray& ray, Spectrum channels, rng::Stream& stream, double& t, Spectrum& weight,
               std::vector<FlightStep>* steps) const;
  // An unbiased estimate in [0, 1].
  Spectrum transmittance(const Ray& ray, rng::Stream& stream) const;

  Spectrum sigma_t(Vec3d world) const { return grid_->eval(grid_->to_local(world)) * scale_; }
  // The same, and 0 outside of the grid, as flights and transmittances have it.
  Spectrum sigma_t_inside(Vec3d world) const;
  // The distance at which the ray leaves the grid's box, widened on all sides by `margin` times its size; 0:
  // it misses the box.
  float distance_to_end(const Ray& ray, double margin) const;
  Spectrum maximum() const { return grid_->maximum() * scale_; }

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
