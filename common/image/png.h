// PNG files, by libpng.
#pragma once

#include <memory>
#include <string>

#include "common/image/byte_source.h"
#include "common/image/codec.h"

namespace candela::image {

// Gray, gray with alpha, RGB or RGBA, of 8 or 16 bits: fewer bits, palettes and transparent colors become
// these. straight_colors: not multiplied by alpha. Null with `error` where the file is damaged.
std::unique_ptr<ImageReader> open_png(std::unique_ptr<ByteSource> source, bool straight_colors,
                                      std::string& error);

std::string png_library();

}  // namespace candela::image
