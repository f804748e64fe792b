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
struct LinePair {
  Vec3d between, a, b;  // of the origins, from a's; both directions
  Vec3d normal;         // a x b
  double sine_squared;

  LinePair(Vec3 o_a, Vec3 direction_a, Vec3 o_b, Vec3 direction_b)
      : between(Vec3d(o_b) - Vec3d(o_a)),
        a(direction_a),
        b(direction_b),
        normal(cross(a, b)),
        sine_squared(length_squared(normal)) {}
  // False for no pair whose approach() is closer than r: 1e-12 is more than both sides' rounding.
  bool may_be_within(double r) const {
    const double along_normal = dot(between, normal);
    return along_normal * along_normal <= r * r * sine_squared * (1 + 1e-12);
  }
  Approach approach() const {
    if (!(sine_squared > 0)) return {0, 0, 0, 0};
    const double sine = std::sqrt(sine_squared);
    return {dot(cross(between, b), normal) / sine_squared, dot(cross(between, a), normal) / sine_squared,
            std::abs(dot(between, normal)) / sine, sine};
  }
};
inline Approach closest_approach(Vec3 o_a, Vec3 a, Vec3 o_b, Vec3 b) {
  return LinePair(o_a, a, o_b, b).approach();
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
