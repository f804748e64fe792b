// Mitsuba 0.6's maxSmoothAngle: a mesh is smooth where its faces meet at less than an angle, and has creases
// elsewhere.
#pragma once

#include <vector>

#include "worker/loaders/mesh.h"
#include "worker/loaders/obj.h"
#include "worker/scene/transform.h"

namespace candela::scene {

// The mesh without its normals, its vertices split so that faces share one only if their normals in the world
// differ by at most the angle (degrees) from those of the first face around it. Vertices of equal position
// and texture coordinates are one before that, but for those of different parts.
loaders::Mesh split_at_creases(loaders::Mesh mesh, const Transform& to_world, double max_degrees,
                               const std::vector<loaders::MeshPart>& parts = {});

}  // namespace candela::scene
