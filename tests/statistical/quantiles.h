// Tail probabilities and their inverses (Boost.Math), with an answer where the textbook has none.
//
// tail(x): the probability of more than x. quantile(tail): the x that is exceeded so often.
// Zero degrees of freedom (one sample) mean that nothing is known: a tail of Student's t is 1/2, so that a
// two-sided p is 1, and one of F is 1; quantiles are infinite. Infinite degrees of freedom are those of known
// variances. Zero variance: t_statistic() and variance_ratio() say what 0 / 0 is. NaN in, NaN out.
#pragma once

namespace candela::statistical {

double normal_tail(double x);
double normal_quantile(double tail);

double student_tail(double t, double freedom);
double student_quantile(double tail, double freedom);
// The probability of |t| or more.
double student_two_sided(double t, double freedom);

// Of no freedom at all: always 0.
double chi_squared_tail(double x, double freedom);
double chi_squared_quantile(double tail, double freedom);

// Of a ratio of two variances, the upper one with freedom_a.
double fisher_tail(double f, double freedom_a, double freedom_b);
double fisher_quantile(double tail, double freedom_a, double freedom_b);
// The probability of a ratio as far from 1, in the direction it has, or farther; doubled.
double fisher_two_sided(double f, double freedom_a, double freedom_b);

// difference / error. No difference is none however exact the values are; any other of exact values is
// infinite.
double t_statistic(double difference, double error);
// a / b. Two values that do not vary vary alike: 1.
double variance_ratio(double a, double b);

// Degrees of freedom of a sum of variances that were estimated with these: Welch's and Satterthwaite's. Terms
// without variance do not matter; of nothing but those it is infinite. A term with variance and no freedom
// makes it 0.
struct EstimatedVariance {
  double variance = 0, freedom = 0;
};
EstimatedVariance operator+(const EstimatedVariance& a, const EstimatedVariance& b);

}  // namespace candela::statistical
