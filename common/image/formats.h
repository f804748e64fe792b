// The formats of image files: OpenEXR and PNG by their own libraries, and so is JPEG read; others by the
// module (codec.h).
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/image/codec.h"

namespace candela::image {

// The format's name in OpenImageIO ("openexr", "png", "jpeg", "hdr", "tiff", "bmp", "pnm"), by the bytes that
// the file begins with, for names lie; "targa", which has no such bytes, by the name `file`. Null: none of
// these.
const char* format_of(std::string_view bytes, std::string_view file);

// Fails if the file is an image that only the module's readers know, and the module is not there. Any other
// file is fine, and so is none.
Result<void> check_readable(const std::filesystem::path& path);

// The reader for a file of any format that OpenImageIO knows. Errors name the file.
Result<std::unique_ptr<ImageReader>> open_file(const std::filesystem::path& path);

// The reader for an encoded image in memory. `bytes` must outlive the reader. `name` is the file's, for
// messages. straight_colors: colors come as stored, where the format says that they are not multiplied by
// alpha. Errors name no file.
Result<std::unique_ptr<ImageReader>> open_bytes(std::string_view bytes, const char* format,
                                                const std::string& name, bool straight_colors);

// Channels of 32-bit floats, which `rows` gives, compressed by zip; width, height, channels and texts of
// `spec` count. May throw std::exception.
std::string write_exr(const ImageSpec& spec, const RowSource& rows);

// Three channels of 8-bit sRGB, which `rows` gives. Throws std::exception.
std::string write_png(const ImageSpec& spec, const RowSource& rows);

// An error if an image may not have so many pixels.
Result<void> check_extent(std::uint64_t width, std::uint64_t height);

// True: the attribute is one of EXR's own, or a date, and write_exr() does not take it.
bool is_reserved_attribute(const std::string& key);

// A text of a file or a library without control characters: errors are one line.
std::string one_line(std::string text);

// Names and versions of the libraries of OpenEXR, PNG and JPEG, for people.
std::string image_libraries();

}  // namespace candela::image
