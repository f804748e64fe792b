// A point on a surface found by a ray.
#pragma once

#include <cstdint>

#include "worker/core/vec.h"
#include "worker/scene/surface_point.h"

namespace candela::scene {

// p is recomputed from the primitive by our own arithmetic, not origin + t * direction.
struct SurfaceHit : SurfacePoint {
  Vec3 ng;             // unit geometric normal as the shape defines its outside (not turned to the ray)
  Frame shading;       // shading.n on the same side as ng
  float distance = 0;  // along the ray
  std::uint32_t shape = kNone;
  std::uint32_t bsdf = kNone;
  std::uint32_t emitter = kNone;           // index of the area emitter here
  std::uint32_t medium_interface = kNone;  // where the medium changes: Media::beyond
  // Derivatives of p by u and v; only where the bsdf reads them (ShapeRecord::reads_partials).
  Vec3 dp_du, dp_dv;
  float error = 0;  // absolute position error bound of p: offsets of new rays follow it
};

// A ray leaving the surface at `hit` in direction `d` (unit), its origin moved off the surface along ng, to
// d's side, by hit.error. Correct from 1e-4 to 1e6 times unit scale and far from the origin.
inline Ray spawn_ray(const SurfaceHit& hit, Vec3 d) {
  const float side = dot(d, hit.ng) < 0 ? -hit.error : hit.error;
  return {hit.p + hit.ng * side, d};
}
// The same towards a point: t_max ends just before `target`.
Ray spawn_shadow_ray(const SurfaceHit& hit, Vec3 target, Vec3 target_ng, float target_error);

// True if the surface at `hit` goes through p, as far as rounding lets tell: then a ray from p meets it
// nowhere else, and it hides nothing of p, just as shadow rays end before what they are aimed at.
bool goes_through(const SurfaceHit& hit, Vec3 p);

}  // namespace candela::scene
