// The closest approach of two beams, and of a beam and a point.
#pragma once

#include <cmath>

#include "worker/core/vec.h"

namespace candela::transport {

// The closest approach of the lines o_a + s a and o_b + t b, with unit a and b.
struct Approach {
  double along_a, along_b;  // s and t; may be negative, or beyond what a beam is long
  double distance;
  double sine;  // of the angle between the lines; 0: they are parallel, and the rest is not defined
};
// In double, differences of origins first: s and t lose the sine's digits twice. The sine comes from the
// cross product; the root of one minus the squared cosine has no digits below an angle of 1e-4 in float.
inline Approach closest_approach(Vec3 o_a, Vec3 a, Vec3 o_b, Vec3 b) {
  const Vec3d between = Vec3d(o_b) - Vec3d(o_a), da(a), db(b);
  const Vec3d n = cross(da, db);
  const double squared = length_squared(n);
  if (!(squared > 0)) return {0, 0, 0, 0};
  const double sine = std::sqrt(squared);
  return {dot(cross(between, db), n) / squared, dot(cross(between, da), n) / squared,
          std::abs(dot(between, n)) / sine, sine};
}

// The projection of a point on the line o + t d, with unit d.
struct Projection {
  double along;
  double distance_squared;
};
inline Projection project(Vec3 o, Vec3 d, Vec3 p) {
  const Vec3d v = Vec3d(p) - Vec3d(o), direction(d);
  const double along = dot(v, direction) / length_squared(direction);
  return {along, length_squared(v - direction * along)};
}

}  // namespace candela::transport
