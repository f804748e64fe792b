// The bounds behind an emitting surface's importance: its place and its normals.
#pragma once

#include <algorithm>
#include <cmath>

#include "worker/core/vec.h"
#include "worker/scene/emitters/cone.h"
#include "worker/scene/emitters/light_bounds.h"

namespace candela::scene {

struct SurfaceExtent {
  Vec3 center;
  float radius = 0;
  // The cone that holds all normals. cos_spread -1: they point everywhere, and the axis means nothing.
  Vec3 axis;
  float cos_spread = -1, sin_spread = 0;

  // The share of the area that a distant point sees: on average a quarter of a closed surface's.
  float seen() const { return cos_spread > 0 ? 1.0f : 0.25f; }

  // An estimate of the irradiance at p from the surface, unoccluded; zero only where it can give none.
  // kCone: read the cone of normals.
  template <bool kCone>
  float importance(float strength, Vec3 p, Vec3 front) const {
    const bool both_sides = is_zero(front);
    const Vec3 v = center - p;
    const float d2 = length_squared(v);
    const float h = dot(front, v);
    if (!both_sides && h <= -radius * (1 + kCosineSlack) - kCosineSlack * std::sqrt(d2)) return 0;
    const float r2 = std::max(radius * radius, 1e-36f);
    if (d2 <= r2) return std::min(strength / r2, kMaxImportance);
    const float inverse_d = 1 / std::sqrt(d2);
    const float sin_extent = std::min(1.0f, radius * inverse_d), cos_extent = sine(sin_extent);
    float result = strength * inverse_d * inverse_d;
    if constexpr (kCone) {
      // The least angle between a normal of the emitter and the direction to the reference.
      float c = std::clamp(-dot(axis, v) * inverse_d, -1.0f, 1.0f), s = sine(c);
      subtract_angle(c, s, cos_spread, sin_spread);
      subtract_angle(c, s, cos_extent, sin_extent);
      if (c < -kCosineSlack) return 0;
      result *= std::max(c, kMinBoundCosine);
    }
    if (!both_sides) {
      float c = std::clamp(h * inverse_d, -1.0f, 1.0f), s = sine(c);
      subtract_angle(c, s, cos_extent, sin_extent);
      result *= std::max(c, kMinBoundCosine);
    }
    return std::min(result, kMaxImportance);
  }
};

}  // namespace candela::scene
