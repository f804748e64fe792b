#include "tests/statistical/quantiles.h"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>

namespace candela::statistical {
namespace {

namespace bm = boost::math;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
// Student's t of so many degrees of freedom is normal, and F's denominator known, to all digits.
constexpr double kMany = 1e15;

}  // namespace

double normal_tail(double x) {
  return std::erfc(x / std::sqrt(2.0)) / 2;
}

double normal_quantile(double tail) {
  if (std::isnan(tail)) return tail;
  if (tail <= 0) return kInfinity;
  if (tail >= 1) return -kInfinity;
  return bm::quantile(bm::complement(bm::normal(), tail));
}

double student_tail(double t, double freedom) {
  if (std::isnan(t) || std::isnan(freedom)) return kUnknown;
  if (!(freedom > 0)) return 0.5;
  if (std::isinf(t)) return t > 0 ? 0 : 1;
  if (freedom > kMany) return normal_tail(t);
  return bm::cdf(bm::complement(bm::students_t(freedom), t));
}

double student_quantile(double tail, double freedom) {
  if (std::isnan(tail) || std::isnan(freedom)) return kUnknown;
  if (tail == 0.5) return 0;
  if (!(freedom > 0) || tail <= 0 || tail >= 1) return tail < 0.5 ? kInfinity : -kInfinity;
  if (freedom > kMany) return normal_quantile(tail);
  return bm::quantile(bm::complement(bm::students_t(freedom), tail));
}

double student_two_sided(double t, double freedom) {
  return std::min(1.0, 2 * student_tail(std::fabs(t), freedom));
}

double chi_squared_tail(double x, double freedom) {
  if (std::isnan(x) || std::isnan(freedom)) return kUnknown;
  if (x <= 0) return 1;
  if (!(freedom > 0) || std::isinf(x)) return 0;
  return bm::cdf(bm::complement(bm::chi_squared(freedom), x));
}

double chi_squared_quantile(double tail, double freedom) {
  if (std::isnan(tail) || std::isnan(freedom)) return kUnknown;
  if (!(freedom > 0) || tail >= 1) return 0;
  if (tail <= 0) return kInfinity;
  return bm::quantile(bm::complement(bm::chi_squared(freedom), tail));
}

double fisher_tail(double f, double freedom_a, double freedom_b) {
  if (std::isnan(f) || std::isnan(freedom_a) || std::isnan(freedom_b)) return kUnknown;
  if (!(freedom_a > 0) || !(freedom_b > 0) || f <= 0) return 1;
  if (std::isinf(f)) return 0;
  // A variance that is known.
  if (freedom_a > kMany && freedom_b > kMany) return f > 1 ? 0 : 1;
  if (freedom_b > kMany) return chi_squared_tail(f * freedom_a, freedom_a);
  if (freedom_a > kMany) return bm::cdf(bm::chi_squared(freedom_b), freedom_b / f);
  return bm::cdf(bm::complement(bm::fisher_f(freedom_a, freedom_b), f));
}

double fisher_quantile(double tail, double freedom_a, double freedom_b) {
  if (std::isnan(tail) || std::isnan(freedom_a) || std::isnan(freedom_b)) return kUnknown;
  if (tail >= 1) return 0;
  if (!(freedom_a > 0) || !(freedom_b > 0) || tail <= 0) return kInfinity;
  if (freedom_a > kMany && freedom_b > kMany) return 1;
  if (freedom_b > kMany) return chi_squared_quantile(tail, freedom_a) / freedom_a;
  if (freedom_a > kMany) return freedom_b / bm::quantile(bm::chi_squared(freedom_b), tail);
  return bm::quantile(bm::complement(bm::fisher_f(freedom_a, freedom_b), tail));
}

double fisher_two_sided(double f, double freedom_a, double freedom_b) {
  // 1 / F is F with the freedoms exchanged.
  const double above = fisher_tail(f, freedom_a, freedom_b);
  const double below =
      f > 0 ? fisher_tail(1 / f, freedom_b, freedom_a) : fisher_tail(kInfinity, freedom_b, freedom_a);
  return std::isnan(above) ? above : std::min(1.0, 2 * std::min(above, below));
}

double t_statistic(double difference, double error) {
  if (difference == 0) return 0;
  return error > 0 || std::isnan(error) ? difference / error : std::copysign(kInfinity, difference);
}

double variance_ratio(double a, double b) {
  if (a == 0 && b == 0) return 1;
  return b == 0 && !std::isnan(a) ? kInfinity : a / b;
}

EstimatedVariance operator+(const EstimatedVariance& a, const EstimatedVariance& b) {
  const double sum = a.variance + b.variance;
  // In shares of the sum: squares of variances underflow.
  const auto part = [&](const EstimatedVariance& one) {
    if (one.variance == 0) return 0.0;
    const double share = one.variance / sum;
    return one.freedom > 0 ? share * share / one.freedom : kInfinity;
  };
  return {sum, 1 / (part(a) + part(b))};
}

}  // namespace candela::statistical
