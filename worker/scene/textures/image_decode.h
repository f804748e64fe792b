// Image files to linear texels.
#pragma once

#include <compare>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "worker/scene/textures/scratch.h"
#include "worker/scene/textures/texel_image.h"

namespace candela::scene {

// Interpretation of a file's numbers.
struct ImageReading {
  // value: as its file means it (integers are sRGB, OpenEXR, PFM, HDR and other floats are linear).
  enum class Encoding { file, linear, srgb, power };
  Encoding encoding = Encoding::file;
  double gamma = 1;     // of power: value^gamma
  std::string channel;  // "r", "g", "b" or "a" alone, as gray; "number": alpha or color; empty: the color
  auto operator<=>(const ImageReading&) const = default;
};

// Decodes OpenEXR, PNG, JPEG, Radiance HDR, TIFF, BMP, TGA, PNM and PFM, told by content, a few rows at a
// time. One channel fills three; alpha is left out. Errors name `file`: not decodable, of a size beyond the
// limits (131072 a side; 2^34 pixels in all, 2^28 where the decoder holds the whole image: JPEG, BMP, TGA,
// interlaced PNG), not finite or negative values, channels that are no color, no room. "number": see .cpp.
Result<TexelImage> decode_image(std::string_view encoded, const std::string& file,
                                const ImageReading& reading, Scratch& scratch);

}  // namespace candela::scene
