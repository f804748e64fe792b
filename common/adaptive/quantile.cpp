#include "common/adaptive/quantile.h"

#include <cmath>

namespace candela::adaptive {
namespace {

// exp(-x), x >= 0: the Taylor series of x / 2^k, squared k times.
double exp_minus(double x) {
  int squarings = 0;
  while (x > 0.125) {
    x *= 0.5;
    ++squarings;
  }
  double term = 1, sum = 1;
  for (int n = 1; n < 16; ++n) {
    term *= -x / n;
    sum += term;
  }
  for (; squarings > 0; --squarings) sum *= sum;
  return sum;
}

// x^a exp(-x) / Gamma(a) for a = degrees / 2. Factors alternate, so that none overflows alone.
double front(double x, int degrees) {
  constexpr double kRootOfPi = 1.7724538509055160;
  const bool odd = degrees % 2 != 0;
  double value = odd ? std::sqrt(x) / kRootOfPi : x;  // x^a / Gamma(a) for a = 1/2 or 1
  for (double a = odd ? 0.5 : 1; 2 * a < degrees; ++a) value *= x / a;
  return value * exp_minus(x);
}

}  // namespace

double chi_squared_tail(double x, int degrees) {
  if (!(x > 0)) return 1;
  const double a = degrees / 2.0;
  x /= 2;
  const double scale = front(x, degrees);
  if (x < a + 1) {  // series of the lower part
    double term = 1 / a, sum = term;
    for (int n = 1; n < 1000 && term > sum * 1e-17; ++n) {
      term *= x / (a + n);
      sum += term;
    }
    return 1 - scale * sum;
  }
  // Continued fraction of the upper part, from its end: 1/(x+1-a - 1(1-a)/(x+3-a - 2(2-a)/(x+5-a - ...))).
  double fraction = x + 401 - a;
  for (int n = 200; n >= 1; --n) fraction = x + 2 * n - 1 - a - n * (n - a) / fraction;
  return scale / fraction;
}

double chi_squared_quantile(double alpha, int degrees) {
  double low = 0, high = degrees;
  while (chi_squared_tail(high, degrees) > alpha) high *= 2;
  for (;;) {
    const double middle = low + (high - low) / 2;
    if (!(middle > low && middle < high)) return high;
    (chi_squared_tail(middle, degrees) > alpha ? low : high) = middle;
  }
}

}  // namespace candela::adaptive
