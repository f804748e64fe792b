// Bounds of one emitter: where it is, where it shines, how strongly.
#pragma once

#include <cstdint>

#include "worker/core/vec.h"
#include "worker/scene/bounds.h"

namespace candela::scene {

// A cosine's bound that is possible but small still counts this much.
inline constexpr float kMinBoundCosine = 0.02f;
// Rounding of the bounds must not declare a possible emitter impossible.
inline constexpr float kCosineSlack = 1e-3f;
inline constexpr float kMaxImportance = 1e30f;

struct LightBounds {
  Bounds box;
  Vec3 axis{0, 0, 1};  // of the cone that holds all normals (directions, for a point)
  float spread = 0;    // its half angle, radians
  float emission = 0;  // light leaves within this angle of a normal, radians
  float strength = 0;  // importance at unit distance, W / sr
  double power = 0;    // W; the light tree's build weighs by it
  std::uint32_t emitter = 0;
};

}  // namespace candela::scene
