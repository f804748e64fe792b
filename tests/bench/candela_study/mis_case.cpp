#include "tests/bench/candela_study/mis_case.h"

#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <stdexcept>

#include "tests/bench/candela_study/mis_rectangle.h"
#include "tests/mis_problems.h"

namespace candela::study {
namespace {

constexpr std::uint32_t kShown = 241;  // points of [0, 1]

// Samples that fail with this probability add nothing but their control.
std::vector<double> failures(const MisCase& problem) {
  std::vector<double> rho(problem.allocation.techniques, 1.0);
  for (const MisPoint& point : problem.points)
    for (std::size_t i = 0; i < rho.size(); ++i) rho[i] -= point.weight * point.p[i];
  for (double& r : rho) r = r > 1e-9 ? r : 0;  // rounding of the quadrature
  return rho;
}

const std::map<std::string, mis::Heuristic, std::less<>> kByName = {{"balance", mis::Heuristic::balance},
                                                                    {"power", mis::Heuristic::power},
                                                                    {"cutoff", mis::Heuristic::cutoff},
                                                                    {"maximum", mis::Heuristic::maximum}};

// Variance of sum_i mean_j w_i f / p_i, with the differences from the means summed up, not of their squares.
template <class WeightsAt>
double variance_of(const MisCase& problem, const WeightsAt& weights) {
  const std::size_t n = problem.allocation.techniques;
  mis::Vector mean{}, square{};
  std::vector<mis::Vector> at;
  at.reserve(problem.points.size());
  for (const MisPoint& point : problem.points) {
    at.push_back(point.f == 0 ? mis::Vector{} : weights(point));
    for (std::size_t i = 0; i < n; ++i) mean[i] += point.weight * at.back()[i] * point.f;
  }
  for (std::size_t k = 0; k < at.size(); ++k) {
    const MisPoint& point = problem.points[k];
    for (std::size_t i = 0; i < n; ++i) {
      if (!(point.p[i] > 0)) continue;
      const double off = at[k][i] * point.f / point.p[i] - mean[i];
      square[i] += point.weight * point.p[i] * off * off;
    }
  }
  const std::vector<double> fail = failures(problem);
  double variance = 0;
  for (std::size_t i = 0; i < n; ++i)
    variance += (square[i] + fail[i] * mean[i] * mean[i]) / problem.allocation.counts[i];
  return variance;
}

mis::Vector one(std::size_t i) {
  mis::Vector w{};
  w[i] = 1;
  return w;
}

// Integral of (f - alpha . p)^2 / q, failures being points that one technique alone reaches.
double optimal_variance(const MisCase& problem, const mis::Vector& alpha) {
  double variance = 0;
  for (const MisPoint& point : problem.points) {
    double q = 0, g = point.f;
    for (std::size_t i = 0; i < problem.allocation.techniques; ++i) {
      q += problem.allocation.counts[i] * point.p[i];
      g -= alpha[i] * point.p[i];
    }
    if (q > 0) variance += point.weight * g * g / q;
  }
  const std::vector<double> fail = failures(problem);
  for (std::size_t i = 0; i < fail.size(); ++i)
    variance += fail[i] * alpha[i] * alpha[i] / problem.allocation.counts[i];
  return variance;
}

std::size_t best_technique(const MisCase& problem) {
  std::size_t best = mis::kMaxTechniques;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < problem.allocation.techniques; ++i) {
    bool covers = true;
    for (const MisPoint& point : problem.points) covers &= point.f == 0 || point.p[i] > 0;
    if (!covers) continue;
    const double v = variance_of(problem, [&](const MisPoint&) { return one(i); });
    if (v < least) {
      least = v;
      best = i;
    }
  }
  if (best == mis::kMaxTechniques) throw std::runtime_error("no technique covers " + problem.name);
  return best;
}

}  // namespace

MisSample sample_at(const mis::Allocation& allocation, const MisPoint& point) {
  const mis::Controls controls = mis::controls(allocation, point.p);
  return {controls.c, controls.over_q(point.f)};
}

MisCase line_case(const test::MisProblem& p) {
  MisCase problem{p.name, p.allocation, {}, {}, {}, kShown};
  const auto at = [p](double x) { return MisPoint{0, p.f(x), p.densities(x)}; };
  std::vector<double> breaks = p.breaks;
  for (const double share : {mis::kCutoff, 1.0})
    for (const double x : test::mis_crossings(p, share)) breaks.push_back(x);
  for (const test::MisNode& node : test::mis_nodes(breaks)) {
    problem.points.push_back(at(node.x));
    problem.points.back().weight = node.weight;
  }
  for (std::uint32_t k = 0; k < kShown; ++k)
    problem.shown.push_back(at(static_cast<double>(k) / (kShown - 1)));
  problem.draw = [p, at](rng::Stream& random, std::vector<MisSample>& out) {
    for (std::size_t i = 0; i < p.size(); ++i)
      for (int k = 0; k < static_cast<int>(p.allocation.counts[i]); ++k) {
        const double x = p.techniques[i].sample(random.next_double());
        const bool failed = p.techniques[i].fail > 0 && random.next_double() < p.techniques[i].fail;
        out.push_back(failed ? MisSample{mis::controls_of_one(p.allocation, i), 0}
                             : sample_at(p.allocation, at(x)));
      }
  };
  return problem;
}

MisCase lights_case(const std::vector<std::string>& selections) {
  static constexpr std::size_t kLights = 6;
  static const std::vector<double> unshadowed = {2, 1.5, .4, .8, .05, .3}, visible = {0, 1, 1, .5, 1, 1};
  const std::map<std::string, std::vector<double>> shares = {
      {"uniform", {1, 1, 1, 1, 1, 1}}, {"power", {40, 10, 10, 5, 2, 1}}, {"unshadowed", unshadowed}};
  MisCase problem;
  problem.name = "L1 ";
  problem.allocation = mis::Allocation::ones(selections.size());
  std::vector<MisPoint> lights(kLights);
  for (std::size_t i = 0; i < selections.size(); ++i) {
    problem.name += (i == 0 ? "" : "+") + selections[i];
    const std::vector<double>& share = shares.at(selections[i]);
    const double sum = std::accumulate(share.begin(), share.end(), 0.0);
    for (std::size_t l = 0; l < kLights; ++l) lights[l].p[i] = share[l] / sum;
  }
  for (std::size_t l = 0; l < kLights; ++l) {
    lights[l].weight = 1;
    lights[l].f = unshadowed[l] * visible[l];
  }
  problem.points = problem.shown = lights;
  problem.shown_width = kLights;
  problem.draw = [allocation = problem.allocation, lights](rng::Stream& random, std::vector<MisSample>& out) {
    for (std::size_t i = 0; i < allocation.techniques; ++i) {
      double u = random.next_double();
      std::size_t l = 0;
      while (l + 1 < kLights && u >= lights[l].p[i]) u -= lights[l++].p[i];
      out.push_back(sample_at(allocation, lights[l]));
    }
  };
  return problem;
}

std::vector<MisCase> mis_cases() {
  std::vector<MisCase> cases;
  for (const char* name : {"D1", "D2", "D3", "D4", "D5", "D6", "D7", "D8"})
    cases.push_back(line_case(test::mis_problem(name)));
  for (const LampOverPoint& lamp : lamps_over_points())
    for (const auto& techniques : kLampTechniqueSets) cases.push_back(lamp_case(lamp, techniques));
  for (const std::vector<std::string>& selections : {std::vector<std::string>{"uniform", "power"},
                                                     {"uniform", "unshadowed"},
                                                     {"power", "unshadowed"},
                                                     {"uniform", "power", "unshadowed"}})
    cases.push_back(lights_case(selections));
  return cases;
}

MisExact exact_of(const MisCase& problem) {
  const std::size_t n = problem.allocation.techniques;
  MisExact exact;
  for (const MisPoint& point : problem.points) {
    const mis::Controls c = mis::controls(problem.allocation, point.p);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j <= i; ++j)
        exact.sums.a[mis::packed(i, j)] += point.weight * point.p[i] * c.c[j];
      exact.sums.b[0][i] += point.weight * point.f * c.c[i];
    }
    exact.integral += point.weight * point.f;
  }
  const std::vector<double> fail = failures(problem);
  for (std::size_t i = 0; i < n; ++i)
    exact.sums.a[mis::packed(i, i)] += fail[i] / problem.allocation.counts[i];
  // Many slopes may be equally good; alpha solves A alpha = b.
  exact.alpha = mis::solve(problem.allocation, exact.sums, 0)[0];
  const double sum = std::accumulate(exact.alpha.begin(), exact.alpha.end(), 0.0);
  for (std::size_t i = 0; i < n; ++i)
    exact.alpha[i] += (exact.integral - sum) / problem.allocation.total() * problem.allocation.counts[i];
  exact.best = best_technique(problem);
  return exact;
}

double exact_variance(const MisCase& problem, const MisExact& exact, const std::string& strategy) {
  if (strategy == "optimal") return optimal_variance(problem, exact.alpha);
  if (strategy == "best" || strategy == "best, all samples") {
    const double v = variance_of(problem, [&](const MisPoint&) { return one(exact.best); });
    return strategy == "best" ? v : v * problem.allocation.counts[exact.best] / problem.allocation.total();
  }
  return variance_of(problem, [&](const MisPoint& p) { return weights_at(problem, exact, strategy, p); });
}

mis::Vector weights_at(const MisCase& problem, const MisExact& exact, const std::string& strategy,
                       const MisPoint& point) {
  mis::Vector w{};
  if (strategy == "optimal") {
    const mis::Controls c = mis::controls(problem.allocation, point.p);
    double share = 1;
    for (std::size_t i = 0; i < problem.allocation.techniques; ++i)
      share -= exact.alpha[i] * point.p[i] / point.f;
    for (std::size_t i = 0; i < problem.allocation.techniques; ++i)
      w[i] = exact.alpha[i] * point.p[i] / point.f + problem.allocation.counts[i] * c.c[i] * share;
    return w;
  }
  if (const auto found = kByName.find(strategy); found != kByName.end()) {
    mis::weights(found->second, problem.allocation, point.p, w);
    return w;
  }
  return one(exact.best);
}

}  // namespace candela::study
