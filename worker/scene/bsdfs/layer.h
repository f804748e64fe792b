// A dielectric layer on a surface: directions outside of it and inside of it, on the same side of the
// surface.
#pragma once

#include <algorithm>
#include <cmath>

#include "worker/core/math.h"
#include "worker/core/vec.h"
#include "worker/scene/bsdfs/fresnel.h"

namespace candela::scene {

struct Refracted {
  Vec3 inside;
  float reflectance = 1;  // of a smooth layer along the outer direction; 1: nothing gets in
};

// eta: of the layer over outside.
inline Refracted refract_in(float eta, Vec3 w) {
  Refracted result;
  float cosine = 0;
  result.reflectance =
      fresnel_dielectric(std::min(1.0f, std::abs(w.z)), std::min(1.0f, w.x * w.x + w.y * w.y), eta, cosine);
  result.inside = {w.x / eta, w.y / eta, std::copysign(cosine, w.z)};
  return result;
}

// False: total internal reflection.
inline bool refract_out(float eta, Vec3 w, Vec3& out) {
  const float x = w.x * eta, y = w.y * eta;
  const float sin2 = x * x + y * y;
  if (!(sin2 < 1)) return false;
  out = normalize(Vec3{x, y, std::copysign(std::sqrt(1 - sin2), w.z)});
  return out.z != 0;
}

inline bool enters(const Refracted& r) {
  return r.reflectance < 1 && r.inside.z != 0;
}

// The part of `passing` that the layer does not absorb on the way in along o and out along i. absorption:
// sigma_a times the thickness.
inline Spectrum absorbed(float passing, Spectrum absorption, const Refracted& o, const Refracted& i) {
  if (absorption.is_black()) return Spectrum(passing);
  const float path = 1 / std::abs(o.inside.z) + 1 / std::abs(i.inside.z);
  const auto channel = [&](float a) { return passing * math::expf(-std::min(a * path, 80.0f)); };
  return {channel(absorption.r), channel(absorption.g), channel(absorption.b)};
}

// The share of samples that a layer's reflection gets where both it and what is below reflect.
inline float layer_share(Spectrum specular, Spectrum absorption) {
  const auto kept = [](float a) { return math::expf(-std::min(2 * a, 80.0f)); };
  const float mean = (kept(absorption.r) + kept(absorption.g) + kept(absorption.b)) / 3;
  return specular.is_black() ? 0.0f : 1 / (mean + 1);
}

inline float prob_reflection(float share, float reflectance) {
  const float r = reflectance * share, t = (1 - reflectance) * (1 - share);
  return r + t > 0 ? r / (r + t) : 0.0f;
}

}  // namespace candela::scene
