// Claims: blocks are the derivatives of the constraint along the surfaces themselves; factors solve what
// dense algebra solves; the pencil is the generalized geometric term from both ends; frames are orthonormal,
// and the spin is theirs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/unit/manifold_chains.h"
#include "tests/unit/manifold_geometry.h"
#include "worker/transport/manifold/block_tridiagonal.h"

namespace candela {
namespace {

using namespace test;  // NOLINT(google-build-using-namespace)

constexpr FirstEnd kEnds[] = {FirstEnd::point, FirstEnd::direction, FirstEnd::surface};

TEST(HalfVectorFrame, SpinIsThatOfTheFrame) {
  rng::Stream stream(rng::key(46, 1));
  for (int i = 0; i < 1000; ++i) {
    const Vec3d n = direction(stream);
    if (1 + dot(n, kPole) < 1e-2) continue;
    const auto [s, t] = pole_frame(n);
    EXPECT_NEAR(length(s), 1, 1e-12);
    EXPECT_NEAR(dot(s, t), 0, 1e-12);
    EXPECT_LT(length(cross(s, t) - n), 1e-12);  // right-handed
    Vec3d dn = normal_vector(stream);
    dn = dn - n * dot(n, dn);
    const double h = 1e-6;
    const Vec3d ds = (pole_frame(normalize(n + dn * h)).s - pole_frame(normalize(n - dn * h)).s) / (2 * h);
    const double k = spin(n, dn);
    EXPECT_NEAR(dot(t, ds), k, 1e-7 * (1 + std::abs(k)) / (1 + dot(n, kPole)));
  }
}

// Column u or v of the derivative of constraint i by vertex j.
Pair difference(Form form, const RandomChain& random, std::size_t i, std::size_t j, bool second) {
  const double h = 1e-5;
  const auto moved = [&](double by) {
    Chain chain = random.chain;
    const ChainVertex at = random.surfaces[j]->at(second ? 0 : by, second ? by : 0);
    chain.vertices[j].x = at.x;
    chain.vertices[j].n = at.n;
    chain.vertices[j].ng = at.ng;
    return constraint(form, chain, i);
  };
  return (moved(h) - moved(-h)) * (1 / (2 * h));
}

TEST(HalfVectorBlocks, AreTheDerivatives) {
  rng::Stream stream(rng::key(46, 2));
  double worst = 0;
  for (std::size_t n = 0; n < 300; ++n) {
    const RandomChain random = random_chain(stream, 1 + n % 4, kEnds[n % 3]);
    for (const Form form : {Form::slope, Form::disk})
      for (std::size_t i = 1; i <= random.chain.inner_count(); ++i) {
        const Blocks b = blocks(form, random.chain, i);
        for (std::size_t j = i - 1; j <= i + 1; ++j) {
          const Mat2& m = j < i ? b.a : j == i ? b.b : b.c;
          const Pair u = difference(form, random, i, j, false), v = difference(form, random, i, j, true);
          const Mat2 off = m - Mat2{u.x, v.x, u.y, v.y};
          worst = std::max(worst, std::sqrt(norm_squared(off) / std::max(1.0, norm_squared(m))));
        }
      }
  }
  EXPECT_LT(worst, 3e-7);
}

TEST(HalfVectorSolve, IsThatOfTheDenseMatrix) {
  rng::Stream stream(rng::key(46, 3));
  for (std::size_t n = 0; n < 200; ++n) {
    const RandomChain random = random_chain(stream, 1 + n % 4, kEnds[n % 3]);
    const std::vector<Blocks> all = blocks(Form::slope, random.chain);
    BlockTridiagonal factored;
    ASSERT_TRUE(factored.factor(all));
    Dense inverted;
    const double determinant = invert(dense(all), inverted);
    EXPECT_NEAR(factored.det() / determinant, 1, 1e-9);
    double largest = 0;
    for (const auto& row : inverted)
      for (const double value : row) largest = std::max(largest, std::abs(value));
    const std::size_t m = all.size();
    std::vector<Pair> r;
    for (std::size_t i = 0; i < m; ++i) r.push_back(normals(stream));
    const std::vector<Pair> x = factored.solve(r), back = multiply(all, x);
    const auto d = factored.last_vertex_by_constraints(), t = factored.by_last_end();
    for (std::size_t i = 0; i < m; ++i) {
      EXPECT_LT(max_abs(back[i] - r[i]), 1e-8);
      const auto entry = [&](std::size_t row, std::size_t column) {
        return Mat2{inverted[2 * row][2 * column], inverted[2 * row][2 * column + 1],
                    inverted[2 * row + 1][2 * column], inverted[2 * row + 1][2 * column + 1]};
      };
      EXPECT_LT(std::sqrt(norm_squared(d[i] - entry(m - 1, i))), 1e-8 * largest);
      const Mat2 expected = -(entry(i, m - 1) * all.back().c);
      EXPECT_LT(std::sqrt(norm_squared(t[i] - expected)), 1e-8 * std::max(1.0, largest));
    }
  }
}

TEST(HalfVectorSolve, RefusesASingularBlock) {
  Blocks b;
  b.b = {1, 2, 2, 4};
  BlockTridiagonal factored;
  EXPECT_FALSE(factored.factor(std::vector<Blocks>{b}));
  EXPECT_FALSE(factored.factor(std::vector<Blocks>{Blocks{}}));
}

Chain reversed(const Chain& chain) {
  Chain out;
  out.first = FirstEnd::surface;
  out.vertices.assign(chain.vertices.rbegin(), chain.vertices.rend());
  for (ChainVertex& v : out.vertices) v.eta = 1 / v.eta;
  return out;
}

TEST(HalfVectorContribution, IsTheProductOverTheJacobian) {
  rng::Stream stream(rng::key(46, 4));
  for (std::size_t n = 0; n < 300; ++n) {
    const RandomChain random = random_chain(stream, 1 + n % 4, kEnds[n % 3]);
    const Chain& chain = random.chain;
    for (const Form form : {Form::slope, Form::disk}) {
      BlockTridiagonal factored;
      ASSERT_TRUE(factored.factor(blocks(form, chain)));
      double product = 1;
      for (std::size_t i = 0; i <= chain.inner_count(); ++i) product *= geometry_term(chain, i);
      EXPECT_NEAR(std::exp(log_contribution(form, chain)) * std::abs(factored.det()) / product, 1, 1e-8);
      EXPECT_NEAR(std::exp(log_pencil(chain)) /
                      (geometry_term(chain, 0) * std::abs(det(factored.by_last_end().front()))),
                  1, 1e-8);
    }
    if (chain.first != FirstEnd::surface) continue;
    // From the sensor: the product of a walk's cosines has the other normal at each end of an edge.
    const Chain back = reversed(chain);
    ASSERT_EQ(fault_of(back), Fault::none);
    double ratio = 1;
    for (std::size_t i = 0; i <= chain.inner_count(); ++i) {
      const ChainVertex &a = chain.vertices[i], &b = chain.vertices[i + 1];
      const Vec3d w = normalize(b.x - a.x);
      ratio *= std::abs(dot(w, a.n) * dot(w, b.ng) / (dot(w, a.ng) * dot(w, b.n)));
    }
    EXPECT_NEAR(log_contribution(Form::slope, chain) - log_contribution(Form::slope, back), std::log(ratio),
                1e-8);
  }
}

// The constraint of a reversed path is the same.
TEST(HalfVectorConstraint, DoesNotKnowTheDirectionOfThePath) {
  rng::Stream stream(rng::key(46, 5));
  for (std::size_t n = 0; n < 100; ++n) {
    const RandomChain random = random_chain(stream, 3, FirstEnd::surface);
    const Chain back = reversed(random.chain);
    for (std::size_t i = 1; i <= 3; ++i)
      for (const Form form : {Form::slope, Form::disk})
        EXPECT_LT(max_abs(constraint(form, random.chain, i) - constraint(form, back, 4 - i)), 1e-11);
  }
}

// Two walls whose vertices are a hundred thousandth from their common edge.
TEST(HalfVectorContribution, KeepsItsDigitsInACorner) {
  const double e = 1e-5;
  Chain chain;
  chain.vertices.resize(4);
  const Vec3d places[] = {{1, 0.3, 1.2}, {e, 0, 0}, {0, 0.3 * e, 0.7 * e}, {1.3, -0.2, 0.8}};
  const Vec3d normals[] = {places[1] - places[0], {0, 0, 1}, {1, 0, 0}, places[2] - places[3]};
  double product = 1;
  for (std::size_t i = 0; i < 4; ++i) {
    ChainVertex& v = chain.vertices[i];
    v.x = places[i];
    v.n = v.ng = normalize(normals[i]);
    set_tangents(v, v.n);
    v.scatter = i == 1 || i == 2 ? Scatter::reflect : Scatter::end;
  }
  for (std::size_t i = 0; i < 3; ++i) product *= geometry_term(chain, i);
  BlockTridiagonal factored;
  ASSERT_TRUE(factored.factor(blocks(Form::slope, chain)));
  EXPECT_NEAR(std::exp(log_contribution(Form::slope, chain)) * std::abs(factored.det()) / product, 1, 1e-8);
}

TEST(HalfVectorFaults, AreNamed) {
  rng::Stream stream(rng::key(46, 6));
  const Chain good = random_chain(stream, 2, FirstEnd::point).chain;
  EXPECT_EQ(fault_of(good), Fault::none);
  Chain bad = good;
  bad.vertices[1].scatter =
      good.vertices[1].scatter == Scatter::reflect ? Scatter::refract : Scatter::reflect;
  EXPECT_EQ(fault_of(bad), Fault::side);
  bad = good;
  bad.vertices[2].x = good.vertices[1].x;
  EXPECT_EQ(fault_of(bad), Fault::coincident);
  bad = good;
  bad.vertices[1].n = -kPole;
  EXPECT_EQ(fault_of(bad), Fault::frame);
  bad = good;
  bad.vertices[1].x.x = std::nan("");
  EXPECT_EQ(fault_of(bad), Fault::not_finite);
  bad = good;
  const Vec3d half = bad.to_light(1) + bad.to_sensor(1) * bad.vertices[1].eta;
  bad.vertices[1].n = normalize(cross(half, Vec3d{0.3, 0.1, 0.7}));
  if (!has_pole_frame(bad.vertices[1].n)) bad.vertices[1].n = -bad.vertices[1].n;
  EXPECT_EQ(fault_of(bad), Fault::grazing);
}

}  // namespace
}  // namespace candela
