// Claims: mutations of half vectors change nothing but the inner vertices of a path; their densities,
// computed from the two paths alone, are those of their proposals.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "tests/unit/manifold_chains.h"
#include "tests/unit/path_walks.h"
#include "worker/core/math.h"
#include "worker/mcmc/mutators/half_vector.h"
#include "worker/scene/points/surface_points.h"

namespace candela::mcmc {
namespace {

namespace path = transport::path;
using path::Kind;

// log of f(to) T(to -> from) / (f(from) T(from -> to)). Nothing: one of the densities is zero.
std::optional<double> log_acceptance(const PathMutator& mutator, const PathState& from, const PathState& to) {
  const auto forward = mutator.log_pdf_area(from, to), back = mutator.log_pdf_area(to, from);
  if (!forward || !back) return std::nullopt;
  return math::log(to.scalar) - math::log(from.scalar) + *back - *forward;
}

// States of `inner` vertices, none of them specular, that the mutation suits.
std::vector<PathState> states(const scene::Scene& scene, const PathMutator& mutator, std::size_t inner,
                              std::size_t count) {
  std::vector<PathState> found;
  rng::Stream stream(rng::key(46, 300));
  for (int n = 0; n < 20000 && found.size() < count; ++n)
    path::walk(scene, stream, [&](const path::WalkedPath& walked) {
      if (walked.path.inner.size() != inner || found.size() == count) return;
      const auto named = path::canonical(scene, walked.path, walked.u_lens);
      if (!named) return;
      for (const path::PathVertex& v : named->vertices)
        if (v.delta) return;
      auto state = path_state(scene, *named);
      if (state && mutator.suitability(*state) > 0) found.push_back(*std::move(state));
    });
  return found;
}

double area_element(const scene::Scene& scene, const scene::CanonicalPoint& point) {
  const scene::SurfaceGeometry at = scene.points().at(point);
  return length(cross(at.dp_du, at.dp_dv));
}

bool on_same_surfaces(const path::Path& a, const path::Path& b) {
  for (std::size_t i = 1; i + 1 < a.vertices.size(); ++i) {
    const scene::CanonicalPoint &p = a.vertices[i].point, &q = b.vertices[i].point;
    if (p.primitive != q.primitive || p.kind != q.kind || p.instance != q.instance) return false;
  }
  return true;
}
// The parameters of the vertices of a range, from those of `middle`.
std::vector<double> offset(const path::Path& middle, const path::Path& to, path::PathRange range) {
  std::vector<double> out;
  for (std::size_t i = range.begin; i < range.end; ++i) {
    out.push_back(to.vertices[i].point.u - middle.vertices[i].point.u);
    out.push_back(to.vertices[i].point.v - middle.vertices[i].point.v);
  }
  return out;
}
double quadratic(const test::Dense& m, const std::vector<double>& v) {
  double sum = 0;
  for (std::size_t i = 0; i < v.size(); ++i)
    for (std::size_t j = 0; j < v.size(); ++j) sum += v[i] * m[i][j] * v[j];
  return sum;
}

// The mean of 1 / T over proposals within a set of paths is the volume of the set: of an ellipsoid of
// parameters, by the spread of proposals. False: not all paths of it carry light, so that T is not known
// there. moves: the vertices that the mutation moves.
bool check_density(const scene::Scene& scene, const PathMutator& mutator, const PathState& from,
                   path::PathRange moves, std::uint64_t seed) {
  rng::Stream stream(rng::key(46, seed));
  const std::size_t size = 2 * (moves.end - moves.begin);
  test::Dense spread(size, std::vector<double>(size)), inverse;
  double used = 0;
  for (int n = 0; n < 400; ++n) {
    const auto to = mutator.propose(from, stream);
    if (!to || !on_same_surfaces(from.path, *to)) continue;
    const std::vector<double> d = offset(from.path, *to, moves);
    for (std::size_t i = 0; i < size; ++i)
      for (std::size_t j = 0; j < size; ++j) spread[i][j] += d[i] * d[j];
    ++used;
  }
  if (used < 300) return false;
  for (auto& row : spread)
    for (double& entry : row) entry /= used;
  const double determinant = test::invert(spread, inverse);
  constexpr double kRadius2 = 1.5;
  const double pi = std::acos(-1.0);
  const double volume =
      (size == 2 ? pi * kRadius2 : pi * pi / 2 * kRadius2 * kRadius2) * std::sqrt(determinant);
  double sum = 0, squares = 0;
  int inside = 0;
  constexpr int kProposals = 3000;
  for (int n = 0; n < kProposals; ++n) {
    const auto to = mutator.propose(from, stream);
    if (!to) continue;
    EXPECT_EQ(to->vertices.front(), from.path.vertices.front());
    EXPECT_EQ(to->vertices.back(), from.path.vertices.back());
    for (std::size_t i = 0; i < to->vertices.size(); ++i)
      EXPECT_TRUE((i >= moves.begin && i < moves.end) || to->vertices[i] == from.path.vertices[i]);
    if (!on_same_surfaces(from.path, *to) || quadratic(inverse, offset(from.path, *to, moves)) > kRadius2)
      continue;
    const auto there = path_state(scene, *to);
    if (!there) return false;
    const auto forward = mutator.log_pdf_area(from, *there), back = mutator.log_pdf_area(*there, from);
    EXPECT_TRUE(forward && back);
    if (!forward || !back) return true;
    EXPECT_TRUE(log_acceptance(mutator, from, *there));
    ++inside;
    double area = volume;
    for (std::size_t i = moves.begin; i < moves.end; ++i) area *= area_element(scene, to->vertices[i].point);
    sum += std::exp(-*forward) / area;
    squares += std::exp(-2 * *forward) / (area * area);
  }
  const double mean = sum / kProposals, error = std::sqrt((squares / kProposals - mean * mean) / kProposals);
  EXPECT_GT(inside, 200);
  EXPECT_LT(error, 0.08);
  EXPECT_NEAR(mean, 1, 5 * error + 1e-3);
  return true;
}

TEST(HalfVectorMutators, HaveTheDensityOfTheirProposals) {
  const auto scene = path::scene_of(path::cases()[4]);  // a point light: its end is held
  std::uint64_t seed = 310;
  for (const bool one_step : {true, false}) {
    const HalfVectorMutator mutator(*scene, {one_step, {0.1, 1}});
    SCOPED_TRACE(std::string(mutator.name()));
    for (const std::size_t inner : {1u, 2u}) {
      SCOPED_TRACE(inner);
      int checked = 0;
      for (const PathState& state : states(*scene, mutator, inner, 12))
        checked += checked < 3 && check_density(*scene, mutator, state, {1, inner + 1}, ++seed);
      EXPECT_EQ(checked, 3);
    }
  }
}

// Between diffuse vertices: these, and all beyond them, stay.
TEST(HalfVectorMutators, SegmentsHaveTheDensityOfTheirProposals) {
  const auto scene = path::scene_of(path::cases()[4]);
  std::uint64_t seed = 350;
  for (const bool one_step : {true, false}) {
    const HalfVectorMutator mutator(*scene, {one_step, {0.1, 1}, true});
    SCOPED_TRACE(std::string(mutator.name()));
    int checked = 0;
    for (const PathState& state : states(*scene, mutator, 3, 40)) {
      // One segment, of which all vertices move together.
      rng::Stream stream(rng::key(46, ++seed));
      std::optional<path::PathRange> moves;
      bool one = true;
      for (int n = 0; n < 30; ++n) {
        const auto to = mutator.propose(state, stream);
        if (!to) continue;
        const path::PathRange range = path::changed_range(state.path, *to);
        one = one && (!moves || (moves->begin == range.begin && moves->end == range.end));
        moves = range;
      }
      if (!moves || !one || moves->end == moves->begin || moves->end - moves->begin == 3 || checked == 3)
        continue;
      checked += check_density(*scene, mutator, state, *moves, seed + 100);
    }
    EXPECT_EQ(checked, 3);
  }
}

// A path through glass: the walk has a density in both directions, the one-step mutation does not suit.
TEST(HalfVectorMutators, WalksKeepSpecularVertices) {
  const auto scene = path::scene_of(path::cases()[0]);
  const HalfVectorMutator walks(*scene, {false, {0.1, 1}}), one_step(*scene, {true, {0.1, 1}});
  rng::Stream stream(rng::key(46, 330));
  int mutated = 0;
  for (int n = 0; n < 3000 && mutated < 30; ++n)
    path::walk(*scene, stream, [&](const path::WalkedPath& walked) {
      const auto named = path::canonical(*scene, walked.path, walked.u_lens);
      if (!named || mutated == 30) return;
      if (std::none_of(named->vertices.begin(), named->vertices.end(),
                       [](const path::PathVertex& v) { return v.delta; }))
        return;
      const auto from = path_state(*scene, *named);
      if (!from || walks.suitability(*from) == 0) return;
      EXPECT_EQ(one_step.suitability(*from), 0);
      const auto to = walks.propose(*from, stream);
      if (!to) return;
      for (std::size_t i = 0; i < to->vertices.size(); ++i)
        EXPECT_EQ(to->vertices[i].delta, named->vertices[i].delta);
      const auto there = path_state(*scene, *to);
      if (!there) return;
      const auto ratio = log_acceptance(walks, *from, *there);
      ASSERT_TRUE(ratio);
      EXPECT_TRUE(std::isfinite(*ratio));
      ++mutated;
    });
  EXPECT_EQ(mutated, 30);
}

}  // namespace
}  // namespace candela::mcmc
