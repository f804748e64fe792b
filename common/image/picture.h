// Pictures for people: three channels of 8 bits (PNG, JPEG) or 16 (TIFF) of an image or a layer.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/image/image.h"

namespace candela::image {

enum class PictureFormat : std::uint8_t { png, jpeg, tiff };

// By the ending of the name, .png, .jpg, .jpeg, .tif or .tiff, in small or capital letters.
std::optional<PictureFormat> picture_format_of(const std::filesystem::path& file);

struct ValueRange {
  double low = 0, high = 1;  // low < high
};

struct Tone {
  double exposure_stops = 0;             // colors are multiplied by 2 to this power, without `range`
  std::optional<ValueRange> range = {};  // values in it become black to white, linearly, without sRGB's curve
  int jpeg_quality = 95;                 // 1 to 100
};

// The range that shows all values of a layer: -1 to 1 if it has vectors (X, Y, Z) within that, such as
// normals; else from the smallest to the largest finite value. An error if no value is finite.
Result<ValueRange> whole_range(const Image& image);

// The file's bytes. Values are clipped to [0, 1] or to the range; a pixel with NaN is magenta. JPEG and TIFF
// need the module of images (codec.h).
Result<std::string> encode_picture(const Image& image, PictureFormat format, const Tone& tone);

}  // namespace candela::image
