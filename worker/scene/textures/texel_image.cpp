#include "worker/scene/textures/texel_image.h"

#include <algorithm>
#include <limits>

namespace candela::scene {

Result<TexelWriter> TexelWriter::create(Scratch& scratch, const TexelImage& image) {
  constexpr std::uint64_t kTile = TexelImage::kTile;
  TexelWriter writer;
  writer.width_ = image.width;
  writer.height_ = image.height;
  const bool rgb = image.format == TexelFormat::rgb8 || image.format == TexelFormat::rgb32;
  const bool bytes = image.format == TexelFormat::gray8 || image.format == TexelFormat::rgb8;
  writer.parts_ = rgb ? 3 : 1;
  writer.stride_ = image.format == TexelFormat::rgb8 ? 4 : writer.parts_;
  const std::uint64_t row_of_tiles =
      image.tiles_across() * kTile * kTile * writer.stride_ * (bytes ? sizeof(std::uint8_t) : sizeof(float));
  const std::uint64_t tiles_down = (image.height + kTile - 1) / kTile;
  writer.tiles_.resize(row_of_tiles);
  for (int c = 0; c < 3; ++c) {
    writer.low_[c] = std::numeric_limits<float>::max();
    writer.high_[c] = 0;
  }
  CANDELA_ASSIGN(writer.out_, scratch.begin(row_of_tiles * tiles_down));
  return writer;
}

template <class T>
Result<void> TexelWriter::add_row(const T* pixels, std::size_t channels, const int (&pick)[3]) {
  T low[3] = {std::numeric_limits<T>::max(), std::numeric_limits<T>::max(), std::numeric_limits<T>::max()};
  T high[3] = {0, 0, 0};
  constexpr std::uint32_t kTile = TexelImage::kTile;
  T* const row = reinterpret_cast<T*>(tiles_.data()) + static_cast<std::size_t>(y_ % kTile) * kTile * stride_;
  for (std::uint32_t x = 0; x < width_; ++x, pixels += channels) {
    T* const to = row + TexelImage::column(x) * stride_;
    for (std::uint32_t part = 0; part < parts_; ++part) {
      const T v = pixels[pick[part]];
      to[part] = v;
      low[part] = std::min(low[part], v);
      high[part] = std::max(high[part], v);
    }
  }
  for (std::uint32_t part = 0; part < parts_; ++part) {
    low_[part] = std::min(low_[part], static_cast<float>(low[part]));
    high_[part] = std::max(high_[part], static_cast<float>(high[part]));
  }
  ++y_;
  return y_ % kTile == 0 || y_ == height_ ? flush() : Result<void>();
}
template Result<void> TexelWriter::add_row<std::uint8_t>(const std::uint8_t*, std::size_t, const int (&)[3]);
template Result<void> TexelWriter::add_row<float>(const float*, std::size_t, const int (&)[3]);

Result<void> TexelWriter::flush() {
  return out_.append(tiles_);
}

Result<void> TexelWriter::finish(TexelImage& image) {
  CANDELA_ASSIGN(image.texels, out_.finish());
  const bool bytes = image.format == TexelFormat::gray8 || image.format == TexelFormat::rgb8;
  const auto bound = [&](const float(&values)[3], std::uint32_t c) {
    const float v = values[parts_ == 3 ? c : 0];
    return bytes ? image.table[static_cast<std::size_t>(v)] : v;
  };
  image.minimum = {bound(low_, 0), bound(low_, 1), bound(low_, 2)};
  image.maximum = {bound(high_, 0), bound(high_, 1), bound(high_, 2)};
  return {};
}

}  // namespace candela::scene
