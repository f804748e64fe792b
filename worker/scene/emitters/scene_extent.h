// A sphere that holds the scene, for light from outside: it starts on the disk of that radius across its
// direction [Veach 1997, Sec. 8.3].
#pragma once

#include "worker/core/math.h"
#include "worker/core/vec.h"
#include "worker/core/warp.h"
#include "worker/scene/emitters/emitter.h"

namespace candela::scene {

struct SceneExtent {
  Vec3d center;
  double radius = 0;

  double disk_area() const { return static_cast<double>(math::kPi) * radius * radius; }
  float pdf_disk_area() const { return static_cast<float>(1 / disk_area()); }

  // Fills vertex and ray of light that comes from outside along d (unit), with u on the disk.
  void start_outside(Vec3 d, Vec2 u, EmissionSample& out) const {
    const Frame frame = make_frame(d);
    const Vec2 disk = warp::concentric_disk(u);
    const Vec3d across =
        Vec3d(frame.s) * static_cast<double>(disk.x) + Vec3d(frame.t) * static_cast<double>(disk.y);
    out.vertex.p = Vec3(center + (across - Vec3d(d)) * radius);
    out.vertex.ng = d;
    out.vertex.shading = frame;
    out.ray = {out.vertex.p, d};
  }
};

}  // namespace candela::scene
