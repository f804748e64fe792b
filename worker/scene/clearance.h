// Lower bounds of the distance from a point to the nearest surface.
#pragma once

#include <embree3/rtcore.h>

#include <array>

#include "worker/core/vec.h"
#include "worker/scene/shapes/geometry.h"

namespace candela::scene {

// The distance to a triangle; exact but for rounding in double.
double distance_to_triangle(const std::array<Vec3d, 3>& corners, const Vec3d& p);

// The smaller of `limit` and a bound for all that a tree holds: geometries of Accel by kind, and instances as
// boxes. Wrong by a few roundings of coordinates in float.
float tree_clearance(RTCScene tree, const Geometry& geometry, Vec3 p, float limit);

}  // namespace candela::scene
