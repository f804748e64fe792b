#include "tests/stress/verdict.h"

#include <algorithm>
#include <cmath>

#include "tests/statistical/moments.h"
#include "tests/statistical/quantiles.h"

namespace candela::stress {

std::string_view name(Verdict verdict) {
  switch (verdict) {
    case Verdict::within:
      return "within";
    case Verdict::undecided:
      return "undecided";
    case Verdict::broken:
      break;
  }
  return "broken";
}

Judgement judge(const std::vector<double>& deviations, double tolerance, double alpha) {
  Judgement result;
  for (const double d : deviations) {
    if (std::isfinite(d)) continue;
    result.verdict = Verdict::broken;
    result.mean = d;
    return result;
  }
  const auto moments = statistical::moments_of(deviations);
  result.mean = moments.mean();
  result.stderr_of_mean = moments.error();
  const double reach = statistical::student_quantile(alpha / 2, moments.freedom()) * result.stderr_of_mean;
  // Skewness of differences far below the tolerance decides nothing.
  const bool matters = std::fabs(result.mean) + 4 * reach > tolerance;
  result.skewness = moments.skewness();
  if (matters && std::fabs(result.skewness) > kLargestSkewness) return result;
  if (std::fabs(result.mean) + reach <= tolerance)
    result.verdict = Verdict::within;
  else if (std::fabs(result.mean) - reach > tolerance)
    result.verdict = Verdict::broken;
  return result;
}

}  // namespace candela::stress
