// The importance of a point light that shines into a cone.
#pragma once

#include <algorithm>
#include <cmath>

#include "worker/core/vec.h"
#include "worker/scene/emitters/cone.h"
#include "worker/scene/emitters/light_bounds.h"

namespace candela::scene {

// An estimate of the irradiance at the reference, unoccluded. v: from the reference to the light; front: as
// Scene::sample_direct wants it; axis (unit), cos_cone: of the cone.
inline float cone_importance(float strength, Vec3 v, Vec3 front, Vec3 axis, float cos_cone) {
  const float d2 = std::max(length_squared(v), 1e-36f), inverse_d = 1 / std::sqrt(d2);
  if (-dot(axis, v) * inverse_d < cos_cone - kCosineSlack) return 0;
  if (is_zero(front)) return std::min(strength / d2, kMaxImportance);
  const float h = dot(front, v);
  if (!(h > 0)) return 0;
  return std::min(strength * std::max(h * inverse_d, kMinBoundCosine) / d2, kMaxImportance);
}

}  // namespace candela::scene
