// Rays around a place, by direction: those of maps in latitude and longitude.
//
// Maps are as Mitsuba's envmap has them: the top row is +y, and column u of 1 looks along (sin 2 pi u, 0,
// -cos 2 pi u). So a map can be the envmap of another scene.
#pragma once

#include <numbers>
#include <optional>

#include "worker/core/math.h"
#include "worker/core/vec.h"
#include "worker/core/warp.h"
#include "worker/scene/scene.h"

namespace candela::integrators {

// Rays of direction d start on the disk across d around the center; with a normal, on the disk across the
// normal, in directions of its side alone.
struct Probe {
  Vec3 center;  // of the scene
  double radius = 0;
  std::optional<Vec3> normal;  // unit
  float error = 0;             // of the center: rays of a disk on a surface begin so far above it
};

// The direction that place (u, v) of a map looks in, both in [0, 1].
inline Vec3 map_direction(double u, double v) {
  double sin_phi = 0, cos_phi = 0, sin_theta = 0, cos_theta = 0;
  math::sincos(2 * std::numbers::pi * u, sin_phi, cos_phi);
  math::sincos(std::numbers::pi * v, sin_theta, cos_theta);
  return Vec3(Vec3d(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi));
}

// The ray of direction d from a place of the probe; on_disk: in [0, 1].
inline Ray probe_ray(const Probe& probe, Vec3 d, Vec2 on_disk) {
  const Vec3 axis = probe.normal ? *probe.normal : d;
  const Vec2 place = warp::concentric_disk(on_disk);
  const auto radius = static_cast<float>(probe.radius);
  const Frame frame = make_frame(axis);
  Vec3 origin = probe.center + frame.s * (place.x * radius) + frame.t * (place.y * radius);
  if (probe.error > 0) origin += axis * probe.error;
  return {origin, d};
}

}  // namespace candela::integrators
