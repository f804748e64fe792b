// The surface on which a distance field is zero, as a mesh: Mitsuba 3's sdfgrid.
#pragma once

#include <string>

#include "common/base/result.h"
#include "worker/loaders/mesh.h"
#include "worker/loaders/volume.h"

namespace candela::scene {

// The field is trilinear between its values, which are at the corners of the grid's cells in [0, 1]^3, and
// negative inside. Cells that the surface crosses are cut into smaller ones, and these into tetrahedra
// [Doi and Koide 1991]. Normals are the field's gradient, by differences over a cell.
Result<loaders::Mesh> level_set(const loaders::VolumeData& field, const std::string& name);

}  // namespace candela::scene
