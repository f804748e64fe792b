// JPEG files, by libjpeg-turbo.
#pragma once

#include <memory>
#include <string>

#include "common/image/byte_source.h"
#include "common/image/codec.h"

namespace candela::image {

// Gray or RGB, of 8 bits. Null with `error` if the file is damaged, or holds inks (CMYK).
std::unique_ptr<ImageReader> open_jpeg(std::unique_ptr<ByteSource> source, std::string& error);

std::string jpeg_library();

}  // namespace candela::image
