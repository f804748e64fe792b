// Images that are stored in another order than rows from the top, each from the left.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "worker/scene/textures/texel_image.h"

namespace candela::scene {

// Orientation of a stored image, as TIFF and Exif count: where its first row and its first column are when it
// is seen upright. 1: top, left; 2: top, right; 3: bottom, right; 4: bottom, left; 5: left, top; 6: right,
// top; 7: right, bottom; 8: left, bottom.
struct Orientation {
  int code = 1;

  bool keeps_rows() const { return code <= 1 || code > 8; }
  bool swaps_axes() const { return code >= 5 && code <= 8; }
  bool from_right() const { return code == 2 || code == 3 || code == 6 || code == 7; }
  bool from_bottom() const { return code == 3 || code == 4 || code == 7 || code == 8; }
};

// Takes rows as they are stored and gives them to a writer upright. Unless the rows are kept, all are held in
// memory.
template <class T>
class UprightRows {
 public:
  // width, height: as stored; of `channels` values a pixel, pick[0 .. 2] are red, green and blue.
  UprightRows(TexelWriter& out, Orientation orientation, std::uint32_t width, std::uint32_t height,
              std::size_t channels, const int (&pick)[3])
      : out_(out),
        orientation_(orientation),
        width_(width),
        height_(height),
        channels_(channels),
        pick_(pick) {
    if (!orientation_.keeps_rows()) stored_.reserve(std::size_t{width_} * height_ * channels_);
  }

  Result<void> add(const T* row) {
    if (orientation_.keeps_rows()) return out_.add_row(row, channels_, pick_);
    stored_.insert(stored_.end(), row, row + width_ * channels_);
    return {};
  }

  // After the last row.
  Result<void> finish() {
    if (orientation_.keeps_rows()) return {};
    const bool swaps = orientation_.swaps_axes();
    const std::uint32_t across = swaps ? height_ : width_, down = swaps ? width_ : height_;
    std::vector<T> row(across * channels_);
    for (std::uint32_t y = 0; y < down; ++y) {
      const std::uint32_t from_top = orientation_.from_bottom() ? down - 1 - y : y;
      for (std::uint32_t x = 0; x < across; ++x) {
        const std::uint32_t from_left = orientation_.from_right() ? across - 1 - x : x;
        const std::uint32_t column = swaps ? from_top : from_left, line = swaps ? from_left : from_top;
        const T* const pixel = stored_.data() + (std::size_t{line} * width_ + column) * channels_;
        for (std::size_t c = 0; c < channels_; ++c) row[x * channels_ + c] = pixel[c];
      }
      CANDELA_TRY(out_.add_row(row.data(), channels_, pick_));
    }
    return {};
  }

 private:
  TexelWriter& out_;
  const Orientation orientation_;
  const std::uint32_t width_, height_;
  const std::size_t channels_;
  const int (&pick_)[3];
  std::vector<T> stored_;
};

}  // namespace candela::scene
