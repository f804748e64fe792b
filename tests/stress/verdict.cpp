#include "tests/stress/verdict.h"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>

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
  const auto n = static_cast<double>(deviations.size());
  for (const double d : deviations) {
    if (!std::isfinite(d)) {
      result.verdict = Verdict::broken;
      result.mean = d;
      return result;
    }
    result.mean += d / n;
  }
  double squares = 0, cubes = 0;
  for (const double d : deviations) {
    squares += (d - result.mean) * (d - result.mean) / n;
    cubes += std::pow(d - result.mean, 3) / n;
  }
  result.stderr_of_mean = std::sqrt(squares / (n - 1));
  const boost::math::students_t distribution(n - 1);
  const double reach =
      boost::math::quantile(boost::math::complement(distribution, alpha / 2)) * result.stderr_of_mean;
  // Skewness of differences far below the tolerance decides nothing.
  const bool matters = std::fabs(result.mean) + 4 * reach > tolerance;
  if (squares > 0) result.skewness = cubes / std::pow(squares, 1.5);
  if (squares > 0 && matters && std::fabs(result.skewness) > kLargestSkewness) return result;
  if (std::fabs(result.mean) + reach <= tolerance)
    result.verdict = Verdict::within;
  else if (std::fabs(result.mean) - reach > tolerance)
    result.verdict = Verdict::broken;
  return result;
}

}  // namespace candela::stress
