// JPEG files that tests make, by libjpeg.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

// clang-format off
#include <jpeglib.h>  // after <cstdio>, which it needs
// clang-format on

#include "common/rng/stream.h"

namespace candela::test {

struct JpegKind {
  int width = 0, height = 0, components = 3;
  bool progressive = false;
  int across = 1, down = 1;   // pixels that share one sample of chroma
  unsigned restart_rows = 0;  // between marks; 0: none
  std::string exif = {};      // from the order of bytes on
};

// A picture of slow changes and noise.
inline std::string jpeg_file(const JpegKind& kind, std::uint64_t seed) {
  jpeg_compress_struct call{};
  jpeg_error_mgr errors{};
  call.err = jpeg_std_error(&errors);
  jpeg_create_compress(&call);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&call, &bytes, &size);
  call.image_width = static_cast<JDIMENSION>(kind.width);
  call.image_height = static_cast<JDIMENSION>(kind.height);
  call.input_components = kind.components;
  call.in_color_space = kind.components == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&call);
  jpeg_set_quality(&call, 85, TRUE);
  if (kind.progressive) jpeg_simple_progression(&call);
  call.comp_info[0].h_samp_factor = kind.across;
  call.comp_info[0].v_samp_factor = kind.down;
  call.restart_in_rows = static_cast<int>(kind.restart_rows);
  jpeg_start_compress(&call, TRUE);
  if (!kind.exif.empty()) {
    const std::string marker = std::string("Exif\0\0", 6) + kind.exif;
    jpeg_write_marker(&call, JPEG_APP0 + 1, reinterpret_cast<const JOCTET*>(marker.data()),
                      static_cast<unsigned>(marker.size()));
  }
  rng::Stream stream(seed);
  std::vector<JSAMPLE> row(static_cast<std::size_t>(kind.width * kind.components));
  for (int y = 0; y < kind.height; ++y) {
    for (std::size_t i = 0; i < row.size(); ++i)
      row[i] = static_cast<JSAMPLE>((i * 7 + static_cast<std::size_t>(y) * 5) % 200 +
                                    static_cast<std::size_t>(stream.next_float() * 50));
    JSAMPROW at = row.data();
    jpeg_write_scanlines(&call, &at, 1);
  }
  jpeg_finish_compress(&call);
  std::string out(reinterpret_cast<const char*>(bytes), size);
  jpeg_destroy_compress(&call);
  std::free(bytes);  // NOLINT: libjpeg's
  return out;
}

}  // namespace candela::test
