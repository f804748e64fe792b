// The delta lobes of a closure as a list, for estimators that look at all of them instead of drawing one.
#pragma once

#include <cstdint>

#include "worker/scene/bsdf.h"

namespace candela::scene {

// A delta lobe: what arrives along -wo leaves along wi, times `attenuation` (f |cos theta_i| integrated over
// the lobe, with the index factor of refraction in radiance mode).
struct TurningLobe {
  Vec3 wi;
  Spectrum attenuation;
};

struct TurningLobes {
  static constexpr std::uint32_t kMax = 2;
  TurningLobe lobes[kMax];
  std::uint32_t count = 0;
  const TurningLobe* begin() const { return lobes; }
  const TurningLobe* end() const { return lobes + count; }
};

// The delta lobes that turn light: one that passes straight on is none. Mirrors, glass, thin glass and
// plastic have all their lobes in the list, and so has a composite bsdf, one for each direction. If it has
// more than the list holds, the brightest is kept and another is drawn by u_lobe and u, divided by its
// probability: the list is right in the mean.
TurningLobes turning_lobes(const Closure& closure, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode);

}  // namespace candela::scene
