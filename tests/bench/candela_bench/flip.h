// FLIP, the perceived difference of two images when they are flipped back and forth: LDR-FLIP [Andersson
// 2020] of every exposure in a range that the reference decides, and the largest value over these, per pixel:
// HDR-FLIP [Andersson 2021]. Observer: 67 pixels a degree (a 3840 pixels wide screen of 0.7 m seen from 0.7
// m); tone mapper: ACES.
//
// One deviation: where the median luminance of the reference is below 2^-16 of its largest, the longest
// exposure is chosen as if it were that. (The paper's is infinite for an image that is half black.)
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace candela::bench {

// A plane of floats, row by row.
struct Plane {
  std::uint32_t width = 0, height = 0;
  std::vector<float> values;
};

// Parts of one image that LDR-FLIP needs at one exposure.
struct FlipView {
  Plane lightness, a, b;  // Hunt-adjusted CIELAB after the contrast sensitivity filters
  Plane edges, points;    // magnitudes of the features
};

class Flip {
 public:
  // `reference` has width * height * 3 values, linear Rec.709.
  Flip(std::span<const float> reference, std::uint32_t width, std::uint32_t height);

  // Per pixel, in [0, 1].
  std::vector<float> map(std::span<const float> image) const;
  // The mean of map().
  double mean(std::span<const float> image) const;

  const std::vector<double>& exposures() const { return exposures_; }  // stops

 private:
  std::uint32_t width_, height_;
  std::vector<double> exposures_;
  std::vector<FlipView> reference_;  // one an exposure
};

// LDR-FLIP of two images with values in [0, 1], linear Rec.709: per pixel.
std::vector<float> ldr_flip(std::span<const float> reference, std::span<const float> image,
                            std::uint32_t width, std::uint32_t height);

}  // namespace candela::bench
