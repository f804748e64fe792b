// Shadow rays that neither meet the surface they leave nor the one they are aimed at.
#include "worker/scene/hit.h"

#include <cmath>

#include "worker/scene/shapes/rounding.h"

namespace candela::scene {

Ray spawn_shadow_ray(const SurfaceHit& hit, Vec3 target, Vec3 target_ng, float target_error) {
  const Vec3 rough = target - hit.p;
  const Vec3 origin = hit.p + hit.ng * (dot(rough, hit.ng) < 0 ? -hit.error : hit.error);
  // The end moves off the light's surface towards the reference. A direction rounded to float misses by some
  // 2^-23 of the distance, which the offset covers too, so that grazing rays do not meet the light either.
  const float distance = std::abs(rough.x) + std::abs(rough.y) + std::abs(rough.z);  // at least
  const float lift = target_error + distance * 0x1p-21f;
  const Vec3 end = target + target_ng * (dot(rough, target_ng) < 0 ? lift : -lift);
  const Vec3 d = end - origin;
  const float l = length(d);
  if (!(l > 0)) return {origin, hit.ng, 0.0f};  // nothing lies between
  return {origin, d / l, l * (1 - 0x1p-20f)};
}

bool goes_through(const SurfaceHit& hit, Vec3 p) {
  const double height = dot(Vec3d(hit.ng), Vec3d(p) - Vec3d(hit.p));  // double: the difference cancels
  return std::abs(height) <= static_cast<double>(hit.error + rounding_error(hit.ng, p));
}

}  // namespace candela::scene
