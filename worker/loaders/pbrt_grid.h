// The densities of a MakeNamedMedium directive in a file of a pbrt scene.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "worker/loaders/volume.h"

namespace candela::loaders {

// One channel. `offset` is where the word MakeNamedMedium begins, in line `line`. Errors: the directive has
// no densities, not as many as its grid has cells, or a negative one.
Result<VolumeData> load_pbrt_grid(std::string_view bytes, const std::string& name, std::int64_t offset,
                                  int line);

}  // namespace candela::loaders
