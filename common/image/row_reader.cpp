#include "common/image/row_reader.h"

#include <cstddef>
#include <cstdint>
#include <limits>

namespace candela::image {
namespace {

// Channels [first, last) of `width` pixels, interleaved.
template <class T>
void give(const T* row, std::size_t channels, std::size_t width, std::size_t first, std::size_t last,
          SampleType type, void* out) {
  constexpr float kScale = 1.0F / static_cast<float>(std::numeric_limits<T>::max());
  for (std::size_t x = 0; x < width; ++x) {
    for (std::size_t c = first; c < last; ++c) {
      const T value = row[x * channels + c];
      const std::size_t at = x * (last - first) + (c - first);
      if (type == SampleType::float32)
        static_cast<float*>(out)[at] = static_cast<float>(value) * kScale;
      else
        static_cast<T*>(out)[at] = value;
    }
  }
}

}  // namespace

bool RowReader::read_rows(int begin, int end, int first, int last, SampleType type, void* out) {
  const SampleType own = spec_.is_uint8 ? SampleType::uint8 : SampleType::uint16;
  if (type != own && type != SampleType::float32)
    return fail("the image is read as what it holds, or as floats");
  if (begin < 0 || begin >= end || end > spec_.height || first < 0 || first >= last ||
      last > static_cast<int>(spec_.channels.size()))
    return fail("there are no such rows and channels");
  const auto width = static_cast<std::size_t>(spec_.width);
  const std::size_t channels = spec_.channels.size();
  const auto from = static_cast<std::size_t>(first), to = static_cast<std::size_t>(last);
  const std::size_t bytes = type == SampleType::float32 ? sizeof(float) : spec_.sample_bytes;
  auto* at = static_cast<unsigned char*>(out);
  for (int y = begin; y < end; ++y, at += width * (to - from) * bytes) {
    const void* const row = row_at(y);
    if (row == nullptr) return false;
    if (spec_.is_uint8)
      give(static_cast<const std::uint8_t*>(row), channels, width, from, to, type, at);
    else
      give(static_cast<const std::uint16_t*>(row), channels, width, from, to, type, at);
  }
  return true;
}

}  // namespace candela::image
