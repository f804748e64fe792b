// The first surface that a ray meets, for edits whose source is what lies there (`hit`, docs/edits.md).
#pragma once

#include "worker/core/vec.h"
#include "worker/scene/edits/direction_map.h"

namespace candela::scene {

class FirstSurface {
 public:
  virtual ~FirstSurface() = default;
  // The ray meets a surface, and the first one at a point of the region. offset: see SceneEdits.
  virtual bool lies_in(const Cone& region, const Ray& ray, Vec3d offset) const = 0;
};

}  // namespace candela::scene
