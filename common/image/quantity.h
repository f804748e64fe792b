// One number a pixel of an EXR file: a channel, or what several channels make together.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace candela::image {

struct Quantity {
  std::uint32_t width = 0, height = 0;
  std::vector<float> values;  // width * height, row by row from the top
  std::string name;           // "luminance", "albedo, luminance", "depth", "normal, X"
};

// `layer`: empty for the image itself. `channel`: a letter of the layer's channels; "luminance" of R, G and
// B; "length" of X, Y and Z, or of U and V; empty: the only channel, else luminance, else length. The layer
// 'error' is made of 'variance' if the file has only that, and the other way round; their luminance takes the
// errors of the three channels as wholly correlated. The layer 'irradiance' is pi times the image over the
// layer 'albedo' if the file has only that: the irradiance of matt surfaces that emit no light. Errors name
// the file: it is no EXR, has no such layer or channel (with the nearest layers), or is damaged.
Result<Quantity> read_quantity(const std::filesystem::path& path, const std::string& layer,
                               const std::string& channel);

}  // namespace candela::image
