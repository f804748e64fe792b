// Bounds of the error of a point on a surface that is rounded to float.
#pragma once

#include <cmath>

#include "worker/core/vec.h"

namespace candela::scene {

inline constexpr float kHalfUlp = 0x1p-24f;  // the largest relative error of rounding to float

// Distance by which a point rounded once, and the origin of a ray rounded again, leave the plane with normal
// n through it; see geometry.cpp.
inline float rounding_error(Vec3 n, Vec3 p) {
  return 3 * kHalfUlp * (std::abs(n.x * p.x) + std::abs(n.y * p.y) + std::abs(n.z * p.z));
}

// On a curved surface rounding moves a point along it too, by twice e |p| at most, and off it by the square
// of that over the diameter.
inline float curvature_error(Vec3 p, double radius) {
  const double slip = 2.0 * static_cast<double>(kHalfUlp) *
                      static_cast<double>(std::abs(p.x) + std::abs(p.y) + std::abs(p.z));
  return static_cast<float>(slip * slip / radius);
}

}  // namespace candela::scene
