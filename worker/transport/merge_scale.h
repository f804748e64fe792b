// Radii of merging as a function of the film position, with all that follows from a radius: kernels, and the
// merging factors that weights need.
#pragma once

#include <concepts>
#include <cstdint>
#include <span>
#include <string_view>

#include "worker/transport/kernels.h"
#include "worker/transport/mis/factors.h"

namespace candela::transport {

// Scale of the merges of a path, the same at all its vertices.
struct MergeScale {
  MergeScale(Kernel kernel, float disc_radius_, float ball_radius_, const MergeFactors& eta_ = {})
      : disc_radius(disc_radius_),
        ball_radius(ball_radius_),
        disc(kernel, disc_radius_),
        ball(kernel, ball_radius_),
        eta(eta_),
        inner_disc(kernel, disc_radius_ / 2),
        inner_ball(kernel, ball_radius_ / 2) {}
  // Asks for the sum of merges within half of the radius (common/stats/inner_merges.h).
  void want_inner() {
    inner_disc2 = disc_radius * disc_radius / 4;
    inner_ball2 = ball_radius * ball_radius / 4;
  }

  float disc_radius, ball_radius;
  DiscKernel disc;
  BallKernel ball;
  MergeFactors eta;
  // The kernels of half the radius, and its squares: below 0, so that no photon is within, unless
  // want_inner() sets them.
  DiscKernel inner_disc;
  BallKernel inner_ball;
  float inner_disc2 = -1, inner_ball2 = -1;
};

// The scale as a function of the place on the film that a path arrives at, and of nothing else: see EtaField.
// References stay valid as long as the field.
template <class T>
concept ScaleField = requires(const T& field, FilmPosition at) {
  { field.at(at) } -> std::same_as<const MergeScale&>;
};

// The same scale everywhere.
struct ConstantScale {
  MergeScale scale;
  const MergeScale& at(FilmPosition /*place*/) const { return scale; }
};

// A scale for each pixel, by its level: one byte of a map, an index into a table.
class ScaleMap {
 public:
  // Views, which have to outlive the map. Every byte of `map` (width * height of them) is below
  // levels.size().
  ScaleMap(std::span<const MergeScale> levels, std::string_view map, std::uint32_t width,
           std::uint32_t height)
      : levels_(levels), map_(map), width_(width), height_(height) {}
  const MergeScale& at(FilmPosition place) const {
    const auto [x, y] = pixel_of(place, width_, height_);
    return levels_[static_cast<unsigned char>(map_[std::size_t{y} * width_ + x])];
  }

 private:
  std::span<const MergeScale> levels_;
  std::string_view map_;
  std::uint32_t width_, height_;
};

// The eta of a field, for splats.
template <ScaleField Field>
struct EtaOf {
  const Field& field;
  const MergeFactors& at(FilmPosition place) const { return field.at(place).eta; }
};

}  // namespace candela::transport
