// Surfaces that rays met while a path was made, as the path's evaluation needs them. All of it follows from
// the point, so that nobody has to look here; it is there once already.
#pragma once

#include <vector>

#include "worker/scene/points/surface_points.h"
#include "worker/scene/scene.h"

namespace candela::transport::path {

struct FoundSurface {
  scene::CanonicalPoint point;
  scene::SurfaceHit hit;  // SurfacePoints::hit
  Vec3d place;            // SurfacePoints::at
};

class FoundSurfaces {
 public:
  void clear() { all_.clear(); }
  // The reference holds until the next add() or clear().
  const FoundSurface& add(const scene::Scene& scene, const scene::CanonicalPoint& point) {
    return all_.emplace_back(FoundSurface{point, scene.points().hit(point), scene.points().at(point).p});
  }
  // Null: it was not met.
  const FoundSurface* find(const scene::CanonicalPoint& point) const {
    for (const FoundSurface& one : all_)
      if (one.point == point) return &one;
    return nullptr;
  }

 private:
  std::vector<FoundSurface> all_;
};

}  // namespace candela::transport::path
