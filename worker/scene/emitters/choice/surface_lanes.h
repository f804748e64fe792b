// The importance of many emitting surfaces at one reference, eight at a time. A lane computes what
// AreaLight::importance does, operation by operation, so both have the same bits; a lane that does not matter
// is computed and left out.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "worker/core/vec.h"
#include "worker/scene/emitters/surface_extent.h"

namespace candela::scene {

// One surface, as AreaLight describes it.
struct SurfaceLane {
  SurfaceExtent extent;
  float strength = 0;
  bool cone = false;  // read the cone of normals
  // The reference must be in front of a flat surface: dot(reference - corner, normal) > 0. A normal of zero:
  // no such test.
  Vec3 corner, normal;
  bool ask = false;  // the emitter itself is to be asked whether it reaches the reference
};

class SurfaceLanes {
 public:
  static constexpr std::size_t kWidth = 8;

  void add(std::uint32_t emitter, const SurfaceLane& lane);
  bool empty() const { return blocks_.empty(); }
  // Writes the importance of each surface to of_emitters[emitter]. `front` as Scene::sample_direct wants it.
  void importances(Vec3 p, Vec3 front, float* of_emitters) const;
  // Emitters whose importance counts only if they reach the reference.
  const std::vector<std::uint32_t>& to_ask() const { return to_ask_; }

 private:
  using Lane = std::array<float, kWidth>;
  struct alignas(32) Block {  // each array begins where a vector of eight may be loaded
    Lane center_x{}, center_y{}, center_z{}, radius{}, axis_x{}, axis_y{}, axis_z{}, cos_spread{},
        sin_spread{}, cone{}, strength{}, corner_x{}, corner_y{}, corner_z{}, normal_x{}, normal_y{},
        normal_z{}, flat{};
    std::array<std::uint32_t, kWidth> emitter{};
    std::uint32_t used = 0;
  };

  std::vector<Block> blocks_;
  std::vector<std::uint32_t> to_ask_;
};

}  // namespace candela::scene
