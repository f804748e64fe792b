// Binary Netpbm images (P5, P6) and float maps (Pf, PF), row by row from the file's bytes. (The image library
// copies such files whole, and loses the last bit of 16-bit ones.)
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace candela::scene {

struct PnmFile {
  int width = 0, height = 0;
  int channels = 1;         // 1 or 3
  std::uint32_t most = 0;   // the value of white; 0: floats
  float scale = 1;          // of floats: values are multiplied by it
  bool big_endian = false;  // floats; integers always are
  std::string_view pixels;  // rows from the top; of float maps from the bottom

  // Nothing where the header is none of these kinds (ASCII ones are for others) or the bytes are too few for
  // it.
  static std::optional<PnmFile> parse(std::string_view bytes);

  // Row y from the top. False where a value is above `most`. Words: scaled to 65535, rounded.
  bool row(int y, std::uint8_t* out) const;  // if most is 255
  bool row(int y, std::uint16_t* out) const;
  bool row(int y, float* out) const;
};

}  // namespace candela::scene
