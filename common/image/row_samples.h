// Samples of a row of integers in the type and the channels that a reader is asked for.
#pragma once

#include <cstddef>
#include <limits>

#include "common/image/codec.h"

namespace candela::image {

// Channels [first, last) of `width` pixels, interleaved, as they are or as floats of [0, 1].
template <class T>
void give_samples(const T* row, std::size_t channels, std::size_t width, std::size_t first, std::size_t last,
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

// True if an image of this head has such rows and channels.
inline bool has_rows(const ImageSpec& spec, int begin, int end, int first, int last) {
  return begin >= 0 && begin < end && end <= spec.height && first >= 0 && first < last &&
         last <= static_cast<int>(spec.channels.size());
}

}  // namespace candela::image
