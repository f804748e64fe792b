// A point on an emitting surface, and its density as seen from a reference point.
#pragma once

#include <cmath>
#include <limits>

#include "worker/core/measure.h"
#include "worker/core/vec.h"
#include "worker/scene/hit.h"

namespace candela::scene {

// uv is filled by find_uv() of the surfaces, primitive and barycentric by meshes alone.
struct LightPoint : SurfacePoint {
  Vec3 ng;          // of the emitting front
  Vec3 wi;          // unit, from the reference towards p
  float error = 0;  // of p, as in SurfaceHit
  float pdf_solid_angle = 0;
};

// True if a sample of this density can be used: neither zero, nor beyond the range of floats, nor NaN.
inline bool usable_density(double pdf) {
  return pdf > 0 && pdf < static_cast<double>(std::numeric_limits<float>::max());
}

// Density per solid angle of a point uniform in `area`; zero if it is seen from behind or edge-on.
inline float pdf_of_area_solid_angle(Vec3 reference, Vec3 p, Vec3 ng, double area) {
  const Vec3d v = Vec3d(reference) - Vec3d(p);
  const double distance_squared = length_squared(v);
  const double cosine_times_distance = dot(v, Vec3d(ng));
  if (!(cosine_times_distance > 0)) return 0;
  return static_cast<float>(uniform_area_to_solid_angle(area, distance_squared, std::sqrt(distance_squared),
                                                        cosine_times_distance));
}

// Fills direction and density of a point uniform in `area`, by one square root. False: it has no density.
inline bool finish_by_area(Vec3 reference, double area, LightPoint& out) {
  const Vec3d v = Vec3d(out.p) - Vec3d(reference);
  const double distance_squared = length_squared(v), distance = std::sqrt(distance_squared);
  const double cosine_times_distance = -dot(v, Vec3d(out.ng));
  if (!(cosine_times_distance > 0)) return false;
  out.wi = Vec3(v / distance);
  out.pdf_solid_angle = static_cast<float>(
      uniform_area_to_solid_angle(area, distance_squared, distance, cosine_times_distance));
  return out.pdf_solid_angle > 0 && out.pdf_solid_angle < std::numeric_limits<float>::infinity();
}

}  // namespace candela::scene
