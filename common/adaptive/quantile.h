// The chi-squared distribution, with + - * / and sqrt alone: the same bits on every machine.
#pragma once

namespace candela::adaptive {

// The probability of more than x. Preconditions: x >= 0, degrees >= 1. Relative error below 1e-11.
double chi_squared_tail(double x, int degrees);

// The value that is exceeded with probability alpha. Preconditions: 0 < alpha < 1, degrees >= 1.
double chi_squared_quantile(double alpha, int degrees);

}  // namespace candela::adaptive
