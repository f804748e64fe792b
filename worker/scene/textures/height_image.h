// Images whose values are heights.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "worker/scene/textures/scratch.h"
#include "worker/scene/textures/texel_image.h"

namespace candela::scene {

// As decode_image (image_decode.h) with the file's own encoding, but negative values are kept; the image's
// bounds mean nothing then. An image of fewer than 2 x 2 or more than `most_pixels` pixels is refused before
// its pixels are read.
Result<TexelImage> decode_heights(std::string_view encoded, const std::string& file,
                                  std::uint64_t most_pixels, Scratch& scratch);

}  // namespace candela::scene
