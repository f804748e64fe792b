// The triangles of a Shape directive in a file of a pbrt scene.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/description/reading_budget.h"
#include "worker/loaders/mesh.h"

namespace candela::loaders {

// trianglemesh as it is; bilinearmesh as two triangles for each flat patch and a grid for each other;
// loopsubdiv after its levels of subdivision; sphere, disk and cylinder, or what their parameters leave of
// them, as a grid. `offset` is where the word Shape begins, in line `line`. `origin`: as mesh.h has it.
// Lists, subdivisions and patches count in the budget while the mesh is made.
Result<Mesh> load_pbrt_shape(std::string_view bytes, const std::string& name, std::int64_t offset, int line,
                             const Vec3d& origin = {},
                             description::ReadingBudget& budget = description::ReadingBudget::unlimited());

}  // namespace candela::loaders
