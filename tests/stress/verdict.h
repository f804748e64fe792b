// Whether a deviation is within its tolerance, from independent batches.
#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

namespace candela::stress {

enum class Verdict { within, undecided, broken };
std::string_view name(Verdict verdict);

// Chance that a value within tolerance is called broken, or one beyond it within, where batches are normal:
// for a whole point, all its quantities and stages together. (Bonferroni.)
inline constexpr double kFalseAlarm = 1e-3;
// Batches more skewed than this say nothing: their mean and their variance may both lack what is rare.
inline constexpr double kLargestSkewness = 2;

struct Judgement {
  Verdict verdict = Verdict::undecided;
  double mean = 0, stderr_of_mean = 0;  // of the deviations
  double skewness = 0;
};
// `deviations`: one a batch, of a value from what it should be. The interval of confidence 1 - alpha (two
// sided) lies inside [-tolerance, tolerance]: within; outside: broken; else undecided. Batches without any
// variance are taken as exact.
Judgement judge(const std::vector<double>& deviations, double tolerance, double alpha);

}  // namespace candela::stress
