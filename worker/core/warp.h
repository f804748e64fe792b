// Warps of the unit square to the shapes light transport samples, with their densities. All are continuous
// and keep the stratification of their input.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "worker/core/math.h"
#include "worker/core/vec.h"

namespace candela::warp {
namespace detail {

// condition ? a : b by masks: compilers turn two selects of one condition into a branch.
inline float select(bool condition, float a, float b) {
  const std::uint32_t mask = 0u - static_cast<std::uint32_t>(condition);
  return std::bit_cast<float>((std::bit_cast<std::uint32_t>(a) & mask) |
                              (std::bit_cast<std::uint32_t>(b) & ~mask));
}

}  // namespace detail

// Uniform on the unit disk (Shirley and Chiu 1997, the form without a seam by Cline).
inline Vec2 concentric_disk(Vec2 u) {
  const float a = 2 * u.x - 1;
  const float b = 2 * u.y - 1;
  if (a == 0 && b == 0) return {0, 0};
  // r is the larger of a and b; from its axis the angle is pi/4 times the ratio. Which of the two it is, is a
  // coin's toss: selected, not branched on.
  const bool along_x = std::abs(a) > std::abs(b);
  const float r = along_x ? a : b;
  const float other = along_x ? b : a;
  const float angle = (math::kPi / 4) * (other / r);
  // Minimax on [-pi/4, pi/4], relative errors below 1e-7 [Moshier, Cephes sinf and cosf].
  const float z = angle * angle;
  const float s = angle + angle * z * (-1.6666654611e-1f + z * (8.3321608736e-3f + z * -1.9515295891e-4f));
  const float c = 1 - 0.5f * z +
                  z * z * (4.166664568298827e-2f + z * (-1.388731625493765e-3f + z * 2.443315711809948e-5f));
  return {r * detail::select(along_x, c, s), r * detail::select(along_x, s, c)};
}

// Proportional to cos theta on the upper hemisphere. z is above 0 for every u in [0, 1)^2.
inline Vec3 cosine_hemisphere(Vec2 u) {
  const Vec2 d = concentric_disk(u);
  return {d.x, d.y, std::sqrt(std::max(1e-12f, 1 - d.x * d.x - d.y * d.y))};
}
inline float pdf_cosine_hemisphere_solid_angle(float cos_theta) {
  return std::max(0.0f, cos_theta) * math::kInvPi;
}

// Uniform on the sphere of directions.
inline Vec3 uniform_sphere(Vec2 u) {
  const float z = 1 - 2 * u.y;
  const float r = 2 * std::sqrt(std::max(0.0f, u.y * (1 - u.y)));  // sqrt(1 - z^2) without its cancellation
  float s = 0;
  float c = 0;
  math::sincosf(2 * math::kPi * u.x, s, c);
  return {r * c, r * s, z};
}
inline constexpr float kPdfUniformSphereSolidAngle = math::kInvPi / 4;

// Uniform in the cone around +z whose half angle has 1 - cos = one_minus_cos_max in (0, 2]. Given so, a cone
// of a millionth of a degree keeps its precision: one_minus_cos = sin^2 / (1 + cos).
inline Vec3 uniform_cone(Vec2 u, float one_minus_cos_max) {
  const float h = u.y * one_minus_cos_max;  // 1 - cos theta
  const float r = std::sqrt(std::max(0.0f, h * (2 - h)));
  float s = 0;
  float c = 0;
  math::sincosf(2 * math::kPi * u.x, s, c);
  return {r * c, r * s, 1 - h};
}
inline float pdf_uniform_cone_solid_angle(float one_minus_cos_max) {
  return 1 / (2 * math::kPi * one_minus_cos_max);
}

// Uniform on a triangle: the barycentric coordinates (b1, b2) of its second and third vertices (Heitz 2019,
// "A low-distortion map between triangle and square"). The density per area is 1 / area.
inline Vec2 uniform_triangle(Vec2 u) {
  if (u.y > u.x) {
    const float b1 = u.x / 2;
    return {b1, u.y - b1};
  }
  const float b2 = u.y / 2;
  return {u.x - b2, b2};
}

}  // namespace candela::warp
