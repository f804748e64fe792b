// The weights of trained light selection (common/stages/light_visibility.h) for a unit: the state of its
// epoch on a grid over the scene.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "common/stages/light_visibility.h"
#include "worker/scene/emitters/scene_extent.h"

namespace candela::estimators {

class LightWeights {
 public:
  // Precondition: weights has as many bytes as the layout entries.
  LightWeights(const scene::SceneExtent& extent, const light_visibility::Layout& layout,
               std::span<const std::uint8_t> weights)
      : low_(extent.center - Vec3d{extent.radius, extent.radius, extent.radius}),
        cells_per_length_(layout.side / (2 * extent.radius)),
        layout_(layout),
        weights_(weights) {}

  std::uint32_t cell(Vec3 p) const {
    const Vec3d at = (Vec3d(p) - low_) * cells_per_length_;
    return (along(at.z) * layout_.side + along(at.y)) * layout_.side + along(at.x);
  }
  // By group of emitters (scene::Lights).
  std::span<const std::uint8_t> of_cell(std::uint32_t cell) const {
    return weights_.subspan(std::size_t{cell} * layout_.lights, layout_.lights);
  }
  std::uint32_t entry(std::uint32_t cell, std::uint32_t group) const { return cell * layout_.lights + group; }

 private:
  // Points in media may lie outside.
  std::uint32_t along(double x) const {
    return static_cast<std::uint32_t>(std::clamp(x, 0.0, static_cast<double>(layout_.side - 1)));
  }

  Vec3d low_;
  double cells_per_length_;
  light_visibility::Layout layout_;
  std::span<const std::uint8_t> weights_;
};

}  // namespace candela::estimators
