// Names of a film's layers beyond the image.
#pragma once

#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/film/layout.h"

namespace candela::film {

// The longest layer name, in bytes. With ".R" it is well within what an EXR channel may be called.
inline constexpr std::size_t kMaxLayerNameBytes = 64;

// The name of the layer that carries the error estimate of an image on request; no integrator may use it.
inline constexpr std::string_view kErrorLayer = "error";

// Fails (usage) unless there are at most kMaxLayers - 1 names, all different, each 1 to kMaxLayerNameBytes of
// letters, digits, '_', '-' and '.', with no empty part between dots (dots make groups in an EXR:
// "weighted.s2.t3"), and none of them `error`.
Result<void> validate_layer_names(const std::vector<std::string>& names);

// The film of a job: the image and these layers. Fails (usage) where the names do, or where such a film is
// larger than films may be.
Result<Layout> make_layout(std::uint32_t width, std::uint32_t height, const std::vector<std::string>& names);

}  // namespace candela::film
