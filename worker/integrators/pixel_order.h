// An order of a film's pixels for eye samples that come a few at a time. Sample j belongs to pixel
// (offset + j * stride) mod pixels, round j / pixels. The stride is coprime to the number of pixels, so that
// each round has each pixel once, and near the golden section of it, so that any part of a round is spread
// evenly.
#pragma once

#include <cstdint>
#include <numeric>

namespace candela::integrators {

class PixelOrder {
 public:
  PixelOrder(std::uint64_t pixels, std::uint64_t offset) : pixels_(pixels), offset_(offset % pixels) {
    stride_ = static_cast<std::uint64_t>(0.6180339887498949 * static_cast<double>(pixels_)) | 1;
    while (std::gcd(stride_, pixels_) != 1) ++stride_;
  }
  // The pixel of sample j.
  std::uint64_t place(std::uint64_t j) const { return (offset_ + j % pixels_ * stride_) % pixels_; }
  // The pixel of the sample after that at this pixel.
  std::uint64_t next(std::uint64_t pixel) const {
    pixel += stride_;
    return pixel >= pixels_ ? pixel - pixels_ : pixel;
  }
  std::uint64_t round(std::uint64_t j) const { return j / pixels_; }
  std::uint64_t pixels() const { return pixels_; }

 private:
  std::uint64_t pixels_, offset_, stride_ = 1;
};

}  // namespace candela::integrators
