// The statistics of the plug-in bandwidth [Kaplanyan 2017, Eq. 5.16-5.17]: the second moment of what merges
// add, and the Laplacian of the light around the vertex, by a stencil of kernels at distance h.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "common/film/accumulator.h"
#include "worker/transport/kernels.h"
#include "worker/transport/merge_scale.h"
#include "worker/transport/statistics/phi.h"
#include "worker/transport/statistics/put.h"

namespace candela::transport {

// A distance h of the stencil's kernels on surfaces, and what follows from it.
struct SurfacePilot {
  SurfacePilot(Kernel kernel, double first_radius, double pilot)
      : h(static_cast<float>(pilot)),
        r2_over_h2(first_radius * first_radius / (pilot * pilot)),
        disc(kernel, h) {}
  float h;
  double r2_over_h2;
  DiscKernel disc;
};

// Pilots of pixels: levels of a table, by a map of one byte a pixel. Views, which have to outlive it.
struct PilotMap {
  std::span<const SurfacePilot> levels;
  std::string_view map;
  std::uint32_t width = 0, height = 0;
  const SurfacePilot& at(FilmPosition place) const {
    const auto [x, y] = pixel_of(place, width, height);
    return levels[static_cast<unsigned char>(map[std::size_t{y} * width + x])];
  }
};

// Accumulators, without a unit but the film's:
//   moments    sum of k_r(y) phi^2 / k_1,    k_1 = 1 over the area (volume) of the first radius r_1
//   laplacian  sum of D_h(y) phi r_1^2 / k_1,
//   D_h(y) = h^-2 (sum over the axes a of [k_h(y - h a) + k_h(y + h a) - 2 k_h(y)])
//   means      sum of k_r(y) phi / k_1 on surfaces, if the job has this accumulator
// The first two accumulators have a second channel with the sums of media, if the job merges in media.
class PlugInMoments {
 public:
  static constexpr bool kCollects = true, kReaches = true;

  // pilot: h of the epoch, in media, and on surfaces unless there is a map of theirs.
  PlugInMoments(Kernel kernel, double first_radius, double pilot, const PilotMap& pilots = {})
      : first_(first_radius),
        pilots_(pilots),
        pilot_(kernel, first_radius, pilot),
        ball_h_(pilot_.h),
        ball_r2_over_h2_(pilot_.r2_over_h2),
        ball_(kernel, pilot_.h) {}

  // The path that is next is of this place on the film.
  void place(FilmPosition at) {
    if (!pilots_.map.empty()) pilot_ = pilots_.at(at);
  }
  float reach(bool surface) const { return 2 * (surface ? pilot_.h : ball_h_); }
  void begin() {
    moments_ = laplacians_ = {};
    mean_ = 0;
  }
  void start(const ScatterPoint& v, const MergeScale& /*scale*/, float per_path) {
    phi_.start(v, first_, per_path);
    surface_ = v.on_surface();
    if (surface_) frame_ = make_frame(v.hit.ng);
  }
  void add(Vec3 offset, Spectrum value, float factor, float kernel) {
    const double phi = static_cast<double>(phi_.weight(value, factor)) * phi_.scale();
    const double weight = static_cast<double>(kernel) / (surface_ ? first_.per_disc : first_.per_ball);
    const std::size_t part = surface_ ? 0 : 1;
    moments_[part] += weight * phi * phi;
    laplacians_[part] += (surface_ ? on_disc(offset) : in_ball(offset)) * phi;
    if (surface_) mean_ += weight * phi;
  }
  void end() {}
  bool write(std::span<const std::unique_ptr<film::UnitAccumulator>> accumulators, std::uint32_t x,
             std::uint32_t y, float weight, std::uint64_t key, bool alone) const {
    const auto zero = [](double value) { return value == 0; };
    if (std::all_of(moments_.begin(), moments_.end(), zero) &&
        std::all_of(laplacians_.begin(), laplacians_.end(), zero))
      return true;
    const double scale = std::abs(static_cast<double>(weight));
    const std::size_t channels = accumulators[0]->spec().channels;
    auto moments = moments_, laplacians = laplacians_;
    for (double& moment : moments) moment *= scale * scale;
    for (double& laplacian : laplacians) laplacian *= scale;
    const double mean = mean_ * scale;
    const std::array<std::span<const double>, 3> values = {
        std::span(moments).first(channels), std::span(laplacians).first(channels), {&mean, 1}};
    // The stencil reaches further than the disc: a photon may be beyond the Laplacian alone.
    for (std::size_t i = 0; i < accumulators.size(); ++i)
      if (!accumulators[i]->holds(values[i])) return false;
    for (std::size_t i = 0; i < accumulators.size(); ++i)
      put_statistics(*accumulators[i], alone, x, y, values[i], key);
    return true;
  }

  double moment(bool surface = true) const { return moments_[surface ? 0 : 1]; }
  double laplacian(bool surface = true) const { return laplacians_[surface ? 0 : 1]; }
  double mean() const { return mean_; }

 private:
  // D_h r_1^2 / k_1.
  double on_disc(Vec3 offset) const {
    const float u = dot(offset, frame_.s), v = dot(offset, frame_.t), h = pilot_.h;
    const auto at = [&](float du, float dv) {
      const float d2 = (u - du) * (u - du) + (v - dv) * (v - dv);
      return d2 <= h * h ? static_cast<double>(pilot_.disc.value(d2)) : 0.0;
    };
    const double sum = at(h, 0) + at(-h, 0) + at(0, h) + at(0, -h) - 4 * at(0, 0);
    return sum * pilot_.r2_over_h2 / first_.per_disc;
  }
  double in_ball(Vec3 offset) const {
    const float h = ball_h_;
    const auto at = [&](Vec3 to) {
      const Vec3 y = offset - to;
      const float d2 = dot(y, y);
      return d2 <= h * h ? static_cast<double>(ball_.value(d2)) : 0.0;
    };
    const double sum = at({h, 0, 0}) + at({-h, 0, 0}) + at({0, h, 0}) + at({0, -h, 0}) + at({0, 0, h}) +
                       at({0, 0, -h}) - 6 * at({0, 0, 0});
    return sum * ball_r2_over_h2_ / first_.per_ball;
  }

  FirstExtents first_;
  PilotMap pilots_;
  SurfacePilot pilot_;  // of the path
  float ball_h_;
  double ball_r2_over_h2_;
  BallKernel ball_;
  Phi phi_;
  bool surface_ = true;
  Frame frame_;
  std::array<double, 2> moments_{}, laplacians_{};  // on surfaces, in media
  double mean_ = 0;
};

}  // namespace candela::transport
