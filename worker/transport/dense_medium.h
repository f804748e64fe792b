// Walks in dense media, where light scatters many times before it comes near a surface.
//
// The walk knows a ball around it that no surface enters. A flight that stays inside needs no ray. Light from
// a lamp has to get through the medium between; what is too faint to be worth its ray ends by roulette, which
// is decided before the ray: exp(-sigma d), over a bound, is the probability that a distance drawn first is
// more than the medium's length d, so that a ray of that distance decides it, or the ball alone.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "worker/core/math.h"
#include "worker/scene/media/medium.h"
#include "worker/scene/scene.h"

namespace candela::transport {

// Mean free paths in the scene's radius above which a homogeneous medium is dense.
inline constexpr float kDense = 10;
// The error of positions as a part of the radius, over a cosine of 1/200 (inside_medium).
inline constexpr float kEndOfMedium = 0x1p-14f;

inline bool is_dense(const scene::Medium& medium, float radius) {
  if (!medium.homogeneous()) return false;
  const float lengths = medium.max_sigma_t().max_component() * radius;
  return lengths > kDense && lengths * kEndOfMedium < 1;
}

// The ball around a walk's vertices in a dense medium.
class EmptyBall {
 public:
  // No surface is closer to the walk than this.
  float clearance() const { return clearance_; }
  // The walk is at p, in `medium`. A new ball is looked for when the old one may be left soon, and not so
  // often where surfaces are near.
  void move(const scene::Scene& scene, Vec3 p, const scene::Medium& medium) {
    const float mean_free_path = 1 / medium.max_sigma_t().max_component();
    clearance_ = radius_ - length(p - center_);
    if (clearance_ > kFew * mean_free_path) return;
    if (wait_ > 0) {
      --wait_;
      clearance_ = std::max(clearance_, 0.0f);
      return;
    }
    center_ = p;
    radius_ = clearance_ = scene.clearance(p, kMost * mean_free_path);
    wait_ = clearance_ > kFew * mean_free_path ? 0 : kWait;
  }
  // The walk has met a surface.
  void leave() {
    radius_ = clearance_ = 0;
    wait_ = kWait;
  }

 private:
  static constexpr float kFew = 2, kMost = 64;  // mean free paths
  static constexpr std::uint32_t kWait = 4;     // vertices

  Vec3 center_;
  float radius_ = 0, clearance_ = 0;
  std::uint32_t wait_ = kWait;
};

// The distance through the medium around a vertex at which the roulette ends light.
class LightReach {
 public:
  LightReach() = default;  // without an end
  // clearance: no surface is closer to the vertex. lamps_are_surfaces: it is enough to know that the distance
  // is below that.
  LightReach(const scene::Medium& medium, float clearance, Vec2 u, bool lamps_are_surfaces)
      : clearance_(clearance) {
    const Spectrum sigma_t = medium.max_sigma_t();
    sigma_ = static_cast<double>(std::min({sigma_t.r, sigma_t.g, sigma_t.b}));
    if (!(sigma_ > 0)) return;
    // 48 bits, and never 0: distances have an end.
    const double x = static_cast<double>(u.x) + static_cast<double>(u.y) * 0x1p-24 + 0x1p-49;
    if (lamps_are_surfaces) {
      // x is at least the power of two of its exponent.
      const auto halvings = 1023 - static_cast<std::int64_t>(std::bit_cast<std::uint64_t>(x) >> 52);
      distance_ = static_cast<float>((kSure + std::numbers::ln2 * static_cast<double>(halvings)) / sigma_) *
                  (1 + 0x1p-22f);
      if (ends_in_medium()) return;
    }
    distance_ = static_cast<float>((kSure - math::log(x)) / sigma_);
  }

  float distance() const { return distance_; }
  // It ends before any surface.
  bool ends_in_medium() const { return distance_ < clearance_; }
  // The probability that the distance is more than d.
  double prob(float d) const {
    const double excess = sigma_ * static_cast<double>(d) - kSure;
    return excess > 0 ? math::exp(-excess) : 1.0;
  }

 private:
  static constexpr double kSure = 1;  // mean free paths that all light passes

  float distance_ = std::numeric_limits<float>::infinity(), clearance_ = 0;
  double sigma_ = 0;  // the least of the channels'
};

// In its place where no media are.
struct NoEmptyBall {};

}  // namespace candela::transport
