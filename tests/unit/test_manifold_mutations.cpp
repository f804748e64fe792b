// Claims: a walk arrives at the slopes it is sent to, and back where it began; specular vertices stay
// specular; the density of a one-step proposal is that of the map from slopes to paths, and is known from
// the two paths alone; chains of either mutation keep their density on a surface of facets.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "tests/statistical/quantiles.h"
#include "tests/unit/manifold_chains.h"
#include "tests/unit/manifold_geometry.h"
#include "worker/transport/manifold/proposal.h"
#include "worker/transport/manifold/walk.h"

namespace candela {
namespace {

using namespace test;  // NOLINT(google-build-using-namespace)

constexpr Mat2 kToFilm{300, 0, 0, 300};

Chain near_specular(rng::Stream& stream, const SimpleSurfaces& surfaces) {
  for (;;) {
    const Chain chain =
        two_vertex_chain(surfaces, between(stream, -0.2, 0.6), between(stream, -0.3, 0.4),
                         {between(stream, -1, -0.2), between(stream, -0.4, 0.5), between(stream, 0.3, 1)});
    if (fault_of(chain) == Fault::none) return chain;
  }
}

TEST(HalfVectorWalk, ArrivesAndReturns) {
  rng::Stream stream(rng::key(46, 10));
  const SimpleSurfaces surfaces = two_vertex_surfaces();
  const std::vector<double> tolerances(2, 1e-10);
  int converged = 0, returned = 0;
  std::uint32_t iterations = 0;
  constexpr int kWalks = 2000;
  for (int n = 0; n < kWalks; ++n) {
    const Chain start = near_specular(stream, surfaces);
    const std::vector<Pair> from = constraints(Form::slope, start);
    std::vector<Pair> to = from;
    for (Pair& c : to) c = c + normals(stream) * 0.05;
    Chain moved = start;
    const Walked walked = walk(moved, to, tolerances, surfaces, {});
    if (!walked.converged()) continue;
    ++converged;
    iterations += walked.iterations;
    const std::vector<Pair> reached = constraints(Form::slope, moved);
    for (std::size_t i = 0; i < 2; ++i) EXPECT_LT(max_abs(reached[i] - to[i]), 1e-10);
    EXPECT_EQ(moved.vertices[0].x, start.vertices[0].x);
    EXPECT_EQ(moved.vertices[3].x, start.vertices[3].x);
    returned += returns(moved, start, from, tolerances, surfaces, {});
  }
  EXPECT_GT(converged, kWalks * 8 / 10);
  EXPECT_GT(returned, converged * 99 / 100);
  EXPECT_LT(iterations, 6u * static_cast<unsigned>(converged));  // Newton's
}

TEST(HalfVectorWalk, IsAFunctionOfItsArguments) {
  rng::Stream stream(rng::key(46, 11));
  const SimpleSurfaces surfaces = two_vertex_surfaces();
  const Chain start = near_specular(stream, surfaces);
  std::vector<Pair> to = constraints(Form::slope, start);
  for (Pair& c : to) c = c + Pair{0.02, -0.01};
  Chain a = start, b = start;
  const std::vector<double> tolerances(2, 1e-9);
  const Walked first = walk(a, to, tolerances, surfaces, {}), second = walk(b, to, tolerances, surfaces, {});
  EXPECT_EQ(first.end, second.end);
  EXPECT_EQ(first.iterations, second.iterations);
  EXPECT_EQ(a.vertices[1].x, b.vertices[1].x);
  EXPECT_EQ(a.vertices[2].x, b.vertices[2].x);
}

// Glass is held at 0 while the sensor's end and the slope on the sphere move.
TEST(HalfVectorWalk, KeepsASpecularVertexAndFollowsAnEnd) {
  rng::Stream stream(rng::key(46, 12));
  const SimpleSurfaces surfaces = two_vertex_surfaces();
  Chain chain = near_specular(stream, surfaces);
  std::vector<Pair> targets = constraints(Form::slope, chain);
  targets[0] = {};
  const std::vector<double> tolerances{tolerance(1, 0), tolerance(1, 0.3)};
  int converged = 0, tries = 0;
  for (int n = 0; n < 300; ++n) {
    Chain next = chain;
    next.vertices[3].x = {-1.6 + between(stream, -0.05, 0.05), 0.4 + between(stream, -0.05, 0.05), -1.5};
    std::vector<Pair> to = targets;
    to[1] = targets[1] + normals(stream) * 0.02;
    ++tries;
    if (!walk(next, to, tolerances, surfaces, {}).converged()) continue;
    ++converged;
    EXPECT_LT(max_abs(constraint(Form::slope, next, 1)), 1e-9);
    chain = next;
    targets = constraints(Form::slope, chain);
    targets[0] = {};  // not the residual: errors would add up
  }
  EXPECT_GT(converged, tries / 2);
}

std::optional<PreparedChain> prepared(const Chain& chain, double gamma = 0.5) {
  return prepare(chain, std::vector<double>(chain.inner_count(), 0.3), kToFilm, {gamma, 40});
}

TEST(HalfVectorProposal, IsGaussianOfItsPrecision) {
  rng::Stream stream(rng::key(46, 13));
  const SimpleSurfaces surfaces = two_vertex_surfaces();
  const auto from = prepared(near_specular(stream, surfaces));
  ASSERT_TRUE(from);
  // The mean of -log density of a Gaussian of two pairs is its entropy, 4 (log 2 pi + 1) / 2 - log |L| / 2.
  constexpr int kDraws = 20000;
  double sum = 0;
  for (int n = 0; n < kDraws; ++n) {
    const std::vector<Pair> z{normal_pair(stream.next_double(), stream.next_double()),
                              normal_pair(stream.next_double(), stream.next_double())};
    sum -= log_pdf_slopes(*from, propose_slopes(*from, z));
  }
  const double entropy = 2 * (std::log(2 * std::acos(-1.0)) + 1) -
                         0.5 * std::log(det(from->precisions[0]) * det(from->precisions[1]));
  EXPECT_NEAR(sum / kDraws, entropy, 5 * std::sqrt(2.0 / kDraws));
}

TEST(HalfVectorProposal, HoldsSpecularSlopesAtZero) {
  rng::Stream stream(rng::key(46, 14));
  const SimpleSurfaces surfaces = two_vertex_surfaces();
  const auto from = prepare(near_specular(stream, surfaces), {0, 0.3}, kToFilm, {});
  ASSERT_TRUE(from);
  const std::vector<Pair> to = propose_slopes(*from, std::vector<Pair>{{1, 2}, {0.5, -1}});
  EXPECT_EQ(to[0], Pair{});
  std::vector<Pair> moved = to;
  moved[0] = {0.1, 0.1};  // is in no density
  EXPECT_EQ(log_pdf_slopes(*from, to), log_pdf_slopes(*from, moved));
}

// Gauss' density of d, literally.
double gauss(Pair d, const Mat2& precision) {
  return std::sqrt(det(precision)) / (2 * std::acos(-1.0)) * std::exp(-0.5 * dot(d, precision * d));
}

TEST(HalfVectorProposal, QuotientOfAWalkIsThatOfItsParts) {
  rng::Stream stream(rng::key(46, 16));
  const SimpleSurfaces surfaces = two_vertex_surfaces();
  int compared = 0;
  for (int n = 0; n < 100; ++n) {
    const auto from = prepared(near_specular(stream, surfaces));
    if (!from) continue;
    Chain moved = from->chain;
    const std::vector<Pair> slopes =
        propose_slopes(*from, std::vector<Pair>{normals(stream), normals(stream)});
    if (!walk(moved, slopes, std::vector<double>(2, 1e-10), surfaces, {}).converged()) continue;
    const auto to = prepared(moved);
    if (!to) continue;
    const auto half = [](const PreparedChain& chain) {
      double f = 1;
      for (std::size_t i = 0; i < 3; ++i) f *= geometry_term(chain.chain, i);
      Dense inverted;
      return f / std::abs(invert(dense(chain.blocks), inverted));
    };
    const auto density = [](const PreparedChain& a, const PreparedChain& b) {
      return gauss(b.slopes[0] - a.slopes[0], a.precisions[0]) *
             gauss(b.slopes[1] - a.slopes[1], a.precisions[1]);
    };
    const double expected = half(*to) * density(*to, *from) / (half(*from) * density(*from, *to));
    EXPECT_NEAR(log_quotient_walk(*from, *to), std::log(expected), 1e-7);
    EXPECT_NEAR(log_quotient_walk(*from, *to), -log_quotient_walk(*to, *from), 1e-9);
    ++compared;
  }
  EXPECT_GT(compared, 50);
}

TEST(HalfVectorOneStep, DensityIsThatOfTheMap) {
  rng::Stream stream(rng::key(46, 15));
  const SimpleSurfaces surfaces = two_vertex_surfaces();
  int compared = 0;
  for (int n = 0; n < 200; ++n) {
    const auto from = prepared(near_specular(stream, surfaces), 0.2);
    if (!from) continue;
    const std::vector<Pair> slopes =
        propose_slopes(*from, std::vector<Pair>{normals(stream), normals(stream)});
    Chain to;
    if (!propose_one_step(*from, slopes, surfaces, to) || fault_of(to) != Fault::none) continue;
    std::vector<Pair> recovered;
    const auto log_pdf = log_pdf_one_step_area(*from, to, &recovered);
    ASSERT_TRUE(log_pdf);
    for (std::size_t i = 0; i < 2; ++i) EXPECT_LT(max_abs(recovered[i] - slopes[i]), 1e-9);
    // d(to) / d(slopes) by differences, in the tangent planes of `to`.
    const double h = 1e-6;
    Dense jacobian(4, std::vector<double>(4)), inverted;
    bool whole = true;
    for (std::size_t column = 0; column < 4; ++column) {
      Chain ends[2];
      for (int side = 0; side < 2; ++side) {
        std::vector<Pair> moved = slopes;
        (column % 2 == 0 ? moved[column / 2].x : moved[column / 2].y) += side == 0 ? h : -h;
        whole = propose_one_step(*from, moved, surfaces, ends[side]) && whole;
      }
      for (std::size_t i = 0; whole && i < 2; ++i) {
        const ChainVertex& v = to.vertices[i + 1];
        const Vec3d d = (ends[0].vertices[i + 1].x - ends[1].vertices[i + 1].x) / (2 * h);
        jacobian[2 * i][column] = dot(d, v.p_u);
        jacobian[2 * i + 1][column] = dot(d, v.p_v);
      }
    }
    if (!whole) continue;
    const double expected = log_pdf_slopes(*from, slopes) - std::log(std::abs(invert(jacobian, inverted)));
    EXPECT_NEAR(*log_pdf, expected, 1e-5);
    ++compared;
  }
  EXPECT_GT(compared, 100);
}

// ---- a surface of eight facets ----

class Roof final : public Surfaces {
 public:
  static constexpr std::size_t kFacets = 8;
  static double x_at(std::size_t i) { return -1.2 + 0.3 * static_cast<double>(i); }
  static constexpr std::array<double, kFacets + 1> kHeights{0,    0.05, -0.02, 0.07, 0.0,
                                                            0.06, 0.01, 0.04,  -0.03};

  void set(std::size_t facet, double along, double y, ChainVertex& v) const {
    const double dx = 0.3, dz = kHeights[facet + 1] - kHeights[facet];
    v.x = {x_at(facet) + along * dx, y, kHeights[facet] + along * dz};
    v.n = v.ng = normalize(Vec3d{-dz, 0, dx});
    v.p_u = normalize(Vec3d{dx, 0, dz});
    v.p_v = {0, 1, 0};
    v.n_u = v.n_v = {};
    v.scatter = Scatter::reflect;
  }
  static std::size_t facet_of(double x) {
    return static_cast<std::size_t>(std::clamp((x + 1.2) / 0.3, 0.0, 7.999999));
  }
  bool meet(std::size_t /*i*/, const ChainVertex& start, Vec3d towards, ChainVertex& out) const override {
    const Vec3d from = start.x;
    const Vec3d d = normalize(towards - from);
    double nearest = HUGE_VAL;
    ChainVertex found;
    for (std::size_t facet = 0; facet < kFacets; ++facet) {
      ChainVertex v;
      set(facet, 0, 0, v);
      const double fall = dot(d, v.n);
      if (std::abs(fall) < 1e-12) continue;
      const double t = dot(v.x - from, v.n) / fall;
      const Vec3d p = from + d * t;
      if (!(t > 1e-9) || t >= nearest || p.x < x_at(facet) || p.x >= x_at(facet + 1)) continue;
      nearest = t;
      set(facet, (p.x - x_at(facet)) / 0.3, p.y, found);
    }
    if (!(nearest < HUGE_VAL) || std::abs(found.x.y) >= 1) return false;
    out = found;
    return true;
  }
};

constexpr double kRoofAlpha = 0.18;

Chain roof_chain(const Roof& roof, std::size_t facet, double along, double y) {
  Chain chain;
  chain.vertices.resize(3);
  roof.set(facet, along, y, chain.vertices[1]);
  chain.vertices[0] = end_at({1.2, 0.3, 1.6}, chain.vertices[1].x);
  chain.vertices[2] = end_at({-1.3, -0.2, 1.4}, chain.vertices[1].x);
  return chain;
}

// The value of a Beckmann lobe without masking, and the path's contribution in area measure.
double lobe(const Chain& chain) {
  if (fault_of(chain) != Fault::none) return 0;
  const Vec3d i = chain.to_light(1), o = chain.to_sensor(1), n = chain.vertices[1].n;
  const double c2 = std::pow(dot(normalize(i + o), n), 2);
  const double d = std::exp(-(1 - c2) / (c2 * kRoofAlpha * kRoofAlpha)) / (kRoofAlpha * kRoofAlpha * c2 * c2);
  return d / std::abs(dot(i, n) * dot(o, n));
}
double target(const Chain& chain) {
  return lobe(chain) * geometry_term(chain, 0) * geometry_term(chain, 1);
}

struct Facets {
  std::array<double, Roof::kFacets> share{};
  std::vector<Chain> points;
  std::vector<double> cumulative;
  double length(std::size_t f) const { return std::hypot(0.3, Roof::kHeights[f + 1] - Roof::kHeights[f]); }
};
Facets quadrature(const Roof& roof) {
  Facets out;
  double sum = 0;
  constexpr int kAcross = 60, kAlong = 200;
  for (std::size_t f = 0; f < Roof::kFacets; ++f)
    for (int i = 0; i < kAcross; ++i)
      for (int j = 0; j < kAlong; ++j) {
        const Chain chain = roof_chain(roof, f, (i + 0.5) / kAcross, (j + 0.5) / kAlong * 2 - 1);
        const double w = target(chain) * out.length(f);
        out.share[f] += w;
        sum += w;
        out.points.push_back(chain);
        out.cumulative.push_back(sum);
      }
  for (double& share : out.share) share /= sum;
  return out;
}

std::optional<PreparedChain> prepared_roof(const Chain& chain) {
  return prepare(chain, {kRoofAlpha}, kToFilm, {1.5, 1e6});
}

// One mutation; `next` is the state after it.
bool mutate_by_walk(const PreparedChain& from, const Roof& roof, rng::Stream& stream, PreparedChain& next) {
  const std::vector<double> tolerances{1e-9};
  const std::vector<Pair> to = propose_slopes(from, std::vector<Pair>{normals(stream)});
  const double u = stream.next_double();
  Chain moved = from.chain;
  if (!walk(moved, to, tolerances, roof, {}).converged()) return false;
  if (!returns(moved, from.chain, from.slopes, tolerances, roof, {})) return false;
  const auto there = prepared_roof(moved);
  if (!there) return false;
  if (!(std::log(u) < std::log(lobe(moved) / lobe(from.chain)) + log_quotient_walk(from, *there)))
    return false;
  next = *there;
  return true;
}
bool mutate_by_one_step(const PreparedChain& from, const Roof& roof, rng::Stream& stream,
                        PreparedChain& next) {
  const std::vector<Pair> to = propose_slopes(from, std::vector<Pair>{normals(stream)});
  const double u = stream.next_double();
  Chain moved;
  if (!propose_one_step(from, to, roof, moved)) return false;
  const auto there = prepared_roof(moved);
  if (!there) return false;
  const auto quotient = log_quotient_one_step(from, *there);
  if (!quotient || !(std::log(u) < std::log(lobe(moved) / lobe(from.chain)) + *quotient)) return false;
  next = *there;
  return true;
}

// Chains start from the target's density, run, and have to keep it: the p-value of the shares of facets, from
// the spread of chains. A tenth of the mutations are independent samples.
template <class Mutate>
double p_of_chains(const Mutate& mutate, std::uint64_t seed) {
  const Roof roof;
  const Facets facets = quadrature(roof);
  constexpr std::size_t kChains = 1500, kMutations = 100, kFacets = Roof::kFacets;
  rng::Stream stream(rng::key(46, seed));
  std::vector<std::array<double, kFacets>> shares;
  for (std::size_t n = 0; n < kChains; ++n) {
    const double u = stream.next_double() * facets.cumulative.back();
    const auto at = std::lower_bound(facets.cumulative.begin(), facets.cumulative.end(), u);
    auto state = prepared_roof(facets.points[static_cast<std::size_t>(at - facets.cumulative.begin())]);
    if (!state) continue;
    auto& share = shares.emplace_back();
    for (std::size_t m = 0; m < kMutations; ++m) {
      if (stream.next_double() < 0.1) {
        double pick = stream.next_double() * 8;
        const auto facet = static_cast<std::size_t>(pick);
        const double v = stream.next_double() * 2 - 1, accept = stream.next_double();
        const Chain drawn = roof_chain(roof, facet, pick - static_cast<double>(facet), v);
        // Facets are drawn evenly, whatever their length.
        const std::size_t here = Roof::facet_of(state->chain.vertices[1].x.x);
        const double ratio =
            target(drawn) * facets.length(facet) / (target(state->chain) * facets.length(here));
        if (accept < ratio)
          if (auto next = prepared_roof(drawn)) state = std::move(next);
      } else {
        PreparedChain next;
        if (mutate(*state, roof, stream, next)) state = std::move(next);
      }
      share[Roof::facet_of(state->chain.vertices[1].x.x)] += 1.0 / kMutations;
    }
  }
  // Hotelling's statistic of all facets but the largest, by the covariance of chain means.
  const auto count = static_cast<double>(shares.size());
  std::vector<std::size_t> used;
  const std::size_t largest = static_cast<std::size_t>(
      std::max_element(facets.share.begin(), facets.share.end()) - facets.share.begin());
  for (std::size_t f = 0; f < kFacets; ++f)
    if (f != largest && facets.share[f] > 1e-3) used.push_back(f);
  std::vector<double> off(used.size());
  Dense covariance(used.size(), std::vector<double>(used.size())), inverted;
  for (std::size_t a = 0; a < used.size(); ++a) {
    for (const auto& share : shares) off[a] += (share[used[a]] - facets.share[used[a]]) / count;
  }
  for (std::size_t a = 0; a < used.size(); ++a)
    for (std::size_t b = 0; b < used.size(); ++b)
      for (const auto& share : shares)
        covariance[a][b] += (share[used[a]] - facets.share[used[a]] - off[a]) *
                            (share[used[b]] - facets.share[used[b]] - off[b]) / (count * (count - 1));
  invert(covariance, inverted);
  double statistic = 0;
  for (std::size_t a = 0; a < used.size(); ++a)
    for (std::size_t b = 0; b < used.size(); ++b) statistic += off[a] * inverted[a][b] * off[b];
  return statistical::chi_squared_tail(statistic, static_cast<int>(used.size()));
}

TEST(HalfVectorChains, WalksKeepTheDensity) {
  EXPECT_GT(p_of_chains(mutate_by_walk, 20), 1e-4);
}

TEST(HalfVectorChains, OneStepMutationsKeepTheDensity) {
  EXPECT_GT(p_of_chains(mutate_by_one_step, 21), 1e-4);
}

}  // namespace
}  // namespace candela
