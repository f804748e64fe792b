// One-dimensional problems of multiple importance sampling on [0, 1], and light selection among six lights,
// with their moments by quadrature: D1 to D8 and L1.
//
// lobe(x) = exp(-((x - 0.4) / 0.15)^2) + 0.15 x
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "common/mis/estimators.h"
#include "common/rng/stream.h"

namespace candela::test {

struct MisTechnique {
  std::function<double(double)> pdf;     // given success
  std::function<double(double)> sample;  // of u in [0, 1)
  double fail = 0;                       // probability of giving nothing
};

struct MisProblem {
  std::string name;
  std::function<double(double)> f;
  std::vector<MisTechnique> techniques;
  mis::Allocation allocation;
  std::vector<double> breaks = {};  // where f or a density jumps

  std::size_t size() const { return techniques.size(); }
  double pdf(std::size_t i, double x) const { return (1 - techniques[i].fail) * techniques[i].pdf(x); }
  mis::Vector densities(double x) const {
    mis::Vector p{};
    for (std::size_t i = 0; i < size(); ++i) p[i] = pdf(i, x);
    return p;
  }
  double scaled(std::size_t i, double x) const { return allocation.counts[i] * pdf(i, x); }
};

namespace mis_problems {

inline MisTechnique uniform() {
  return {[](double) { return 1.0; }, [](double u) { return u; }};
}
inline MisTechnique linear() {
  return {[](double x) { return 2 * x; }, [](double u) { return std::sqrt(u); }};
}
inline MisTechnique half_plus() {
  return {[](double x) { return 0.5 + x; }, [](double u) { return -0.5 + std::sqrt(0.25 + 2 * u); }};
}
inline MisTechnique cauchy(double m, double w) {
  const double low = std::atan(-m / w), high = std::atan((1 - m) / w);
  return {[=](double x) { return w / ((high - low) * (w * w + (x - m) * (x - m))); },
          [=](double u) { return m + w * std::tan(low + u * (high - low)); }};
}
inline MisTechnique even_mixture(MisTechnique a, MisTechnique b) {
  return {[=](double x) { return 0.5 * a.pdf(x) + 0.5 * b.pdf(x); },
          [=](double u) { return u < 0.5 ? a.sample(2 * u) : b.sample(2 * u - 1); }};
}
inline MisTechnique box(double a, double b) {
  return {[=](double x) { return x >= a && x <= b ? 1 / (b - a) : 0.0; },
          [=](double u) { return a + u * (b - a); }};
}
inline MisTechnique failing(MisTechnique t, double probability) {
  t.fail = probability;
  return t;
}
inline double lobe(double x) {
  const double t = (x - 0.4) / 0.15;
  return std::exp(-t * t) + 0.15 * x;
}

}  // namespace mis_problems

inline MisProblem mis_problem(std::string_view name) {
  using namespace mis_problems;
  const auto make = [&](auto f, std::vector<MisTechnique> techniques, std::vector<double> breaks = {}) {
    const mis::Allocation ones = mis::Allocation::ones(techniques.size());
    return MisProblem{std::string(name), f, std::move(techniques), ones, std::move(breaks)};
  };
  if (name == "D1") return make(lobe, {uniform(), cauchy(0.4, 0.12), half_plus()});
  if (name == "D2") return make(lobe, {uniform(), cauchy(0.85, 0.05), half_plus()});
  if (name == "D3") return make([](double x) { return 1 - x; }, {uniform(), linear()});
  if (name == "D4")
    return make(lobe, {uniform(), cauchy(0.4, 0.12), even_mixture(uniform(), cauchy(0.4, 0.12))});
  if (name == "D5") {
    MisProblem p = make([](double x) { return x < 0.3 ? 0 : 1 + x; }, {uniform(), linear()}, {0.3});
    p.allocation.counts[0] = 2;
    return p;
  }
  if (name == "D6") return make(lobe, {uniform(), box(0.25, 0.55)}, {0.25, 0.55});
  if (name == "D7") return make(lobe, {uniform(), failing(cauchy(0.4, 0.12), 0.3)});
  if (name == "D8") {
    const MisTechnique peak = cauchy(0.4, 0.01);
    return make(peak.pdf, {even_mixture(peak, uniform()), uniform()});
  }
  throw std::runtime_error("no problem " + std::string(name));
}

// ---- quadrature

struct MisNode {
  double x, weight;
};

// Composite Gauss-Legendre rule of 10 points on panels between the breaks and in equal steps.
inline std::vector<MisNode> mis_nodes(std::vector<double> breaks, int panels = 400) {
  static constexpr double kX[] = {0.1488743389816312108848, 0.4333953941292471907993,
                                  0.6794095682990244062343, 0.8650633666889845107321,
                                  0.9739065285171717200780};
  static constexpr double kW[] = {0.2955242247147528701739, 0.2692667193099963550912,
                                  0.2190863625159820439955, 0.1494513491505805931458,
                                  0.0666713443086881375936};
  for (int i = 0; i <= panels; ++i) breaks.push_back(static_cast<double>(i) / panels);
  std::sort(breaks.begin(), breaks.end());
  std::vector<MisNode> nodes;
  for (std::size_t i = 0; i + 1 < breaks.size(); ++i) {
    const double half = (breaks[i + 1] - breaks[i]) / 2, center = breaks[i] + half;
    if (!(half > 0)) continue;
    for (int k = 0; k < 5; ++k)
      for (const double sign : {-1.0, 1.0}) nodes.push_back({center + sign * half * kX[k], half * kW[k]});
  }
  return nodes;
}

// Places where some q_i is `share` of another: kinks of weights.
inline std::vector<double> mis_crossings(const MisProblem& p, double share) {
  std::vector<double> out = p.breaks;
  const auto sign = [&](double x, std::size_t i, std::size_t k) {
    return p.scaled(i, x) - share * p.scaled(k, x);
  };
  constexpr int kSteps = 20000;
  for (std::size_t i = 0; i < p.size(); ++i)
    for (std::size_t k = 0; k < p.size(); ++k) {
      if (i == k) continue;
      for (int s = 0; s < kSteps; ++s) {
        double a = static_cast<double>(s) / kSteps, b = static_cast<double>(s + 1) / kSteps;
        const double at_a = sign(a, i, k);
        if (!(at_a * sign(b, i, k) < 0)) continue;
        for (int step = 0; step < 60; ++step) {
          const double m = (a + b) / 2;
          (at_a * sign(m, i, k) > 0 ? a : b) = m;
        }
        out.push_back(a);
      }
    }
  return out;
}

// Expectations of the sums of one batch, failures included: what Sums are after infinitely many, per batch.
struct MisMoments {
  mis::Sums sums;         // A, b (color 0)
  double f = 0, f2q = 0;  // F, integral of f^2 / q
};
inline MisMoments mis_moments(const MisProblem& p) {
  MisMoments m;
  for (const MisNode& node : mis_nodes(p.breaks)) {
    const mis::Vector densities = p.densities(node.x);
    const mis::Controls c = mis::controls(p.allocation, densities);
    const double f = p.f(node.x), f_over_q = c.over_q(f);
    for (std::size_t i = 0; i < p.size(); ++i) {
      for (std::size_t j = 0; j <= i; ++j) m.sums.a[mis::packed(i, j)] += node.weight * densities[i] * c.c[j];
      m.sums.b[0][i] += node.weight * f * c.c[i];
    }
    m.f += node.weight * f;
    m.f2q += node.weight * f * f_over_q;
  }
  for (std::size_t i = 0; i < p.size(); ++i)
    m.sums.a[mis::packed(i, i)] += p.techniques[i].fail / p.allocation.counts[i];
  return m;
}

// Variance of one batch of the multi-sample estimator with weights w(x) that sum to 1.
template <class Weights>
double mis_variance(const MisProblem& p, const std::vector<MisNode>& nodes, const Weights& weights_at) {
  double variance = 0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    double mean = 0;
    for (const MisNode& node : nodes) mean += node.weight * weights_at(node.x)[i] * p.f(node.x);
    double sum = p.techniques[i].fail * mean * mean;
    for (const MisNode& node : nodes) {
      const double pdf = p.pdf(i, node.x);
      if (!(pdf > 0)) continue;
      const double e = weights_at(node.x)[i] * p.f(node.x) / pdf - mean;
      sum += node.weight * pdf * e * e;
    }
    variance += sum / p.allocation.counts[i];
  }
  return variance;
}

// ---- sampling

// One batch: its sums, with f / q in color 0.
inline mis::Sums mis_batch(const MisProblem& p, rng::Stream& random) {
  mis::Sums batch;
  for (std::size_t i = 0; i < p.size(); ++i)
    for (int n = 0; n < static_cast<int>(p.allocation.counts[i]); ++n) {
      const double x = p.techniques[i].sample(random.next_double());
      if (p.techniques[i].fail > 0 && random.next_double() < p.techniques[i].fail) {
        batch.add(p.size(), mis::controls_of_one(p.allocation, i), {});
        continue;
      }
      const mis::Controls c = mis::controls(p.allocation, p.densities(x));
      batch.add(p.size(), c.c, {c.over_q(p.f(x)), 0, 0});
    }
  return batch;
}
inline mis::Sums mis_batches(const MisProblem& p, int batches, rng::Stream& random) {
  mis::Sums sums;
  for (int t = 0; t < batches; ++t) sums.add(mis_batch(p, random));
  return sums;
}

}  // namespace candela::test
