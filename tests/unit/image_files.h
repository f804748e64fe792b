// Image files of every kind that OpenEXR and PNG know, for tests of readers.
#pragma once

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfTiledOutputFile.h>
#include <half.h>
#include <zlib.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "common/rng/stream.h"

namespace candela::test {

// Values for every channel of a header, over a window.
class ExrPixels {
 public:
  ExrPixels(const Imf::Header& header, const Imath::Box2i& window, int seed) {
    const int width = window.max.x - window.min.x + 1, height = window.max.y - window.min.y + 1;
    for (auto c = header.channels().begin(); c != header.channels().end(); ++c, ++seed) {
      const std::size_t size = c.channel().type == Imf::HALF ? 2 : 4;
      std::vector<char>& plane =
          planes_.emplace_back(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * size);
      for (std::size_t i = 0; i < plane.size() / size; ++i) {
        const auto at = static_cast<float>(i);
        const float value =
            std::sin(at * 0.37F + static_cast<float>(seed)) * std::exp(std::fmod(at, 300.F) / 100);
        const auto whole = static_cast<std::uint32_t>(2654435761U * (i + static_cast<std::size_t>(seed)));
        const half small(value);
        const void* from = c.channel().type == Imf::HALF   ? static_cast<const void*>(&small)
                           : c.channel().type == Imf::UINT ? static_cast<const void*>(&whole)
                                                           : static_cast<const void*>(&value);
        std::memcpy(plane.data() + i * size, from, size);
      }
      buffer_.insert(c.name(), Imf::Slice::Make(c.channel().type, plane.data(), window.min, width, height,
                                                size, size * static_cast<std::size_t>(width)));
    }
  }
  const Imf::FrameBuffer& buffer() const { return buffer_; }

 private:
  std::vector<std::vector<char>> planes_;
  Imf::FrameBuffer buffer_;
};

// By scanlines, or in tiles where the header has them, with all levels.
inline void write_exr_file(const std::string& path, const Imf::Header& header) {
  const Imath::Box2i& window = header.dataWindow();
  if (!header.hasTileDescription()) {
    Imf::OutputFile file(path.c_str(), header);
    const ExrPixels pixels(header, window, 1);
    file.setFrameBuffer(pixels.buffer());
    file.writePixels(window.max.y - window.min.y + 1);
    return;
  }
  Imf::TiledOutputFile file(path.c_str(), header);
  for (int ly = 0; ly < file.numYLevels(); ++ly) {
    for (int lx = 0; lx < file.numXLevels(); ++lx) {
      if (!file.isValidLevel(lx, ly)) continue;
      const ExrPixels pixels(header, file.dataWindowForLevel(lx, ly), 1 + lx);
      file.setFrameBuffer(pixels.buffer());
      file.writeTiles(0, file.numXTiles(lx) - 1, 0, file.numYTiles(ly) - 1, lx, ly);
    }
  }
}

inline std::string big_endian(std::uint32_t value) {
  return {static_cast<char>(value >> 24), static_cast<char>(value >> 16), static_cast<char>(value >> 8),
          static_cast<char>(value)};
}

inline std::string png_chunk(const std::string& type, const std::string& data) {
  const std::string body = type + data;
  const auto crc = crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()));
  return big_endian(static_cast<std::uint32_t>(data.size())) + body +
         big_endian(static_cast<std::uint32_t>(crc));
}

// A PNG of random values. `kind`: PNG's color type; `chunks` go before the pixels.
inline std::string png_file(int width, int height, int bits, int kind, bool interlaced,
                            const std::string& chunks, std::uint64_t seed) {
  constexpr int channels_of[] = {1, 0, 3, 1, 2, 0, 4};
  // First column, first row, and steps of Adam7's passes.
  constexpr int passes[7][4] = {{0, 0, 8, 8}, {4, 0, 8, 8}, {0, 4, 4, 8}, {2, 0, 4, 4},
                                {0, 2, 2, 4}, {1, 0, 2, 2}, {0, 1, 1, 2}};
  rng::Stream stream(seed);
  std::string raw;
  for (int pass = 0; pass < (interlaced ? 7 : 1); ++pass) {
    const int* const p = passes[pass];
    const int columns = interlaced ? (width - p[0] + p[2] - 1) / p[2] : width;
    const int rows = interlaced ? (height - p[1] + p[3] - 1) / p[3] : height;
    if (columns <= 0) continue;
    for (int y = 0; y < rows; ++y) {
      raw += '\0';  // no filter
      for (int i = 0; i < (columns * channels_of[kind] * bits + 7) / 8; ++i)
        raw += static_cast<char>(stream.next_u32() & 0xff);
    }
  }
  std::string packed(compressBound(static_cast<uLong>(raw.size())), '\0');
  uLongf size = static_cast<uLongf>(packed.size());
  compress(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(raw.data()),
           static_cast<uLong>(raw.size()));
  packed.resize(size);
  const std::string head = big_endian(static_cast<std::uint32_t>(width)) +
                           big_endian(static_cast<std::uint32_t>(height)) + static_cast<char>(bits) +
                           static_cast<char>(kind) + std::string(2, '\0') +
                           static_cast<char>(interlaced ? 1 : 0);
  return "\x89PNG\r\n\x1a\n" + png_chunk("IHDR", head) + chunks + png_chunk("IDAT", packed) +
         png_chunk("IEND", "");
}

}  // namespace candela::test
