// Surfaces of all kinds of primitives in double, as functions of their parameters.
#pragma once

#include "worker/scene/points/canonical_point.h"
#include "worker/scene/shapes/geometry.h"

namespace candela::scene {

// The surface at a point of `geometry`. Maps are not looked at.
SurfaceGeometry surface_geometry(const Geometry& geometry, const CanonicalPoint& point);

// Its place and outer normal alone, in the coordinates of the point's group: no instance is looked at.
struct LocalSpot {
  Vec3d p, ng;
};
LocalSpot local_spot(const Geometry& geometry, const CanonicalPoint& point);

// Sets u and v to the place nearest to p, a point about on the primitive (in the world).
void set_place(const Geometry& geometry, Vec3d p, CanonicalPoint& point);

// Sets u and v to where the line meets the primitive that `point` names: of several meetings the one that is
// nearest to `near`; `near` itself, put onto the primitive, if rounding has the line miss it.
void set_meeting(const Geometry& geometry, Vec3d origin, Vec3d direction, Vec3d near, CanonicalPoint& point);
// The same of a triangle that the line meets. False: it is none, or the line misses it.
bool set_meeting_on_triangle(const Geometry& geometry, Vec3d origin, Vec3d direction, CanonicalPoint& point);

// True if the geometry has the primitive, and u and v are those of a point on it.
bool exists(const Geometry& geometry, const CanonicalPoint& point);

// The index of its shape.
std::uint32_t shape_of(const Geometry& geometry, const CanonicalPoint& point);

}  // namespace candela::scene
