// The halves of an image as arrays, which an experiment keeps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/stats/halves.h"

namespace candela::stats {

// `scaled` is empty where the factor has no variance.
struct HalfImages {
  std::uint32_t width = 0, height = 0;
  double n0 = 0, n1 = 0;
  bool chains = false;
  double factor_variance = 0;
  std::vector<float> a, b, scaled;
};

inline HalfImages images_of(const Halves& halves) {
  HalfImages images{
      halves.width, halves.height, halves.n0, halves.n1, halves.chains, halves.factor_variance, {}, {}, {}};
  const std::size_t row_values = std::size_t{halves.width} * film::kChannels;
  std::vector<double> a(row_values), b(row_values), scaled(row_values);
  for (std::uint32_t y = 0; y < halves.height; ++y) {
    halves.row(y, a, b, scaled);
    for (std::size_t i = 0; i < row_values; ++i) {
      images.a.push_back(static_cast<float>(a[i]));
      images.b.push_back(static_cast<float>(b[i]));
      if (halves.factor_variance > 0) images.scaled.push_back(static_cast<float>(scaled[i]));
    }
  }
  return images;
}

// `images` must outlive it.
inline Halves halves_of(const HalfImages& images) {
  Halves halves{images.width, images.height, images.n0, images.n1, images.chains, images.factor_variance, {}};
  halves.row = [&images](std::uint32_t y, std::span<double> a, std::span<double> b,
                         std::span<double> scaled) {
    const std::size_t first = y * a.size();
    for (std::size_t i = 0; i < a.size(); ++i) {
      a[i] = images.a[first + i];
      b[i] = images.b[first + i];
      if (!images.scaled.empty()) scaled[i] = images.scaled[first + i];
    }
  };
  return halves;
}

}  // namespace candela::stats
