// A decoded image: linear Rec.709 texels in square tiles, row by row of tiles, so that a lookup and its
// neighbors lie on one page. Every image is kept this way, in memory or in the scratch file.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "worker/core/vec.h"
#include "worker/scene/textures/scratch.h"

namespace candela::scene {

// Bytes are looked up in a table of linear values; rgb8 has a fourth byte unused, so that a tile is a page.
enum class TexelFormat : std::uint8_t { gray8, rgb8, gray32, rgb32 };

struct TexelImage {
  static constexpr std::uint32_t kTileShift = 5, kTile = 1u << kTileShift;

  std::string file;
  std::uint32_t width = 0, height = 0;
  TexelFormat format = TexelFormat::rgb32;
  Spectrum minimum, maximum;  // per channel, over all texels
  std::array<float, 256> table{};
  ScratchBlock texels;

  // The place of a texel is the sum of what its column and its row give.
  static std::size_t column(std::uint32_t x) {
    return (static_cast<std::size_t>(x >> kTileShift) << (2 * kTileShift)) + (x & (kTile - 1));
  }
  std::size_t row(std::uint32_t y) const {
    return ((static_cast<std::size_t>(y >> kTileShift) * tiles_across()) << (2 * kTileShift)) +
           ((y & (kTile - 1)) << kTileShift);
  }
  template <TexelFormat as>
  Spectrum texel_as(std::size_t place) const {
    const auto* const bytes = reinterpret_cast<const std::uint8_t*>(texels.data());
    const auto* const floats = reinterpret_cast<const float*>(texels.data());
    if constexpr (as == TexelFormat::rgb8) {
      const std::uint8_t* const p = bytes + 4 * place;
      return {table[p[0]], table[p[1]], table[p[2]]};
    } else if constexpr (as == TexelFormat::rgb32) {
      const float* const p = floats + 3 * place;
      return {p[0], p[1], p[2]};
    } else {
      return Spectrum(as == TexelFormat::gray8 ? table[bytes[place]] : floats[place]);
    }
  }
  Spectrum texel(std::size_t place) const {
    switch (format) {
      case TexelFormat::gray8:
        return texel_as<TexelFormat::gray8>(place);
      case TexelFormat::rgb8:
        return texel_as<TexelFormat::rgb8>(place);
      case TexelFormat::gray32:
        return texel_as<TexelFormat::gray32>(place);
      case TexelFormat::rgb32:
        break;
    }
    return texel_as<TexelFormat::rgb32>(place);
  }
  Spectrum at(std::uint32_t x, std::uint32_t y) const { return texel(column(x) + row(y)); }
  std::uint32_t tiles_across() const { return (width + kTile - 1) >> kTileShift; }
};

// Takes an image's rows from the top, in one of the four formats, and keeps one row of tiles at a time.
class TexelWriter {
 public:
  // `image` has its size and format. The Scratch must outlive the writer.
  static Result<TexelWriter> create(Scratch& scratch, const TexelImage& image);

  // Pixels of `channels` values (bytes or floats as the format says), of which pick[0 .. 2] are red, green
  // and blue (pick[0] alone for gray).
  template <class T>
  Result<void> add_row(const T* pixels, std::size_t channels, const int (&pick)[3]);
  // After the last row: gives the image its texels and their bounds (bytes by image.table).
  Result<void> finish(TexelImage& image);

 private:
  Result<void> flush();

  Scratch::Writer out_;
  std::vector<std::byte> tiles_;  // one row of tiles
  std::uint32_t width_ = 0, height_ = 0, y_ = 0;
  std::uint32_t parts_ = 1;   // values of a texel: 1 or 3
  std::uint32_t stride_ = 1;  // values between texels: 1, 3 or 4
  float low_[3], high_[3];    // of the values as stored
};

}  // namespace candela::scene
