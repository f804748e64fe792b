// Equality of two estimators of one image, block by block, from the variance of their own independent
// batches.
//
// Values. An image is reduced to means over square blocks, and over the whole image, for each channel. A
// batch is one independent run of an estimator (its own seed, one or many iterations), so that what is
// correlated inside it, neighbouring pixels under one photon say, needs no model: only whole batches are
// compared.
//
// The test has two stages, so that no single tail probability is asked for that the t distribution gives only
// for normal batches. Stage one: Welch's t of every value, Bonferroni over all values to alpha_suspect.
// Values that fail are suspects. Stage two: fresh batches of confirm_effort times the size, Welch's t of the
// suspects alone, one-sided in the direction suspected, Bonferroni over them to alpha_confirm. A difference
// is reported only if a suspect fails again. The stages are independent, so where all values agree an alarm
// has at most the chance alpha_suspect * alpha_confirm (1e-5 by default).
//
// Power. `detectable` of a value is the difference that stage one suspects with probability 0.9; stage two,
// with more samples and a lower threshold, loses less than 0.1 % of those.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace candela::statistical {

// What an image is reduced to: [region * 3 + channel], blocks row by row, last the whole image.
class Regions {
 public:
  Regions(std::uint32_t width, std::uint32_t height, std::uint32_t block);
  std::size_t values() const { return (std::size_t{columns_} * rows_ + 1) * 3; }
  // `rgb` has width * height * 3 values.
  std::vector<double> means(std::span<const double> rgb) const;
  std::string name(std::size_t value) const;
  // True for values of the whole image.
  bool whole(std::size_t value) const { return value >= std::size_t{columns_} * rows_ * 3; }

 private:
  std::uint32_t width_, height_, block_, columns_, rows_;
};

using Rows = std::vector<std::vector<double>>;  // [batch][value]

// `rows(stage, effort)`: independent batches, each of `effort` times the usual number of iterations. Another
// stage is other seeds; the same arguments give the same rows.
struct Estimator {
  std::string name;
  std::function<Rows(std::uint64_t stage, double effort)> rows;
};
// Remembers what was asked for, for an estimator that many are compared with.
Estimator cached(Estimator estimator);

struct Welch {
  double mean_a = 0, mean_b = 0;
  double deviation = 0;   // standard error of mean_a - mean_b
  double freedom = 1;     // Welch and Satterthwaite's degrees of freedom
  double skewness_a = 0;  // of the batches
  double skewness_b = 0;
  double share_a = 0;  // of a's part in deviation^2
};
Welch welch(const Rows& a, const Rows& b, std::size_t value);

struct BlockTest {
  double alpha_suspect = 1e-2;
  double alpha_confirm = 1e-3;
  double confirm_effort = 4;
  double effort = 1;
  double effort_reference = 1;
  // A known bound of the relative difference: only what goes beyond it counts.
  double margin = 0;
  // A value is decided if a relative difference of this size is detectable (margin included).
  double decide = 0.05;
  // Of an estimator that has found little of its rare, bright samples so far, only what is too bright counts:
  // its mean is then most likely too small, and so is its variance.
  bool only_brighter = false;
  // Values whose batches are more skewed than this are not tested: the t distribution would not hold.
  double largest_skewness = 2;
};

struct Verdict {
  bool agree = true;
  std::size_t values = 0;    // that are not zero in both
  std::size_t tested = 0;    // of these, not too skewed
  std::size_t decided = 0;   // of the tested, a difference of `decide` is detectable
  double smallest_p = 1;     // of stage one, Bonferroni
  std::size_t suspects = 0;  // after stage one
  // Relative differences detectable with probability 0.9 over the tested values, margin included.
  double detectable_median = 0, detectable_largest = 0, detectable_whole = 0;
  double ratio = 0, ratio_error = 0;  // of the whole image, summed over channels, and its standard error
  std::string report;                 // one line for the log; more where they disagree
};
Verdict compare(const Estimator& tested, const Estimator& reference, const Regions& regions,
                const BlockTest& test);

// The relative difference of a value that stage one suspects with probability 0.9 among `values` tests.
double detectable(const Welch& result, std::size_t values, const BlockTest& test);

// How many times more effort than in `rows` brings the detectable difference of the noisiest value down to
// `target`, with `batches` of them, if the squared standard error of this estimator is to be `share` of the
// difference's; and a quarter more, since the noise of `rows` is itself an estimate. At least 1.
double effort_for(const Rows& rows, const Regions& regions, double target, std::size_t batches, double share,
                  const BlockTest& test);

}  // namespace candela::statistical
