// Multiple importance sampling of two techniques of which the second is biased, on integrands that are
// constant in cells, so that errors are finite sums and exact [Hachisuka 2012, supplement, Eq. 30 to 47].
//
//   technique 1  samples f with density p1, without bias
//   technique 2  samples f + b with density p2
//
// A weighting is the weight w of technique 2 in each cell; technique 1 has 1 - w. In cells where p1 is 0,
// w is 1: only technique 2 finds them.
#pragma once

#include <string>
#include <vector>

namespace candela::study {

struct MisProblem {
  std::string name;
  std::vector<double> measure;  // of each cell
  std::vector<double> f, b, p1, p2;
  std::size_t cells() const { return f.size(); }
  double area() const;      // A of Eq. 35
  double integral() const;  // of f: mu
};

using Weights = std::vector<double>;

// Counts of samples of one estimate. If the hits of technique 2 are Poisson, as those of a merge are, n2 is
// their intensity, and the term mu_2^2 / n2 is absent from the variance.
struct Counts {
  double n1, n2;
  bool poisson = false;
};

struct MisError {
  double variance = 0, bias = 0;
  double squared() const { return variance + bias * bias; }
};
// Eq. 34.
MisError error_of(const MisProblem& problem, const Counts& counts, const Weights& weights);

// The balance heuristic.
Weights balance(const MisProblem& problem, const Counts& counts);
// Eq. 40 and 41, with r = b / f in each cell. `penalty_count` is the n_n before A r^2: that of the whole job.
Weights bias_aware(const MisProblem& problem, const Counts& counts, double penalty_count);
// The same with one b for all cells, as the derivation assumes.
Weights bias_aware_constant(const MisProblem& problem, const Counts& counts, double penalty_count, double b);

// The weights in [0, 1] of least squared error. The squared error is convex in the weights; its rank-one
// terms become linear in them with one scalar each, and bisection finds the scalars.
Weights best_weights(const MisProblem& problem, const Counts& counts);

// A job of progressive iterations with one sample of technique 1 each. The radius is constant in steps of
// iterations; technique 2 has the intensity n2 and the bias b in proportion to the squared radius.
struct Step {
  double iterations;
  double squared_radius;  // as a factor of the first one
};
std::vector<Step> progressive_steps(double alpha, double iterations);

enum class Weighting { balance, bias_aware, best };
// Error of the mean of all iterations.
MisError progressive_error(const MisProblem& problem, double n2, const std::vector<Step>& steps,
                           Weighting weighting);

// Eq. 42, and a form that holds for any weights [0, 1] in place of `other`; `aware` are those of
// bias_aware(). Eq. 42 leaves out the bias of the means and what the Cauchy-Schwarz inequality of Eq. 36
// gives away.
double bound_of_the_paper(const MisProblem& problem, const Counts& counts);
double bound_that_holds(const MisProblem& problem, const Counts& counts, const Weights& aware,
                        const Weights& other);

}  // namespace candela::study
