// Names of a film's layers beyond the image.
#pragma once

#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/film/layout.h"
#include "common/job/layer_name.h"

namespace candela::film {

// Fails (usage) unless there are at most kMaxLayers - 1 names, all different, each one that a layer may have
// (common/job/layer_name.h).
Result<void> validate_layer_names(const std::vector<std::string>& names);

// The film of a job: the image and these layers. Fails (usage) where the names do, or where such a film is
// larger than films may be.
Result<Layout> make_layout(std::uint32_t width, std::uint32_t height, const std::vector<std::string>& names);

}  // namespace candela::film
