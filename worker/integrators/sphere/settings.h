// Settings of the jobs of `candela inspect sphere`: those of the path tracer, and the place.
#pragma once

#include "worker/integrators/path/settings.h"

namespace candela::integrators {

struct SphereSettings {
  PathSettings path;
  // Center in the coordinates of the scene's file; normal: 0, or of length 1; error: see Probe.
  double x = 0, y = 0, z = 0, radius = 0, normal_x = 0, normal_y = 0, normal_z = 0, error = 0;

  template <class Visitor>
  void fields(Visitor& visit) {
    constexpr double most = 1e30;
    path.fields(visit);
    visit("x", x, {-most, most}, "center of the sphere");
    visit("y", y, {-most, most}, "center of the sphere");
    visit("z", z, {-most, most}, "center of the sphere");
    visit("radius", radius, {0, most}, "of the sphere, or of the disk");
    visit("normal_x", normal_x, {-1, 1}, "normal of a disk; 0, 0, 0: no disk");
    visit("normal_y", normal_y, {-1, 1}, "normal of a disk");
    visit("normal_z", normal_z, {-1, 1}, "normal of a disk");
    visit("error", error, {0, most}, "rays begin so far above the disk");
  }
};

}  // namespace candela::integrators
