// Scenes far from the origin, such as cities in map coordinates. Vertices, rays and lights are floats, whose
// steps grow with the distance: before anything is rounded such a scene is moved to its own middle, in
// double.
#pragma once

#include <map>
#include <optional>

#include "common/description/object.h"
#include "worker/core/vec.h"
#include "worker/scene/bounds.h"

namespace candela::scene {

// The middles that the origins of the scene and of its shapegroups move to.
struct Placement {
  Vec3d middle;
  std::map<const description::Object*, Vec3d> groups;  // those that are moved
};

// The point to move to the origin. Nothing if the box lies near the origin, measured by its own size. Its
// coordinates are multiples of a power of two near the box's size, so that floats of a mesh stay exact.
std::optional<Vec3d> middle_if_far(const Bounds& bounds);

// Place of the scene's camera, if it is at one place.
std::optional<Vec3d> camera_place(const description::Object& sensor);

// A guess, for a scene whose shapes are too small to be read where they are: everything is near the camera.
Placement placement_at(const description::Object& scene, const Vec3d& camera);

// The same scene with its shapes, sensors, lights and volumes moved by -placement.middle, and the shapes of
// groups by the group's middle, which their instances undo. What is not moved is shared with `scene`. The
// shapes of mesh files have a property "origin" (point): what to subtract from their vertices before
// rounding.
description::ObjectPtr moved(const description::ObjectPtr& scene, const Placement& placement);

}  // namespace candela::scene
