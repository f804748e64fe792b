// Finds the part of the difference of two images that is noise, if the variance of their values is known.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/stats/image_error.h"

namespace candela::stats {

// A figure's standard error, or NaN.
struct ComparisonNoise {
  double mean_a = 0, mean_b = 0, mean_ratio = 0, rmse = 0, relmse = 0;  // standard errors of compare()'s
  // relMSE to be expected of the noise alone: the figure's excess over it is a difference of the means.
  double expected_relmse = 0;
};

// A block of pixels whose means differ by more than noise.
struct BlockDifference {
  std::uint32_t x = 0, y = 0, width = 0, height = 0;
  std::array<double, 3> a{}, b{};  // means
  double p = 0;  // that any block of two equal images shows as much: of all blocks and channels together
};

struct ImageDifference {
  ComparisonNoise noise;
  std::uint32_t blocks = 0;                // compared
  std::vector<BlockDifference> differing;  // those with p below `p_limit`, the least p first
};

inline constexpr std::uint32_t kDifferenceBlock = 16;  // pixels a side
inline constexpr double kDifferenceP = 0.01;

// `variance_a` and `variance_b` are estimates of the variance of each value with one degree of freedom, as
// variance_map() gives them; an empty one is zero everywhere. Values of different pixels are taken as
// independent, those of one pixel as wholly correlated. A block's channel is tested by Student's t of its
// mean difference, with Satterthwaite's degrees of freedom; p is Bonferroni's. Preconditions: of compare(),
// and as many variances as values, or none.
ImageDifference difference(std::span<const float> a, std::span<const float> variance_a,
                           std::span<const float> b, std::span<const float> variance_b, std::uint32_t width,
                           std::uint32_t height, double p_limit = kDifferenceP);

}  // namespace candela::stats
