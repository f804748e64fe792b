// Images in and out. Linear Rec.709, row by row from the top, interleaved.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace candela::image {

struct Image {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<float> rgb;                       // width * height * 3
  std::map<std::string, std::string> metadata;  // "candela:*" attributes and what else is text
  std::string_view letters = "RGB";  // of the channels that `rgb` was made of: RGB, XYZ, UV, Z, Y or I
};

// An extra named layer in an EXR: channels NAME.R, NAME.G, NAME.B, or one for each of other letters. Its
// pixels are `rgb`, or what `row` gives: all channels of row y, interleaved. (A film of many layers need not
// be developed all at once.)
struct Layer {
  std::string name;
  std::span<const float> rgb = {};
  std::function<void(std::uint32_t y, std::span<float> out)> row = {};
  std::string_view letters = "RGB";
};

// The R, G, B channels of an EXR (or any format OpenImageIO reads; non-float ones are taken as sRGB and
// linearised). A luminance-only file fills all three. Errors name the file.
Result<Image> read_image(const std::filesystem::path& path);

// The image of an EXR file in memory.
Result<Image> decode_exr(std::string_view bytes);

// The same of one named layer of an EXR: channels NAME.R, NAME.G, NAME.B, or NAME.X, NAME.Y, NAME.Z; NAME.U
// and NAME.V, with zeros for the third; or one of NAME.Z, NAME.Y and NAME.I, for all three. Where there is
// none of that name the error lists those there are.
Result<Image> read_layer(const std::filesystem::path& path, const std::string& layer);

// Reads the head of an image file, without its pixels. Errors name the file.
struct ImageSize {
  std::uint32_t width = 0, height = 0, channels = 0;
  std::uint32_t bits = 0;  // of a channel
};
Result<ImageSize> read_image_size(const std::filesystem::path& path);

// A 32-bit float EXR (zip), as bytes. Metadata keys become string attributes; names of EXR's own attributes
// ("compression", "openexr:...") are refused (input). Deterministic: no dates.
Result<std::string> encode_exr(std::uint32_t width, std::uint32_t height, std::span<const float> rgb,
                               const std::map<std::string, std::string>& metadata,
                               std::span<const Layer> layers = {});

// 8-bit sRGB PNG (picture.h) of the image times 2^exposure, clipped to [0, 1]; NaN shows as magenta. As
// bytes.
Result<std::string> encode_png(const Image& image, double exposure_stops = 0);

// The curves of IEC 61966-2-1, from basic operations alone: the same bits on every machine. Negative values
// follow the linear piece, values above 1 the power; NaN and infinity stay.
float srgb_to_linear(float value);
float linear_to_srgb(float value);

}  // namespace candela::image
