// Weights and optimal slopes against exact values (tests/unit/mis_table.h).
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numeric>

#include "tests/mis_problems.h"
#include "tests/unit/mis_table.h"

namespace candela {
namespace {

using test::MisMoments;
using test::MisProblem;

const std::vector<std::string> kProblems = {"D1", "D2", "D3", "D4", "D5", "D6", "D7", "D8"};

const test::MisRow& row(std::string_view problem, std::string_view strategy) {
  for (const test::MisRow& r : test::kMisTable)
    if (r.problem == problem && r.strategy == strategy) return r;
  throw std::runtime_error("no row " + std::string(problem) + " " + std::string(strategy));
}
bool has_row(std::string_view problem, std::string_view strategy) {
  for (const test::MisRow& r : test::kMisTable)
    if (r.problem == problem && r.strategy == strategy) return true;
  return false;
}
void expect_variance(double variance, const test::MisRow& r) {
  EXPECT_NEAR(variance, r.variance, 1e-12 * std::abs(r.variance) + 2 * r.error)
      << r.problem << " " << r.strategy;
}

// The product of A and a vector.
mis::Vector times(const mis::Sums& sums, std::size_t n, const mis::Vector& x) {
  mis::Vector y{};
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) y[i] += sums.a[mis::packed(i, j)] * x[j];
  return y;
}
double dot(const mis::Vector& a, const mis::Vector& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

// Variance of one batch with fixed slopes: samples contribute f / q - alpha . c.
double variance_of(const mis::Allocation& n, const MisMoments& m, const mis::Vector& alpha) {
  const mis::Vector a = times(m.sums, n.techniques, alpha);
  double v = m.f2q - 2 * dot(alpha, m.sums.b[0]) + dot(alpha, a);
  for (std::size_t i = 0; i < n.techniques; ++i) {
    const double mean = m.sums.b[0][i] - a[i];
    v -= n.counts[i] * mean * mean;
  }
  return v;
}
// Among slopes that are as good, those that solve A alpha = b.
mis::Vector solution(const mis::Allocation& n, const MisMoments& m, mis::Vector alpha) {
  const double s = (m.f - std::accumulate(alpha.begin(), alpha.end(), 0.0)) / n.total();
  for (std::size_t i = 0; i < n.techniques; ++i) alpha[i] += s * n.counts[i];
  return alpha;
}

// Claim: each heuristic has the mean and the variance that quadrature by another program gives, on D1 to D8.
TEST(MisExact, HeuristicsHaveTheirVariances) {
  const std::map<std::string, mis::Heuristic> strategies = {{"balance", mis::Heuristic::balance},
                                                            {"power2", mis::Heuristic::power},
                                                            {"cutoff0.1", mis::Heuristic::cutoff},
                                                            {"maximum", mis::Heuristic::maximum}};
  for (const std::string& name : kProblems) {
    const MisProblem p = test::mis_problem(name);
    for (const auto& [strategy, heuristic] : strategies) {
      std::vector<double> breaks = p.breaks;
      if (heuristic == mis::Heuristic::cutoff) breaks = test::mis_crossings(p, mis::kCutoff);
      if (heuristic == mis::Heuristic::maximum) breaks = test::mis_crossings(p, 1);
      const auto nodes = test::mis_nodes(breaks);
      const double v = test::mis_variance(p, nodes, [&, h = heuristic](double x) {
        mis::Vector w{};
        mis::weights(h, p.allocation, p.densities(x), w);
        return w;
      });
      expect_variance(v, row(name, strategy));
      double mean = 0;
      for (const test::MisNode& node : nodes) {
        mis::Vector w{};
        mis::weights(heuristic, p.allocation, p.densities(node.x), w);
        for (std::size_t i = 0; i < p.size(); ++i) mean += node.weight * w[i] * p.f(node.x);
      }
      EXPECT_NEAR(mean, row(name, strategy).mean, 1e-12 * row(name, strategy).mean)
          << name << " " << strategy;
    }
    double best = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < p.size(); ++i) {
      const std::string strategy = "technique" + std::to_string(i + 1);
      if (!has_row(name, strategy)) continue;  // it does not cover f
      mis::Vector alone{};
      alone[i] = 1;
      const double v = test::mis_variance(p, test::mis_nodes(p.breaks), [&](double) { return alone; });
      expect_variance(v, row(name, strategy));
      best = std::min(best, v);
    }
    expect_variance(best, row(name, "best"));
    expect_variance(best / p.allocation.total(), row(name, "best-all-M"));
    EXPECT_NEAR(test::mis_moments(p).f, row(name, "balance").mean, 1e-12 * row(name, "balance").mean);
  }
}

// Claim: sums of infinitely many samples give the optimal slopes and the optimal variance; A n = 1, and the
// slopes that solve A alpha = b sum to F.
TEST(MisExact, MomentsGiveTheOptimum) {
  const std::map<std::string, std::vector<double>> known = {{"D1", {-.239908711, .376431204, .204323989}},
                                                            {"D2", {.025886147, -.141897458, .456857793}},
                                                            {"D3", {1, -.5}},
                                                            {"D5", {-.111151077, 1.266151077}},
                                                            {"D6", {.141141774, .199704708}},
                                                            {"D7", {.151449267, .189397215}},
                                                            {"D8", {2, -1}}};
  for (const std::string& name : kProblems) {
    const MisProblem p = test::mis_problem(name);
    const MisMoments m = test::mis_moments(p);
    const mis::Vector an = m.sums.control_sums(p.allocation);
    for (std::size_t i = 0; i < p.size(); ++i) EXPECT_NEAR(an[i], 1, 1e-12) << name;
    EXPECT_NEAR(m.sums.samples(p.allocation), p.allocation.total(), 1e-12);
    const mis::Vector alpha = solution(p.allocation, m, mis::solve(p.allocation, m.sums, 0)[0]);
    const mis::Vector a = times(m.sums, p.size(), alpha);
    for (std::size_t i = 0; i < p.size(); ++i) EXPECT_NEAR(a[i], m.sums.b[0][i], 1e-12) << name;
    EXPECT_NEAR(variance_of(p.allocation, m, alpha), row(name, "optimal").variance, 1e-12 * m.f2q) << name;
    EXPECT_NEAR(m.f2q - dot(alpha, m.sums.b[0]), row(name, "optimal").variance, 1e-12 * m.f2q) << name;
    // Slopes of zero are the balance heuristic.
    EXPECT_NEAR(variance_of(p.allocation, m, {}), row(name, "balance").variance, 1e-12 * m.f2q) << name;
    if (const auto found = known.find(name); found != known.end()) {
      for (std::size_t i = 0; i < p.size(); ++i) EXPECT_NEAR(alpha[i], found->second[i], 2e-9) << name;
    }
  }
}

// Claim: each color has the slopes and the optimal variance of its own integrand.
TEST(MisExact, EachColorHasItsOwnSlopes) {
  struct Color {
    std::function<double(double)> f;
    double balance, optimal;
  };
  const Color colors[] = {{[](double x) { return test::mis_problems::lobe(x) - .15 * x; }, .016883, .000394},
                          {[](double x) { return .6 * (1 - x) + .1; }, .018843, 0},
                          {[](double x) { return x * x; }, .033969, .001030}};
  MisProblem p = test::mis_problem("D1");
  std::array<MisMoments, 3> moments;
  mis::Sums sums;
  for (std::size_t k = 0; k < 3; ++k) {
    p.f = colors[k].f;
    moments[k] = test::mis_moments(p);
    sums.a = moments[k].sums.a;
    sums.b[k] = moments[k].sums.b[0];
  }
  const mis::Slopes slopes = mis::solve(p.allocation, sums, 0);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(variance_of(p.allocation, moments[k], {}), colors[k].balance, 1e-6) << k;
    EXPECT_NEAR(variance_of(p.allocation, moments[k], slopes[k]), colors[k].optimal, 1e-6) << k;
  }
}

// Claim: three selections among six lights, one of them occluded, have their exact variances alone, under
// each heuristic and the optimum, and their slopes.
TEST(MisExact, SelectionOfLights) {
  const std::vector<double> unshadowed = {2, 1.5, .4, .8, .05, .3}, visible = {0, 1, 1, .5, 1, 1};
  const std::map<std::string, std::vector<double>> selections = {
      {"uniform", {1, 1, 1, 1, 1, 1}}, {"power", {40, 10, 10, 5, 2, 1}}, {"unshadowed", unshadowed}};
  const std::map<std::string, double> alone = {{"uniform", 8.9525}, {"power", 17.7465}, {"unshadowed", 5.35}};
  const std::map<std::string, std::vector<double>> slopes = {
      {"L1-uniform+unshadowed", {1.090189, 1.559811}},
      {"L1-power+unshadowed", {-2.585346, 5.235346}},
      {"L1-uniform+power+unshadowed", {.717307, -3.113211, 5.045904}}};
  const std::vector<std::vector<std::string>> sets = {{"uniform"},
                                                      {"power"},
                                                      {"unshadowed"},
                                                      {"uniform", "power"},
                                                      {"uniform", "unshadowed"},
                                                      {"power", "unshadowed"},
                                                      {"uniform", "power", "unshadowed"}};
  for (const auto& names : sets) {
    std::string problem = "L1-";
    for (const std::string& name : names) problem += (problem.size() > 3 ? "+" : "") + name;
    const mis::Allocation n = mis::Allocation::ones(names.size());
    MisMoments m;
    std::array<mis::Vector, 6> p{};
    for (std::size_t light = 0; light < 6; ++light) {
      for (std::size_t i = 0; i < names.size(); ++i) {
        const std::vector<double>& share = selections.at(names[i]);
        p[light][i] = share[light] / std::accumulate(share.begin(), share.end(), 0.0);
      }
      const double f = unshadowed[light] * visible[light];
      const mis::Controls c = mis::controls(n, p[light]);
      for (std::size_t i = 0; i < names.size(); ++i) {
        for (std::size_t j = 0; j <= i; ++j) m.sums.a[mis::packed(i, j)] += p[light][i] * c.c[j];
        m.sums.b[0][i] += f * c.c[i];
      }
      m.f += f;
      m.f2q += f * c.over_q(f);
    }
    const auto heuristic = [&](mis::Heuristic h) {
      double variance = 0;
      for (std::size_t i = 0; i < names.size(); ++i) {
        double mean = 0, square = 0;
        for (std::size_t light = 0; light < 6; ++light) {
          mis::Vector w{};
          mis::weights(h, n, p[light], w);
          const double value = w[i] * unshadowed[light] * visible[light];
          mean += value;
          square += value * value / p[light][i];
        }
        variance += square - mean * mean;
      }
      return variance;
    };
    if (names.size() == 1) {
      EXPECT_NEAR(heuristic(mis::Heuristic::balance), alone.at(names[0]), 1e-12);
      continue;
    }
    expect_variance(heuristic(mis::Heuristic::balance), row(problem, "balance"));
    expect_variance(heuristic(mis::Heuristic::power), row(problem, "power2"));
    expect_variance(heuristic(mis::Heuristic::cutoff), row(problem, "cutoff0.1"));
    expect_variance(heuristic(mis::Heuristic::maximum), row(problem, "maximum"));
    const mis::Vector alpha = solution(n, m, mis::solve(n, m.sums, 0)[0]);
    EXPECT_NEAR(variance_of(n, m, alpha), row(problem, "optimal").variance, 1e-12 * m.f2q) << problem;
    if (const auto found = slopes.find(problem); found != slopes.end()) {
      for (std::size_t i = 0; i < names.size(); ++i) EXPECT_NEAR(alpha[i], found->second[i], 1e-6) << problem;
    }
  }
}

}  // namespace
}  // namespace candela
