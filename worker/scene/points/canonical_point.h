// The name of a point on a surface, from which all that is there follows to the last bit, however the point
// was found [half-vector note, section 16].
#pragma once

#include <cstdint>

#include "worker/scene/surface_point.h"

namespace candela::scene {

struct CanonicalPoint {
  std::uint32_t instance = kNone;  // kNone: none, a shape of the scene itself
  std::uint32_t primitive = 0;     // in Geometry's array of its kind
  std::uint8_t kind = 0;           // PrimitiveKind
  // Triangle: barycentric coordinates of the second and the third corner. Disk: along its axes, over the
  // radius. Cylinder: the tangent of half the angle, the height over the length. Sphere: the stereographic
  // projection from its third axis. These need no function of the library of C, and lose no digits anywhere.
  double u = 0, v = 0;

  friend bool operator==(const CanonicalPoint&, const CanonicalPoint&) = default;
};

// A surface at a point of it, in double: the place, its normals, and their derivatives by u and v.
struct SurfaceGeometry {
  Vec3d p, dp_du, dp_dv;
  Vec3d ng, dng_du, dng_dv;  // unit, towards the outside of the shape
  Vec3d n, dn_du, dn_dv;     // the shading normal, unit, on the side of ng
  // False: a bump or normal map turns the shading normal, and nobody knows its derivatives.
  bool has_shading_derivatives = true;
};

}  // namespace candela::scene
