#include "tests/bench/candela_study/mis_problem.h"

#include <algorithm>
#include <cmath>

#include "tests/bench/candela_study/toy.h"

namespace candela::study {
namespace {

// Sums over cells that errors are made of.
struct Sums {
  double second1 = 0, second2 = 0;  // second moments, not yet divided by counts
  double mean1 = 0, mean2 = 0, bias = 0;
};

Sums sums_of(const MisProblem& problem, const Weights& weights, double bias_scale = 1) {
  Sums sums;
  for (std::size_t k = 0; k < problem.cells(); ++k) {
    const double w = weights[k], b = problem.b[k] * bias_scale, a = problem.measure[k];
    const double one = (1 - w) * problem.f[k], two = w * (problem.f[k] + b);
    if (one != 0) sums.second1 += a * one * one / problem.p1[k];
    if (two != 0) sums.second2 += a * two * two / problem.p2[k];
    sums.mean1 += a * one;
    sums.mean2 += a * two;
    sums.bias += a * w * b;
  }
  return sums;
}

MisError error_from(const Sums& sums, const Counts& counts) {
  const double two = sums.second2 - (counts.poisson ? 0 : sums.mean2 * sums.mean2);
  return {(sums.second1 - sums.mean1 * sums.mean1) / counts.n1 + two / counts.n2, sums.bias};
}

// Place where `excess` turns from negative to positive; it grows.
template <class Excess>
double root(double low, double high, const Excess& excess) {
  for (int i = 0; i < 44; ++i) {
    const double middle = 0.5 * (low + high);
    (excess(middle) > 0 ? high : low) = middle;
  }
  return 0.5 * (low + high);
}

// Weights that minimize, cell by cell, second moments + linear terms: the first technique's mean with -2
// mean1 / n1, the second's with -2 mean2 / n2, the bias with 2 lambda.
class LinearWeights {
 public:
  LinearWeights(const MisProblem& problem, const Counts& counts, double bias_scale)
      : problem_(problem), counts_(counts), scale_(bias_scale), weights_(problem.cells()) {}

  const Weights& at(double mean1, double mean2, double lambda) {
    for (std::size_t k = 0; k < problem_.cells(); ++k) {
      const double f = problem_.f[k], b = problem_.b[k] * scale_, p1 = problem_.p1[k], p2 = problem_.p2[k];
      if (p1 == 0 || p2 == 0) {
        weights_[k] = p1 == 0 ? 1 : 0;
        continue;
      }
      const double one = f * f / (counts_.n1 * p1), two = (f + b) * (f + b) / (counts_.n2 * p2);
      const double linear = -mean1 * f / counts_.n1 + mean2 * (f + b) / counts_.n2 - lambda * b;
      weights_[k] = one + two > 0 ? std::clamp((one + linear) / (one + two), 0.0, 1.0) : 0.0;
    }
    return weights_;
  }
  // With the means that belong to the weights themselves, for a given lambda.
  const Weights& consistent(double lambda) {
    const double most = sums_of(problem_, Weights(problem_.cells(), 1.0), scale_).mean2;
    const auto second = [&](double mean1) {
      if (counts_.poisson) return 0.0;
      return root(0, most, [&](double mean2) {
        return mean2 - sums_of(problem_, at(mean1, mean2, lambda), scale_).mean2;
      });
    };
    const double mean1 = root(0, problem_.integral(), [&](double mean1_guess) {
      return mean1_guess - sums_of(problem_, at(mean1_guess, second(mean1_guess), lambda), scale_).mean1;
    });
    return at(mean1, second(mean1), lambda);
  }

 private:
  const MisProblem& problem_;
  Counts counts_;
  double scale_;
  Weights weights_;
};

// Bounds of the bias that any weights in [0, 1] have.
std::pair<double, double> bias_range(const MisProblem& problem) {
  double low = 0, high = 0;
  for (std::size_t k = 0; k < problem.cells(); ++k)
    (problem.b[k] < 0 ? low : high) += problem.measure[k] * problem.b[k];
  return {low, high};
}

Weights bias_aware_scaled(const MisProblem& problem, const Counts& counts, double penalty_count,
                          double scale) {
  Weights weights;
  const double area = problem.area();
  for (std::size_t k = 0; k < problem.cells(); ++k) {
    if (problem.p1[k] == 0 || problem.p2[k] == 0) {
      weights.push_back(problem.p1[k] == 0 ? 1 : 0);
      continue;
    }
    const double r = scale * problem.b[k] / problem.f[k];
    const double p2 = problem.p2[k] / ((1 + r) * (1 + r) + penalty_count * problem.p2[k] * area * r * r);
    weights.push_back(counts.n2 * p2 / (counts.n1 * problem.p1[k] + counts.n2 * p2));
  }
  return weights;
}

}  // namespace

double MisProblem::area() const {
  double sum = 0;
  for (const double a : measure) sum += a;
  return sum;
}

double MisProblem::integral() const {
  double sum = 0;
  for (std::size_t k = 0; k < cells(); ++k) sum += measure[k] * f[k];
  return sum;
}

MisError error_of(const MisProblem& problem, const Counts& counts, const Weights& weights) {
  return error_from(sums_of(problem, weights), counts);
}

Weights balance(const MisProblem& problem, const Counts& counts) {
  Weights weights;
  for (std::size_t k = 0; k < problem.cells(); ++k)
    weights.push_back(counts.n2 * problem.p2[k] / (counts.n1 * problem.p1[k] + counts.n2 * problem.p2[k]));
  return weights;
}

Weights bias_aware(const MisProblem& problem, const Counts& counts, double penalty_count) {
  return bias_aware_scaled(problem, counts, penalty_count, 1);
}

Weights bias_aware_constant(const MisProblem& problem, const Counts& counts, double penalty_count, double b) {
  MisProblem assumed = problem;
  std::fill(assumed.b.begin(), assumed.b.end(), b);
  return bias_aware_scaled(assumed, counts, penalty_count, 1);
}

Weights best_weights(const MisProblem& problem, const Counts& counts) {
  LinearWeights linear(problem, counts, 1);
  const auto [low, high] = bias_range(problem);
  const double lambda =
      root(low, high, [&](double guess) { return guess - sums_of(problem, linear.consistent(guess)).bias; });
  return linear.consistent(lambda);
}

std::vector<Step> progressive_steps(double alpha, double iterations) {
  std::vector<Step> steps;
  const double limit = 1 / std::tgamma(1 + alpha);
  SquaredRadii radii(alpha);
  for (double begin = 1; begin <= iterations;) {
    // The first 32 iterations one by one, then eight steps an octave, each at its geometric middle.
    const double end =
        begin <= 32 ? begin + 1 : std::min(iterations + 1, std::ceil(begin * std::exp2(0.125)));
    const double middle = std::sqrt(begin * (end - 1));
    const double squared =
        begin <= 32 ? radii.next()
                    : limit * std::pow(middle, alpha - 1) * (1 - alpha * (1 - alpha) / (2 * middle));
    steps.push_back({end - begin, squared});
    begin = end;
  }
  return steps;
}

MisError progressive_error(const MisProblem& problem, double n2, const std::vector<Step>& steps,
                           Weighting weighting) {
  double iterations = 0;
  for (const Step& step : steps) iterations += step.iterations;
  const auto [low, high] = bias_range(problem);

  // With bias b in iteration i the mean's squared bias has the derivative 2 lambda / N in the bias of each,
  // lambda its whole bias; the variance of one iteration counts 1 / N^2. So lambda N takes lambda's place.
  const auto mean_error = [&](double lambda) {
    MisError mean;
    for (const Step& step : steps) {
      const Counts counts{1, n2 * step.squared_radius, true};
      MisProblem now = problem;
      for (double& b : now.b) b *= step.squared_radius;
      Weights weights;
      switch (weighting) {
        case Weighting::balance:
          weights = balance(now, counts);
          break;
        // Eq. 36 for the mean of N iterations: the penalty of each is N times its own.
        case Weighting::bias_aware:
          weights = bias_aware(now, counts, iterations * counts.n2);
          break;
        case Weighting::best:
          weights = LinearWeights(now, counts, 1).consistent(lambda * iterations);
          break;
      }
      const MisError error = error_of(now, counts, weights);
      mean.variance += step.iterations * error.variance / (iterations * iterations);
      mean.bias += step.iterations * error.bias / iterations;
    }
    return mean;
  };
  if (weighting != Weighting::best) return mean_error(0);
  return mean_error(root(low, high, [&](double guess) { return guess - mean_error(guess).bias; }));
}

double bound_of_the_paper(const MisProblem& problem, const Counts& counts) {
  const double mu = problem.integral();
  return (1 / std::min(counts.n1, counts.n2) - 1 / (counts.n1 + counts.n2)) * mu * mu;
}

double bound_that_holds(const MisProblem& problem, const Counts& counts, const Weights& aware,
                        const Weights& other) {
  const double mu = problem.integral(), area = problem.area();
  // A int w^2 b^2 - (int w b)^2: by how much Eq. 36 overestimates the squared bias.
  const auto given_away = [&](const Weights& weights, double bias) {
    double squares = 0;
    for (std::size_t k = 0; k < problem.cells(); ++k)
      squares += problem.measure[k] * std::pow(weights[k] * problem.b[k], 2);
    return area * squares - bias * bias;
  };
  const double aware_bias = error_of(problem, counts, aware).bias,
               bias = error_of(problem, counts, other).bias;
  return (mu + bias) * (mu + bias) / std::min(counts.n1, counts.n2) -
         (mu + aware_bias) * (mu + aware_bias) / (counts.n1 + counts.n2) + given_away(other, bias) -
         given_away(aware, aware_bias);
}

}  // namespace candela::study
