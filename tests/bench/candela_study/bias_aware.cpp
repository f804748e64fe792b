// The bias-aware balance heuristic [Hachisuka 2012, supplement, sections B to D] on integrands of known bias.
//
// Part "fixed": N / 2 samples of each of two techniques, the second of fixed bias: the squared error of the
// balance heuristic, of the bias-aware one (Eq. 41), and of the best weights in [0, 1], and the bounds of the
// gap (Eq. 42, 45, and the form that holds). Part "simulated": the same errors from samples. Part "random":
// how often random problems break Eq. 42. Part "progressive": the bias shrinks with the squared radius (Eq.
// 46 to 50); N iterations of one sample of technique 1 and merges of intensity n2 at the first radius.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/rng/stream.h"
#include "tests/bench/candela_study/mis_problem.h"
#include "tests/bench/candela_study/study.h"
#include "tests/statistical/moments.h"

namespace candela::study {
namespace {

using std::numbers::pi;

constexpr int kCells = 128;     // of [0, 1]
constexpr int kEdgeCells = 24;  // of a side of the unit square
constexpr double kMerges = 16;  // intensity of technique 2 at the first radius

// ---- problems ----

// Cells of [0, 1]; densities are normalized, and the integral of f is 1.
template <class F, class B, class P1, class P2>
MisProblem on_the_line(const std::string& name, const F& f, const B& b, const P1& p1, const P2& p2) {
  MisProblem problem;
  problem.name = name;
  for (int k = 0; k < kCells; ++k) {
    const double x = (k + 0.5) / kCells;
    problem.measure.push_back(1.0 / kCells);
    problem.f.push_back(f(x));
    problem.b.push_back(b(x));
    problem.p1.push_back(p1(x));
    problem.p2.push_back(p2(x));
  }
  const auto normalize = [&](std::vector<double>& values) {
    double sum = 0;
    for (std::size_t k = 0; k < values.size(); ++k) sum += problem.measure[k] * values[k];
    for (double& value : values) value /= sum;
    return sum;
  };
  const double integral = normalize(problem.f);
  for (double& b_k : problem.b) b_k /= integral;
  normalize(problem.p1);
  normalize(problem.p2);
  return problem;
}

double falling(double x) {
  return 1.8 - 1.6 * x;
}
double rising(double x) {
  return 0.2 + 1.6 * x;
}
double wave(double x) {
  return 1 + 0.5 * std::sin(2 * pi * x);
}
double bump(double x) {
  return 0.3 + std::exp(-0.5 * std::pow((x - 0.4) / 0.1, 2));
}

// The mean of a function over [x - radius, x + radius].
template <class F>
double blurred(const F& f, double x, double radius) {
  constexpr int kPoints = 64;
  double sum = 0;
  for (int i = 0; i < kPoints; ++i) sum += f(x + radius * (2 * (i + 0.5) / kPoints - 1));
  return sum / kPoints;
}

// A pixel that a shadow's edge crosses, merged with discs: the bias on both sides cancels.
MisProblem edge() {
  constexpr double kPlace = 0.55, kRadius = 0.2;
  MisProblem problem;
  problem.name = "edge";
  double sum = 0, sum1 = 0, sum2 = 0;
  for (int row = 0; row < kEdgeCells; ++row)
    for (int column = 0; column < kEdgeCells; ++column) {
      const double x = (column + 0.5) / kEdgeCells, y = (row + 0.5) / kEdgeCells;
      // Share of the disc beyond the edge.
      const double c = std::clamp((kPlace - x) / kRadius, -1.0, 1.0);
      const double beyond = (std::acos(c) - c * std::sqrt(1 - c * c)) / pi;
      const double f = x < kPlace ? 1.8 : 0.2;
      problem.measure.push_back(1.0 / (kEdgeCells * kEdgeCells));
      problem.f.push_back(f);
      problem.b.push_back(1.8 - 1.6 * beyond - f);
      problem.p1.push_back(falling(y));
      problem.p2.push_back(rising(y));
    }
  const double cell = problem.measure[0];
  for (std::size_t k = 0; k < problem.cells(); ++k) {
    sum += cell * problem.f[k];
    sum1 += cell * problem.p1[k];
    sum2 += cell * problem.p2[k];
  }
  for (std::size_t k = 0; k < problem.cells(); ++k) {
    problem.f[k] /= sum;
    problem.b[k] /= sum;
    problem.p1[k] /= sum1;
    problem.p2[k] /= sum2;
  }
  return problem;
}

std::vector<MisProblem> problems() {
  const auto constant = [](double) { return 0.2; };
  // Technique 1 finds nothing beyond 0.75 (light that only merging finds), and little just before.
  const auto partly_blind = [](double x) { return x > 0.75 ? 0.0 : x > 0.5 ? 0.05 : 1.0; };
  return {
      on_the_line("constant", wave, constant, falling, rising),
      on_the_line("hidden", wave, constant, partly_blind, rising),
      on_the_line(
          "leak", wave, [](double x) { return std::fabs(x - 0.7) < 0.05 ? 1.0 : 0.0; }, falling, rising),
      on_the_line(
          "bump", bump, [](double x) { return blurred(bump, x, 0.15) - bump(x); }, falling, rising),
      edge(),
  };
}

// ---- parts ----

void run_fixed(const Request& request, std::vector<Row>& rows) {
  const int last = request.short_form ? 12 : 24;
  for (const MisProblem& problem : problems()) {
    double size_of_b = 0;
    for (std::size_t k = 0; k < problem.cells(); ++k)
      size_of_b += problem.measure[k] * std::fabs(problem.b[k]) / problem.area();
    for (int power = 1; power <= last; power += request.short_form ? 3 : 1) {
      const double n = std::exp2(power);
      const Counts counts{n / 2, n / 2};
      const Weights best = best_weights(problem, counts), aware = bias_aware(problem, counts, n / 2);
      const MisError least = error_of(problem, counts, best);
      const auto add = [&](const std::string& method, const std::string& quantity, double value) {
        rows.push_back({"fixed", problem.name, method, kNone, n, quantity, value, 0});
      };
      const auto add_errors = [&](const std::string& method, const Weights& weights) {
        const MisError error = error_of(problem, counts, weights);
        add(method, "squared error", error.squared());
        add(method, "bias", error.bias);
        add(method, "gap", error.squared() - least.squared());
      };
      add_errors("best", best);
      add_errors("balance", balance(problem, counts));
      add_errors("bias-aware", aware);
      add_errors("bias-aware, constant b", bias_aware_constant(problem, counts, n / 2, size_of_b));
      if (std::find(problem.p1.begin(), problem.p1.end(), 0.0) == problem.p1.end())
        add_errors("technique 1 alone", Weights(problem.cells(), 0.0));
      const double bound = bound_of_the_paper(problem, counts);
      add("bound", "Eq. 42", bound);
      add("bound", "Eq. 45", bound + std::pow(error_of(problem, counts, balance(problem, counts)).bias, 2));
      add("bound", "with the terms left out", bound_that_holds(problem, counts, aware, best));
    }
    request.say("bias-aware: fixed bias, " + problem.name);
  }
}

// Draws cells of a density.
class Sampler {
 public:
  Sampler(const MisProblem& problem, const std::vector<double>& density) {
    double sum = 0;
    for (std::size_t k = 0; k < density.size(); ++k) sums_.push_back(sum += density[k] * problem.measure[k]);
  }
  std::size_t draw(rng::Stream& stream) const {
    const auto found = std::upper_bound(sums_.begin(), sums_.end(), stream.next_double() * sums_.back());
    return std::min<std::size_t>(static_cast<std::size_t>(found - sums_.begin()), sums_.size() - 1);
  }

 private:
  std::vector<double> sums_;
};

void run_simulated(const Request& request, std::vector<Row>& rows) {
  const std::uint64_t replicates = request.short_form ? 2000 : 40000;
  std::uint64_t key = 0;  // of the random numbers
  for (const MisProblem& problem : problems()) {
    const Sampler first(problem, problem.p1), second(problem, problem.p2);
    const double mu = problem.integral();
    for (const double n : {4.0, 32.0}) {
      const Counts counts{n / 2, n / 2};
      const auto simulate = [&](const std::string& method, const Weights& weights) {
        statistical::Moments squares;
        ++key;
        for (std::uint64_t replicate = 1; replicate <= replicates; ++replicate) {
          rng::Stream stream(rng::key(replicate, key, static_cast<std::uint64_t>(n)));
          double estimate = 0;
          for (int i = 0; i < static_cast<int>(n / 2); ++i) {
            const std::size_t k = first.draw(stream), l = second.draw(stream);
            estimate += (1 - weights[k]) * problem.f[k] / problem.p1[k] / counts.n1;
            estimate += weights[l] * (problem.f[l] + problem.b[l]) / problem.p2[l] / counts.n2;
          }
          squares.add((estimate - mu) * (estimate - mu));
        }
        rows.push_back(
            {"simulated", problem.name, method, kNone, n, "squared error", squares.mean(), squares.error()});
        rows.push_back({"simulated", problem.name, method, kNone, n, "squared error, exact",
                        error_of(problem, counts, weights).squared(), 0});
      };
      simulate("balance", balance(problem, counts));
      simulate("bias-aware", bias_aware(problem, counts, n / 2));
      simulate("best", best_weights(problem, counts));
    }
  }
}

// Problems of eight cells with positive f and densities, and one b > 0 for all cells.
void run_random(const Request& request, std::vector<Row>& rows) {
  const std::uint64_t count = request.short_form ? 40 : 1000;
  for (const double n : {8.0, 128.0, 2048.0}) {
    double paper = 0, holds = 0, plain = 0, broken = 0;
    for (std::uint64_t seed = 1; seed <= count; ++seed) {
      rng::Stream stream(rng::key(seed, 0x72616e64));
      const double b = std::exp(-5 * stream.next_double());
      MisProblem problem;
      double sum1 = 0, sum2 = 0;
      for (int k = 0; k < 8; ++k) {
        problem.measure.push_back(0.125);
        problem.f.push_back(std::exp(3 * stream.next_double()));
        problem.b.push_back(b * 4);
        sum1 += problem.p1.emplace_back(std::exp(6 * stream.next_double())) / 8;
        sum2 += problem.p2.emplace_back(std::exp(3 * stream.next_double())) / 8;
      }
      for (double& p : problem.p1) p /= sum1;
      for (double& p : problem.p2) p /= sum2;
      const Counts counts{n / 2, n / 2};
      const Weights best = best_weights(problem, counts), aware = bias_aware(problem, counts, n / 2);
      const double least = error_of(problem, counts, best).squared();
      const double gap = error_of(problem, counts, aware).squared() - least;
      const double bound = bound_of_the_paper(problem, counts);
      paper = std::max(paper, gap / bound);
      broken += gap > bound ? 1 : 0;
      holds = std::max(holds, gap / bound_that_holds(problem, counts, aware, best));
      plain =
          std::max(plain, (error_of(problem, counts, balance(problem, counts)).squared() - least) / bound);
    }
    const auto add = [&](const std::string& method, const std::string& quantity, double value) {
      rows.push_back({"random", "eight cells", method, kNone, n, quantity, value, 0});
    };
    add("bias-aware", "largest gap over Eq. 42", paper);
    add("bias-aware", "share beyond Eq. 42", broken / static_cast<double>(count));
    add("bias-aware", "largest gap over the bound with the terms left out", holds);
    add("balance", "largest gap over Eq. 42", plain);
  }
}

void run_progressive(const Request& request, std::vector<Row>& rows) {
  const int last = request.short_form ? 8 : 20;
  for (const MisProblem& problem : problems()) {
    if (problem.name != "constant" && problem.name != "hidden") continue;
    for (const double alpha : {0.5, 2.0 / 3, 0.75, 0.9})
      for (int power = 0; power <= last; power += 2) {
        const double n = std::exp2(power), mu = problem.integral();
        const auto steps = progressive_steps(alpha, n);
        const auto add = [&](const std::string& method, const std::string& quantity, double value) {
          rows.push_back({"progressive", problem.name, method, alpha, n, quantity, value, 0});
        };
        const MisError best = progressive_error(problem, kMerges, steps, Weighting::best);
        const MisError plain = progressive_error(problem, kMerges, steps, Weighting::balance);
        const MisError aware = progressive_error(problem, kMerges, steps, Weighting::bias_aware);
        for (const auto& [method, error] :
             {std::pair("best", best), {"balance", plain}, {"bias-aware", aware}}) {
          add(method, "squared error", error.squared());
          add(method, "variance", error.variance);
          add(method, "bias", error.bias);
          add(method, "gap", error.squared() - best.squared());
        }
        // Eq. 47 with the bias itself in place of its order.
        add("bound", "Eq. 47", (std::pow(n, -alpha) - 1 / (2 * n)) * mu * mu + plain.bias * plain.bias);
        add("bound", "Eq. 42", (std::pow(n, -alpha) - 1 / (2 * n)) * mu * mu);
      }
    request.say("bias-aware: progressive, " + problem.name);
  }
}

}  // namespace

Result<Results> run_bias_aware(const Request& request) {
  Results results;
  std::vector<Row>& rows = results.rows;
  run_fixed(request, rows);
  run_simulated(request, rows);
  run_random(request, rows);
  run_progressive(request, rows);
  return results;
}

}  // namespace candela::study
