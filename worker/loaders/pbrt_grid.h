// The values of a MakeNamedMedium directive in a file of a pbrt scene, on a grid.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/description/reading_budget.h"
#include "worker/loaders/volume.h"

namespace candela::loaders {

// `offset` is where the word MakeNamedMedium begins, in line `line`. `quantity`: empty for the densities of
// 'uniformgrid' and 'cloud' (one channel), "sigma_t" or "albedo" of 'rgbgrid' (three). Errors: the directive
// has no values, not as many as its grid has cells, a negative one, or more than the budget has room for.
Result<VolumeData> load_pbrt_grid(
    std::string_view bytes, const std::string& name, std::int64_t offset, int line,
    std::string_view quantity = {},
    description::ReadingBudget& budget = description::ReadingBudget::unlimited());

}  // namespace candela::loaders
