// OpenEXR files, by the OpenEXR library. Its types stay inside exr_reader.cpp and exr_writer.cpp.
#pragma once

#include <memory>
#include <string>

#include "common/image/byte_source.h"
#include "common/image/codec.h"

namespace candela::image {

// Pixels are read as floats alone: half and float as they are, 32-bit integers as parts of 2^32. Throws
// std::exception on some damaged files; null with `error` on others.
std::unique_ptr<ImageReader> open_exr(std::unique_ptr<ByteSource> source, const std::string& name,
                                      std::string& error);

// Checks that the file has the bytes that its header names: attributes, and the tables of chunks. OpenEXR
// makes room for both before it looks. Empty, or why not.
std::string exr_header_error(ByteSource& source);

// The number of threads of OpenEXR that serve an image of so many bytes. The first large image starts them.
int exr_threads(std::uint64_t bytes);

std::string exr_library();

}  // namespace candela::image
