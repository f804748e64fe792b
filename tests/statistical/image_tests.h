// An image of independent batches against a reference, block by block.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace candela::statistical {

// Block by block and channel by channel: the mean over batches against a reference with known standard errors
// of its pixels (empty: exact). Welch's t test on block means with the batches' own variance; a block's value
// is skipped if its relative standard error exceeds max_relative_error or its batches are so skewed that the
// normal limit is not reached (one batch holds more than four fifths of the sum of squares about the mean).
struct BlockTestResult {
  std::size_t tested = 0, skipped = 0;
  double smallest_p = 1;     // over all tested values
  double adjusted_p = 1;     // Bonferroni: min(1, smallest_p * tested): at most this chance of a false alarm
  double chi_squared_p = 1;  // of the sum of squared normal scores of all tested values, one-sided
  double median_relative_standard_error = 0;
  double ratio = 0;  // mean over reference, weighted by what is known of each value
  // Its standard error: from the spread over batches, whose blocks may share what they like, and of the
  // reference, whose blocks are independent, the three channels of one taken as one.
  double ratio_stderr = 0;
  std::string worst;  // where, for the failure message
};
struct BlockTestOptions {
  std::uint32_t block = 16;
  double max_relative_error = 0.02;
  // A known systematic difference of the reference, relative: only what goes beyond it counts.
  double allowed_bias = 0;
  // Blocks whose corner is listed are left out: known faults of the reference.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> excluded;
  // Blocks where the batches find light too rarely for their spread to say how much they miss: only what is
  // too bright counts, and the ratio leaves them out.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> only_brighter = {};
};
BlockTestResult block_test(const std::vector<std::vector<float>>& batches,
                           const std::vector<float>& reference, const std::vector<float>& reference_stderr,
                           std::uint32_t width, std::uint32_t height, const BlockTestOptions& options);

}  // namespace candela::statistical
