// Image files as they lie there: what their heads say, and whether two hold the same bits.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace candela::image {

// The attributes that are text, without reading a pixel. Errors name the file.
Result<std::map<std::string, std::string>> read_texts(const std::filesystem::path& path);
// The same of an OpenEXR file in memory. Errors name no file.
Result<std::map<std::string, std::string>> texts_of(std::string_view exr);

struct BitComparison {
  std::vector<std::string> equal, differing;  // channels of both files
  std::vector<std::string> missing;           // channels of the first that the second lacks
  std::uint64_t pixels = 0, differing_pixels = 0;
};
// Channels of the same name in two files of images, which are read as 32-bit floats. Errors name the file:
// it cannot be read, or the sizes differ.
Result<BitComparison> compare_bits(const std::filesystem::path& a, const std::filesystem::path& b);

}  // namespace candela::image
