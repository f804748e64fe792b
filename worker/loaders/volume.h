// Values on a grid as a file holds them, checked: every number is finite, and negative ones
// have become 0 where they make no sense.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "worker/core/vec.h"

namespace candela::loaders {

struct VolumeData {
  std::array<std::uint32_t, 3> size{};  // cells along x, y, z
  std::uint32_t channels = 0;           // 1 or 3
  std::vector<float> values;            // [((z * size_y + y) * size_x + x) * channels + channel]
  std::uint64_t negative_count = 0;     // of values below 0 in the file
  Vec3 low, high;                       // the file's bounding box, as written there: perhaps senseless
};

// Mitsuba's .vol format, version 3, in the encodings of values: float32, float16 and uint8 (0 to 255 stands
// for 0 to 1). `name` goes into errors. Memory is bounded by four times the file, whatever its header claims.
// `keeps_negative`: else negative values become 0.
Result<VolumeData> load_volume(std::string_view bytes, const std::string& name, bool keeps_negative = false);

}  // namespace candela::loaders
