// A place on a surface, as textures see it.
#pragma once

#include <cstdint>

#include "worker/core/vec.h"

namespace candela::scene {

inline constexpr std::uint32_t kNone = 0xffffffffu;

struct SurfacePoint {
  Vec3 p;  // world
  Vec2 uv;
  Vec2 barycentric;                 // of the second and the third corner of a triangle
  std::uint32_t primitive = kNone;  // a triangle's index in Geometry
};

}  // namespace candela::scene
