// Light walks that are led along a path which an eye's walk has made: the random numbers that bring a walk to
// given places are found by trying the functions that the walk calls, so that all else is the product's code.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "worker/scene/scene.h"
#include "worker/transport/segments.h"
#include "worker/transport/walk.h"

namespace candela::test {

inline constexpr float kBelowOne = 1 - 0x1p-24f;

// The least |residual(u)| over the unit square, from a grid of starts on by the method of Gauss and Newton.
// residual(u, Vec3d& out): false where there is none.
template <class Residual>
double find_least(const Residual& residual, Vec2& best) {
  constexpr int kGrid = 16, kStarts = 3;
  struct Start {
    double size;
    Vec2 u;
  };
  std::vector<Start> starts;
  Vec3d r;
  for (int i = 0; i < kGrid * kGrid; ++i) {
    const Vec2 u{(static_cast<float>(i % kGrid) + 0.5f) / kGrid,
                 (static_cast<float>(i) / kGrid + 0.5f) / (kGrid + 1)};
    if (residual(u, r)) starts.push_back({length_squared(r), u});
  }
  std::sort(starts.begin(), starts.end(), [](const Start& a, const Start& b) { return a.size < b.size; });
  double least = 1e300;
  for (std::size_t s = 0; s < std::min<std::size_t>(kStarts, starts.size()); ++s) {
    Start at = starts[s];
    if (!residual(at.u, r)) continue;
    for (int step = 0; step < 24 && at.size > 1e-18; ++step) {
      const auto beside = [&](float x, float h) { return x + h < 1 ? h : -h; };
      const float h = step < 6 ? 1e-3f : 1e-4f;
      const float hx = beside(at.u.x, h), hy = beside(at.u.y, h);
      Vec3d rx, ry;
      if (!residual({at.u.x + hx, at.u.y}, rx) || !residual({at.u.x, at.u.y + hy}, ry)) break;
      const Vec3d dx = (rx - r) * (1.0 / static_cast<double>(hx)),
                  dy = (ry - r) * (1.0 / static_cast<double>(hy));
      const double a = dot(dx, dx), b = dot(dx, dy), c = dot(dy, dy), det = a * c - b * b;
      if (!(det > 0)) break;
      const double mx = (c * dot(dx, r) - b * dot(dy, r)) / det, my = (a * dot(dy, r) - b * dot(dx, r)) / det;
      bool better = false;
      for (double share = 1; share > 1e-3 && !better; share *= 0.5) {
        const auto moved = [&](float x, double by) {
          return std::clamp(static_cast<float>(static_cast<double>(x) - share * by), 0.0f, kBelowOne);
        };
        const Vec2 u{moved(at.u.x, mx), moved(at.u.y, my)};
        Vec3d there;
        if (!residual(u, there) || !(length_squared(there) < at.size)) continue;
        at = {length_squared(there), u};
        r = there;
        better = true;
      }
      if (!better) break;
    }
    if (at.size < least) {
      least = at.size;
      best = at.u;
    }
    if (least < 1e-14) break;
  }
  return std::sqrt(least);
}

// Stands in for the sampler of a walk from the light. Roulette never ends it.
struct LedSampler {
  float select = 0.5f, lobe = 0.5f, emitter_choice = 0.5f;
  Vec2 position{0.5f, 0.5f}, start_direction{0.5f, 0.5f}, direction{0.5f, 0.5f}, flight{0.5f, 0.5f},
      point{0.5f, 0.5f};  // on a light or on the lens

  float draw_1d(std::uint32_t dimension, bool /*stratified*/) const {
    if (dimension == 0) return select;
    switch ((dimension - transport::kLightDimensions) % transport::kBlock) {
      case transport::kLobe:
        return lobe;
      case transport::kEmitterChoice:
        return emitter_choice;
      default:
        return 0;
    }
  }
  Vec2 draw_2d(std::uint32_t dimension, bool /*stratified*/) const {
    if (dimension < transport::kLightDimensions) return dimension == 1 ? position : start_direction;
    switch ((dimension - transport::kLightDimensions) % transport::kBlock) {
      case transport::kDirection:
        return direction;
      case transport::kFlight:
        return flight;
      case transport::kEmitterPoint:  // and kLens
        return point;
      default:
        return {0.5f, 0.5f};
    }
  }
  static std::uint64_t sample_key() { return 1; }
};
inline transport::VertexDraws<LedSampler> draws_of(LedSampler& sampler) {
  return {sampler, transport::kLightDimensions, false};
}

// Ends each flight at the target, if that is in the medium, and keeps the crossing.
class FlightLeader {
 public:
  FlightLeader(const scene::Scene& scene, LedSampler& sampler, transport::Crossing& last, const Vec3d& target,
               const bool& in_medium)
      : scene_(&scene), sampler_(&sampler), keeper_(last), target_(&target), in_medium_(&in_medium) {}

  void stretch(const transport::MediumSegment& segment) {
    keeper_.stretch(segment);
    sampler_->flight = {0.5f, kBelowOne};
    if (!*in_medium_) return;
    const double wanted = length(*target_ - Vec3d(segment.ray.origin));
    const scene::Medium& medium = scene_->medium(segment.medium);
    const auto reached = [&](std::int32_t i) {
      const scene::DistanceSample at =
          medium.sample_distance({segment.ray.origin, segment.ray.direction}, segment.throughput,
                                 {0.5f, static_cast<float>(i) * 0x1p-24f});
      return at.scattered ? static_cast<double>(at.distance) : 1e30;
    };
    std::int32_t low = 0, high = (1 << 24) - 1;
    while (high - low > 1) {
      const std::int32_t middle = (low + high) / 2;
      (reached(middle) < wanted ? low : high) = middle;
    }
    const bool first = wanted - reached(low) < reached(high) - wanted;
    sampler_->flight.y = static_cast<float>(first ? low : high) * 0x1p-24f;
  }
  std::vector<scene::FlightStep>* steps() { return keeper_.steps(); }
  void scattered(float distance) { keeper_.scattered(distance); }
  void survived() { keeper_.survived(); }

 private:
  const scene::Scene* scene_;
  LedSampler* sampler_;
  transport::CrossingObserver keeper_;
  const Vec3d* target_;
  const bool* in_medium_;
};

// Turns the walk at v towards `to` (unit, world), by a delta lobe or not. How far off it will go.
inline double lead_scattering(const scene::Scene& scene, const transport::ScatterPoint& v, Vec3d to,
                              bool delta, scene::TransportMode mode, LedSampler& sampler) {
  if (!v.on_surface()) {
    const scene::Phase& phase = scene.medium(v.medium).phase();
    return find_least(
        [&](Vec2 u, Vec3d& r) {
          Vec3 wi;
          phase.sample(v.wo, u, wi);
          r = Vec3d(wi) - to;
          return true;
        },
        sampler.direction);
  }
  const Vec3 wo = v.hit.shading.to_local(v.wo);
  double least = 1e300;
  const int lobes = v.closure.chooses_lobe() ? 12 : 1;
  for (int i = 0; i < lobes; ++i) {
    const float lobe = (static_cast<float>(i) + 0.5f) / static_cast<float>(lobes);
    const auto off = [&](Vec2 u, Vec3d& r) {
      scene::BsdfSample next;
      if (!v.closure.sample(wo, lobe, u, mode, next) || next.delta != delta || next.passthrough) return false;
      r = Vec3d(v.hit.shading.to_world(next.wi)) - to;
      return true;
    };
    Vec2 u{0.5f, 0.5f};
    double found = 1e300;
    if (delta) {
      Vec3d r;
      if (off(u, r)) found = length(r);
    } else {
      found = find_least(off, u);
    }
    if (found < least) {
      least = found;
      sampler.lobe = lobe;
      sampler.direction = u;
    }
    if (least < 1e-7) break;
  }
  return least;
}

// Starts a light walk at `light`, towards `first`. How far off it will start.
inline double lead_start(const scene::Scene& scene, std::uint32_t emitter, Vec3d light, Vec3d first,
                         LedSampler& sampler) {
  scene::EmissionSample sample;
  constexpr int kTries = 64;
  int i = 0;
  for (; i < kTries; ++i) {
    sampler.select = (static_cast<float>(i) + 0.5f) / kTries;
    if (scene.sample_emission(sampler.select, {0.5f, 0.5f}, {0.5f, 0.5f}, sample) &&
        sample.vertex.emitter == emitter)
      break;
  }
  if (i == kTries) return 1e300;
  const double off = find_least(
      [&](Vec2 u, Vec3d& r) {
        if (!scene.sample_emission(sampler.select, u, {0.5f, 0.5f}, sample)) return false;
        r = Vec3d(sample.vertex.p) - light;
        return true;
      },
      sampler.position);
  const Vec3d between = first - light, to = between * (1 / length(between));
  return off + find_least(
                   [&](Vec2 u, Vec3d& r) {
                     if (!scene.sample_emission(sampler.select, sampler.position, u, sample)) return false;
                     r = Vec3d(sample.ray.direction) - to;
                     return true;
                   },
                   sampler.start_direction);
}

// Next event estimation at v chooses the light's point. How far off it will be.
inline double lead_direct(const scene::Scene& scene, const transport::ScatterPoint& v, std::uint32_t emitter,
                          Vec3d light, LedSampler& sampler) {
  scene::DirectSample sample;
  double least = 1e300;
  constexpr int kTries = 64;
  for (int i = 0; i < kTries; ++i) {
    const float choice = (static_cast<float>(i) + 0.5f) / kTries;
    const bool some =
        scene.sample_direct(v.hit, v.front, choice, {0.5f, 0.5f}, sample) != scene::DirectOutcome::failed;
    if (!some || sample.emitter != emitter) continue;
    Vec2 u{0.5f, 0.5f};
    const double off = find_least(
        [&](Vec2 at, Vec3d& r) {
          if (scene.sample_direct(v.hit, v.front, choice, at, sample) == scene::DirectOutcome::failed)
            return false;
          r = Vec3d(sample.p) - light;
          return true;
        },
        u);
    if (off < least) {
      least = off;
      sampler.emitter_choice = choice;
      sampler.point = u;
    }
    break;
  }
  return least;
}

}  // namespace candela::test
