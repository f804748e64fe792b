// Bsdfs of the materials that OBJ files name.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/description/resolve.h"
#include "common/description/scene_files.h"

namespace candela::description {

// Looks at the shapes `obj`. In a file before version 2, and where `collapse` is false, each part of a mesh
// has the bsdf that the scene gives under the name of its material, or else that of the material library:
// bsdfs become links under the names of materials, of which the last that fits counts. Elsewhere materials
// are passed over, with a note if the picture would differ.
Result<void> add_obj_materials(std::vector<Draft>& drafts,
                               const std::map<std::string, std::size_t, std::less<>>& ids, SceneFiles& files,
                               std::vector<Note>& notes);

}  // namespace candela::description
