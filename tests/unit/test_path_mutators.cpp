// Claims: mutations of half vectors change nothing but the inner vertices of a path; their densities,
// computed from the two paths alone, are those of their proposals.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "tests/unit/path_walks.h"
#include "worker/mcmc/mutators/half_vector.h"
#include "worker/scene/points/surface_points.h"

namespace candela::mcmc {
namespace {

namespace path = transport::path;
using path::Kind;

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

// The area of a small box of parameters around a point, and whether a point is in it.
struct Box {
  scene::CanonicalPoint middle;
  double u = 0, v = 0;  // half its extents
  bool contains(const scene::CanonicalPoint& p) const {
    return p.primitive == middle.primitive && p.kind == middle.kind && p.instance == middle.instance &&
           std::abs(p.u - middle.u) < u && std::abs(p.v - middle.v) < v;
  }
  double area(const scene::Scene& scene) const {
    constexpr int kSteps = 16;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i)
      for (int j = 0; j < kSteps; ++j) {
        scene::CanonicalPoint p = middle;
        p.u += u * ((2 * i + 1.0) / kSteps - 1);
        p.v += v * ((2 * j + 1.0) / kSteps - 1);
        sum += area_element(scene, p);
      }
    return sum * 4 * u * v / (kSteps * kSteps);
  }
};

// The mean of 1 / T over proposals in a set of paths is the volume of the set.
void check_density(const scene::Scene& scene, const PathMutator& mutator, const PathState& from,
                   std::uint64_t seed) {
  rng::Stream stream(rng::key(46, seed));
  const std::size_t inner = from.path.inner_count();
  std::vector<Box> boxes(inner);
  std::vector<std::vector<double>> steps_u(inner), steps_v(inner);
  for (int n = 0; n < 200; ++n) {
    const auto to = mutator.propose(from, stream);
    if (!to) continue;
    for (std::size_t i = 0; i < inner; ++i) {
      const scene::CanonicalPoint &a = from.path.vertices[i + 1].point, &b = to->vertices[i + 1].point;
      if (a.primitive != b.primitive || a.kind != b.kind || a.instance != b.instance) continue;
      steps_u[i].push_back(std::abs(a.u - b.u));
      steps_v[i].push_back(std::abs(a.v - b.v));
    }
  }
  double volume = 1;
  for (std::size_t i = 0; i < inner; ++i) {
    ASSERT_GT(steps_u[i].size(), 50u);
    const auto median = [](std::vector<double>& steps) {
      std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2),
                       steps.end());
      return steps[steps.size() / 2];
    };
    boxes[i] = {from.path.vertices[i + 1].point, median(steps_u[i]), median(steps_v[i])};
    volume *= boxes[i].area(scene);
  }
  double sum = 0, squares = 0;
  int inside = 0;
  constexpr int kProposals = 4000;
  for (int n = 0; n < kProposals; ++n) {
    const auto to = mutator.propose(from, stream);
    if (!to) continue;
    EXPECT_EQ(to->vertices.front(), from.path.vertices.front());
    EXPECT_EQ(to->vertices.back(), from.path.vertices.back());
    bool in = true;
    for (std::size_t i = 0; i < inner; ++i) in = in && boxes[i].contains(to->vertices[i + 1].point);
    if (!in) continue;
    const auto there = path_state(scene, *to);
    ASSERT_TRUE(there);  // so near, every path carries light
    const auto forward = mutator.log_pdf_area(from, *there), back = mutator.log_pdf_area(*there, from);
    ASSERT_TRUE(forward && back);
    EXPECT_TRUE(log_acceptance(mutator, from, *there));
    ++inside;
    sum += std::exp(-*forward) / volume;
    squares += std::exp(-2 * *forward) / (volume * volume);
  }
  const double mean = sum / kProposals, error = std::sqrt((squares / kProposals - mean * mean) / kProposals);
  EXPECT_GT(inside, 100);
  EXPECT_LT(error, 0.12);
  EXPECT_NEAR(mean, 1, 5 * error + 1e-3);
}

TEST(HalfVectorMutators, HaveTheDensityOfTheirProposals) {
  const auto scene = path::scene_of(path::cases()[4]);  // a point light: its end is held
  std::uint64_t seed = 310;
  for (const bool one_step : {true, false}) {
    const HalfVectorMutator mutator(*scene, {one_step, {0.1, 1}});
    SCOPED_TRACE(std::string(mutator.name()));
    for (const std::size_t inner : {1u, 2u}) {
      SCOPED_TRACE(inner);
      const std::vector<PathState> from = states(*scene, mutator, inner, 3);
      ASSERT_EQ(from.size(), 3u);
      for (const PathState& state : from) check_density(*scene, mutator, state, ++seed);
    }
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
