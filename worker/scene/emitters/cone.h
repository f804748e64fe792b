// Arithmetic of cones of directions, by the cosines and sines of their angles.
#pragma once

#include <algorithm>
#include <cmath>

#include "worker/core/vec.h"

namespace candela::scene {

inline bool is_zero(Vec3 v) {
  return v.x == 0 && v.y == 0 && v.z == 0;
}

// The sine of an angle in [0, pi].
inline float sine(float cosine) {
  return std::sqrt(std::max(0.0f, 1 - cosine * cosine));
}

// cos and sin of max(0, a - b), from those of a and b in [0, pi].
inline void subtract_angle(float& cos_a, float& sin_a, float cos_b, float sin_b) {
  if (cos_a >= cos_b) {
    cos_a = 1;
    sin_a = 0;
    return;
  }
  const float c = cos_a * cos_b + sin_a * sin_b;
  sin_a = sin_a * cos_b - cos_a * sin_b;
  cos_a = c;
}

}  // namespace candela::scene
