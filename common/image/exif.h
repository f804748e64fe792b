// The part of Exif that turns a picture: PNG and JPEG carry it alike.
#pragma once

#include <cstddef>

namespace candela::image {

// The orientation in the first directory of Exif data, which begin with the order of bytes, as TIFF counts; 1
// if there is none.
int exif_orientation(const unsigned char* bytes, std::size_t size);

}  // namespace candela::image
