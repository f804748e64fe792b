// The parts of the study vcmplus-table: its scenes, and errors and times of one method on one of them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "tests/bench/candela_study/image_errors.h"
#include "tests/bench/candela_study/renders.h"
#include "tests/bench/candela_study/study.h"

namespace candela::study {

struct TableScene {
  std::string name;
  std::string file;                   // relative to the sources
  std::string reference;              // integrator: unbiased, with a noise that is small here
  std::uint64_t reference_count = 0;  // samples a pixel of each of the two references
  bool in_short_form = false;
  bool parameters = false;  // tables of k, alpha_f and first radii too
  // In the first disc, in the median. Ten are as many as in pictures of a million pixels. Lamps in housings
  // get one: discs of ten would be as large as the lamp, and leak its light.
  int photons = 10;
};
std::span<const TableScene> table_scenes();

// Two independent references of a scene, and errors against them.
class TableTruth {
 public:
  // folder: where references are kept; empty: nowhere.
  static Result<TableTruth> render(const TableScene& scene, std::uint32_t side, std::uint64_t count,
                                   unsigned threads, const std::filesystem::path& folder);

  // Mean over pixels and channels of (I - R1)(I - R2), whose expectation has no noise of the references, over
  // the squared mean.
  double squared_error(const Image& image) const;
  // The same, each pixel over its own squared luminance plus 1 % of the squared mean luminance: dark parts
  // count.
  double relative_error(const Image& image) const;
  // The same without the hundredth of the pixels in which it is largest.
  double trimmed_error(const Image& image) const;
  // The part of relative_error() that images of different seeds have in common: mean over all pairs.
  double relative_bias(const std::vector<Image>& images) const;
  // The variance of one reference, in the measures of squared_error() and relative_error().
  double variance() const;
  double relative_variance() const;

 private:
  TableTruth(Image one, Image other);
  std::vector<double> relative_errors(const Image& image) const;  // of pixels

  Image first_, second_;
  double per_square_ = 0;
  std::vector<double> weights_;  // of pixels
};

// One method on one scene: [count][seed].
struct TableCurve {
  std::string name;  // of the method
  std::vector<double> counts;
  std::vector<std::vector<double>> squared, relative, trimmed, seconds;
  std::vector<double> bias;  // squared, of all seeds together: [count]; empty with one seed
  StateReport report;        // of the first seed
  Image image, merged;       // of the first seed after all iterations; merged: what merging brings to it
};

double median(std::vector<double> values);
// Without this share of the values, the largest. Precondition: 0 <= share < 1.
double trimmed_mean(std::vector<double> values, double share);
// The place at which the curve of falling errors first reaches `target`, by lines in log-log; NaN if the
// curve does not reach it, or not above 0.
double reached(const std::vector<double>& places, const std::vector<double>& errors, double target);

}  // namespace candela::study
