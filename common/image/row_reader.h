// Readers of formats of one part, without tiles, that give integers row by row.
#pragma once

#include <string>
#include <utility>

#include "common/image/codec.h"

namespace candela::image {

class RowReader : public ImageReader {
 public:
  const ImageSpec& spec() const final { return spec_; }
  bool seek_part(int part) final { return part == 0; }
  bool read_part(int part, int first, int last, SampleType type, void* out) final {
    return part == 0 && read_rows(0, spec_.height, first, last, type, out);
  }
  // Gives samples as they are, or as floats of [0, 1].
  bool read_rows(int begin, int end, int first, int last, SampleType type, void* out) final;
  bool read_tiles(int, int, int, int, SampleType, void*) final { return fail("the format has no tiles"); }
  std::string error() final { return std::exchange(error_, {}); }

 protected:
  // All channels of row y, bytes or 16-bit words as spec_ says; null after fail(). The next call ends it.
  virtual const void* row_at(int y) = 0;
  bool fail(const char* why) {
    error_ = why;
    return false;
  }

  ImageSpec spec_;

 private:
  std::string error_;
};

}  // namespace candela::image
