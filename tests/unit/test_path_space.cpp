// Claims: the bidirectional mutation and the independent paths of the path space have the densities that they
// say, computed from paths alone; what a mutation does can be undone by it, and what it does not declare to
// change is not changed; a chain that goes through bytes is the chain that does not, bit for bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "tests/unit/path_walks.h"
#include "worker/mcmc/mutators/bidirectional.h"
#include "worker/mcmc/path_space.h"
#include "worker/scene/points/surface_points.h"

namespace candela::mcmc {
namespace {

namespace path = transport::path;
using path::Kind;

MutatorContext context_of(const scene::Scene& scene) {
  return {scene, path::kFilm, path::kFilm, 0, 2, 5};
}
std::vector<MutatorShare> bidirectional() {
  return {{&mutators().front(), 1.0}};
}

double area_element(const scene::Scene& scene, const scene::CanonicalPoint& point) {
  const scene::SurfaceGeometry at = scene.points().at(point);
  return length(cross(at.dp_du, at.dp_dv));
}

// States of independent paths with so many inner vertices.
std::vector<PathState> states(PathSpace& space, std::size_t inner, std::size_t count) {
  std::vector<PathState> found;
  SplatList list;
  for (std::uint64_t key = 0; key < 200000 && found.size() < count; ++key) {
    space.start(rng::key(46, 400, key), list);
    if (list.scalar() > 0 && space.present()->path.inner_count() == inner) found.push_back(*space.present());
  }
  return found;
}

constexpr std::size_t kBins = 4;  // along u and v of a triangle's square of parameters
using Cells = std::array<double, kBins * kBins>;

std::size_t cell_of(const scene::CanonicalPoint& point) {
  const auto bin = [](double v) {
    return std::min(static_cast<std::size_t>(std::max(v, 0.0) * kBins), kBins - 1);
  };
  return bin(point.u) * kBins + bin(point.v);
}

// The density of paths that differ from `from` in vertex `i` alone, as it lies on a triangle, integrated over
// cells; log_pdf gives it.
template <class LogPdf>
Cells integrate(const scene::Scene& scene, const MutatorContext& context, const PathState& from,
                std::size_t i, const scene::CanonicalPoint& on, const LogPdf& log_pdf) {
  constexpr int kSub = 24;
  Cells cells{};
  constexpr double kStep = 1.0 / (kBins * kSub);
  for (int a = 0; a < static_cast<int>(kBins) * kSub; ++a)
    for (int b = 0; b < static_cast<int>(kBins) * kSub; ++b) {
      scene::CanonicalPoint point = on;
      point.u = (a + 0.5) * kStep;
      point.v = (b + 0.5) * kStep;
      // Half of a small square may be outside of the triangle: along its long side.
      if (point.u + point.v >= 1) continue;
      path::Path to = from.path;
      to.vertices[i].point = point;
      const auto state = path_state(scene, to, context.rules());
      if (!state) continue;
      if (const auto log_density = log_pdf(*state))
        cells[cell_of(point)] += std::exp(*log_density) * area_element(scene, point) * kStep * kStep;
    }
  return cells;
}

void expect_counts(const Cells& counted, const Cells& expected, double proposals) {
  double chi2 = 0, cells = 0;
  for (std::size_t c = 0; c < counted.size(); ++c) {
    const double mean = expected[c] * proposals;
    if (mean < 20) continue;
    // The integral is known to 1 %, but for edges of shadows.
    chi2 += (counted[c] - mean) * (counted[c] - mean) / (mean + 4e-4 * mean * mean);
    ++cells;
  }
  EXPECT_GE(cells, 2);
  EXPECT_LT(chi2, cells + 5 * std::sqrt(2 * cells) + 5);
}

// Proposals that move one vertex of a path over the wall that it is on.
TEST(PathSpace, BidirectionalMutationsHaveTheirDensity) {
  for (const std::size_t which : {0u, 2u, 4u, 7u}) {
    const path::Case c = path::cases()[which];
    SCOPED_TRACE(c.name);
    const auto scene = path::scene_of(c);
    const MutatorContext context = context_of(*scene);
    PathSpace space(context, bidirectional());
    const BidirectionalMutator mutator(context);
    int tested = 0;
    for (const PathState& from : states(space, 2, 40)) {
      // The vertex next to the light, on a triangle; no other one is specular.
      const auto& v = from.path.vertices;
      if (v[1].delta || v[2].delta || v[1].point.kind != v[2].point.kind) continue;
      const scene::SurfaceHit hit = scene->points().hit(v[1].point);
      if (!(length(hit.ng) > 0) || hit.barycentric.x == 0) continue;
      if (tested == 2) break;
      rng::Stream stream(rng::key(46, 410, tested));
      constexpr int kProposals = 40000;
      Cells counted{};
      for (int n = 0; n < kProposals; ++n) {
        const Proposal to = mutator.propose(from, stream);
        if (!to || to->vertices.size() != v.size()) continue;
        path::Path same = *to;
        const scene::CanonicalPoint moved = to->vertices[1].point;
        if (to->vertices[1].kind != Kind::surface || moved.primitive != v[1].point.primitive ||
            moved.kind != v[1].point.kind || moved.instance != v[1].point.instance)
          continue;
        same.vertices[1].point = v[1].point;
        if (!(same == from.path) || !path_state(*scene, *to, context.rules())) continue;
        ++counted[cell_of(moved)];
      }
      const Cells expected = integrate(*scene, context, from, 1, v[1].point,
                                       [&](const PathState& to) { return mutator.log_pdf_area(from, to); });
      // States whose proposals are seen in several cells.
      if (std::count_if(expected.begin(), expected.end(), [](double x) { return x * kProposals > 40; }) < 2)
        continue;
      expect_counts(counted, expected, kProposals);
      ++tested;
    }
    EXPECT_EQ(tested, 2);
  }
}

// Independent paths of one scattering.
TEST(PathSpace, IndependentPathsHaveTheirDensity) {
  for (const std::size_t which : {4u, 5u, 6u}) {  // their lamp is one vertex
    const path::Case c = path::cases()[which];
    SCOPED_TRACE(c.name);
    const auto scene = path::scene_of(c);
    const MutatorContext context = context_of(*scene);
    PathSpace space(context, bidirectional());
    std::map<std::pair<std::uint32_t, int>, Cells> counted;
    std::optional<PathState> middle;
    SplatList list;
    constexpr int kSamples = 60000;
    for (int n = 0; n < kSamples; ++n) {
      space.start(rng::key(46, 420, static_cast<std::uint64_t>(n)), list);
      if (!(list.scalar() > 0)) continue;
      const PathState& state = *space.present();
      if (state.path.inner_count() != 1 || state.path.vertices[1].delta) continue;
      const scene::CanonicalPoint& at = state.path.vertices[1].point;
      if (scene->points().hit(at).barycentric.x == 0) continue;
      if (!middle) middle = state;
      if (at.primitive == middle->path.vertices[1].point.primitive &&
          at.kind == middle->path.vertices[1].point.kind)
        ++counted[{at.primitive, 0}][cell_of(at)];
    }
    ASSERT_TRUE(middle);
    if (scene->reads_lens()) continue;  // the point on the lens would have to be integrated over
    const scene::CanonicalPoint on = middle->path.vertices[1].point;
    const Cells expected = integrate(*scene, context, *middle, 1, on,
                                     [&](const PathState& to) { return space.log_pdf_area(to); });
    expect_counts(counted[{on.primitive, 0}], expected, kSamples);
  }
}

// All techniques that can make the paths of a length have the same mean of f over their density.
TEST(PathSpace, TechniquesAgree) {
  for (const path::Case& c : path::cases()) {
    if (c.name == "two lamps") continue;  // no eye's walk meets one of them
    SCOPED_TRACE(c.name);
    const auto scene = path::scene_of(c);
    const MutatorContext context = context_of(*scene);
    const Subpaths subpaths(context);
    constexpr std::size_t kCount = 3;
    const Subpaths::Choices all = subpaths.choices({}, kCount);
    std::vector<double> means, errors;
    for (std::size_t s = all.first; s < all.first + all.count; ++s) {
      rng::Stream stream(rng::key(46, 450, kCount, s));
      double sum = 0, squares = 0;
      constexpr int kSamples = 6000;
      for (int n = 0; n < kSamples; ++n) {
        const Proposal made = subpaths.make(nullptr, {}, kCount, s, stream);
        if (!made) continue;
        // Paths without specular vertices: all techniques make these.
        if (std::any_of(made->vertices.begin(), made->vertices.end(),
                        [](const path::PathVertex& v) { return v.delta; }))
          continue;
        const auto state = path_state(*scene, *made, context.rules());
        if (!state) continue;
        const double x = state->scalar / std::exp(subpaths.log_pdf_area(*state, {}, s));
        sum += x;
        squares += x * x;
      }
      const double mean = sum / kSamples;
      means.push_back(mean);
      errors.push_back(std::sqrt((squares / kSamples - mean * mean) / kSamples));
    }
    // Few samples of some techniques have most of the light: only those that are known well are compared.
    std::size_t best = 0, known = 0;
    for (std::size_t i = 0; i < means.size(); ++i)
      if (means[i] > 0 && !(errors[best] / means[best] < errors[i] / means[i])) best = i;
    for (std::size_t i = 0; i < means.size(); ++i) {
      if (!(means[i] > 0) || errors[i] > 0.1 * means[i]) continue;
      ++known;
      EXPECT_NEAR(means[i], means[best], 4.5 * std::hypot(errors[i], errors[best])) << i;
    }
    EXPECT_GE(known, 2u);
  }
}

TEST(PathSpace, MutationsCanBeUndone) {
  for (const path::Case& c : path::cases()) {
    SCOPED_TRACE(c.name);
    const auto scene = path::scene_of(c);
    const MutatorContext context = context_of(*scene);
    PathSpace space(context, bidirectional());
    const BidirectionalMutator mutator(context);
    rng::Stream stream(rng::key(46, 430));
    int proposed = 0, lit = 0, back = 0;
    for (const std::size_t inner : {1u, 2u, 3u})
      for (const PathState& from : states(space, inner, 30))
        for (int n = 0; n < 10; ++n) {
          const Proposal to = mutator.propose(from, stream);
          ++proposed;
          if (!to) continue;
          ASSERT_TRUE(to->well_formed());
          ASSERT_TRUE(path::exists(*scene, *to));
          const auto there = path_state(*scene, *to, context.rules());
          if (!there) continue;
          ++lit;
          const auto forward = mutator.log_pdf_area(from, *there),
                     reverse = mutator.log_pdf_area(*there, from);
          EXPECT_TRUE(forward.has_value());
          back += forward.has_value() && reverse.has_value();
        }
    EXPECT_GT(lit, proposed / 50);
    // All but paths whose light or pinhole was kept although the vertex next to it is specular.
    EXPECT_GE(back, lit * 9 / 10);
  }
}

// A chain of its own, as chain.cpp drives it.
struct Driven {
  Driven(const MutatorContext& context) : space(context, bidirectional()) {}
  void step(std::uint64_t i) {
    const Mutation mutation{rng::key(46, 440, i), i % 5 == 0};
    const double ratio = space.propose(mutation, proposal);
    rng::Stream decide(rng::key(46, 441, i));
    const double accept = proposal.scalar() > 0 ? std::min(1.0, ratio * proposal.scalar() / scalar) : 0;
    if (decide.next_double() < accept) {
      space.accept();
      scalar = proposal.scalar();
    } else {
      space.reject();
    }
    trace.push_back(proposal.scalar() * ratio);
  }
  PathSpace space;
  SplatList proposal;
  double scalar = 0;
  std::vector<double> trace;
};

TEST(PathSpace, ChainsGoThroughBytesWithoutAChange) {
  for (const path::Case& c : path::cases()) {
    SCOPED_TRACE(c.name);
    const auto scene = path::scene_of(c);
    const MutatorContext context = context_of(*scene);
    Driven whole(context);
    std::uint64_t key = 0;
    do whole.space.start(rng::key(46, 442, key++), whole.proposal);
    while (!(whole.proposal.scalar() > 0));
    whole.scalar = whole.proposal.scalar();
    for (std::uint64_t i = 0; i < 150; ++i) whole.step(i);
    Driven resumed(context);
    ASSERT_TRUE(resumed.space.restore(whole.space.save(), resumed.proposal).ok());
    resumed.scalar = resumed.proposal.scalar();
    EXPECT_EQ(resumed.scalar, whole.scalar);
    whole.trace.clear();
    for (std::uint64_t i = 150; i < 300; ++i) {
      whole.step(i);
      resumed.step(i);
    }
    EXPECT_EQ(whole.trace, resumed.trace);
    EXPECT_EQ(whole.space.save(), resumed.space.save());
    EXPECT_GT(whole.space.counts()[0].accepted, 5u);
    // Bytes of a path that is not the chain's.
    SplatList list;
    EXPECT_FALSE(resumed.space.restore("", list).ok());
    EXPECT_FALSE(resumed.space.restore(whole.space.save().substr(1), list).ok());
  }
}

// A new state copies values from the state before it that equal what it would compute.
TEST(PathSpace, SharedVerticesAreCopiedToTheBit) {
  for (const path::Case& c : path::cases()) {
    SCOPED_TRACE(c.name);
    const auto scene = path::scene_of(c);
    const MutatorContext context = context_of(*scene);
    PathSpace space(context, bidirectional());
    const BidirectionalMutator mutator(context);
    const Subpaths subpaths(context);
    int shared = 0;
    for (const std::size_t inner : {1u, 3u})
      for (const PathState& from : states(space, inner, 4)) {
        if (!(mutator.suitability(from) > 0)) continue;
        rng::Stream stream(rng::key(46, 450, inner));
        for (int n = 0; n < 60; ++n) {
          const Proposal to = mutator.propose(from, stream);
          if (!to) continue;
          const auto alone = path_state(*scene, *to, context.rules());
          const auto near = path_state(*scene, *to, context.rules(), &from);
          ASSERT_EQ(alone.has_value(), near.has_value());
          if (!alone) continue;
          EXPECT_EQ(alone->contribution, near->contribution);
          const path::PathNumbers &a = alone->evaluation().numbers(), &b = near->evaluation().numbers();
          EXPECT_EQ(a.pdf_to_eye, b.pdf_to_eye);
          EXPECT_EQ(a.pdf_to_light, b.pdf_to_light);
          EXPECT_EQ(a.factor_to_eye, b.factor_to_eye);
          EXPECT_EQ(a.factor_to_light, b.factor_to_light);
          EXPECT_EQ(a.distance_squared, b.distance_squared);
          EXPECT_EQ(a.survival, b.survival);
          EXPECT_EQ(a.light_prob, b.light_prob);
          EXPECT_EQ(a.light_direct, b.light_direct);
          EXPECT_EQ(a.lens_prob, b.lens_prob);
          subpaths.prepare(*near, from);
          EXPECT_EQ(space.log_pdf_area(*alone), space.log_pdf_area(*near));
          for (std::size_t s = 0; s <= to->vertices.size(); ++s)
            EXPECT_EQ(subpaths.log_pdf_area(*alone, {}, s), subpaths.log_pdf_area(*near, {}, s));
          EXPECT_EQ(alone->assembled().film.x, near->assembled().film.x);
          shared += path::changed_range(from.path, *to).begin > 0;
        }
      }
    EXPECT_GT(shared, 0);
  }
}

// The densities of paths with so many vertices that no double holds the products are those of their walks'
// steps. Inside a sphere each step has the density 1 / (4 pi r^2); the lamp is bright enough that a double
// still holds the contribution.
TEST(PathSpace, LongPathsHaveTheDensitiesOfTheirSteps) {
  scene::Scene::Options options;
  options.film_width = options.film_height = path::kFilm;
  const auto scene = test::build_scene(
      "<shape type='sphere'><float name='radius' value='11.4'/><bsdf type='twosided'><bsdf type='diffuse'>"
      "<rgb name='reflectance' value='1'/></bsdf></bsdf></shape><emitter type='point'>"
      "<point name='position' x='2' y='2' z='4'/><rgb name='intensity' value='1e30'/></emitter>",
      {}, "", options);
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  MutatorContext context = context_of(**scene);
  context.min_edges = 100;
  context.max_edges = 104;
  PathSpace space(context, bidirectional());
  const Subpaths subpaths(context);
  SplatList list;
  int seen = 0, beyond = 0;
  for (std::uint64_t key = 0; key < 2000 && seen < 3; ++key) {
    space.start(rng::key(46, 470, key), list);
    if (space.present() == nullptr) continue;
    ++seen;
    const PathState& state = *space.present();
    const path::Evaluation& evaluation = state.evaluation();
    const path::PathNumbers& n = evaluation.numbers();
    for (const std::size_t s : {std::size_t{1}, std::size_t{2}, n.edges / 2, n.edges}) {
      double expected = std::log(s == 1 ? n.light_direct : n.light_prob) + std::log(n.lens_prob);
      for (std::size_t i = 1; i < s; ++i) expected += evaluation.step_density(true, i).log();
      for (std::size_t i = s; i < n.edges; ++i) expected += evaluation.step_density(false, i).log();
      EXPECT_NEAR(subpaths.log_pdf_area(state, {}, s), expected, 1e-9 * std::abs(expected));
      beyond += expected < std::log(std::numeric_limits<double>::min());
    }
    const auto contribution = evaluation.contribution();
    for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(contribution[c].value(), state.contribution[c]);
  }
  EXPECT_GT(seen, 0);
  EXPECT_GT(beyond, 0);
}

// Counts are of the calls since they were last taken.
TEST(PathSpace, CountsAddUp) {
  const auto scene = path::scene_of(path::cases()[0]);
  Driven driven(context_of(*scene));
  std::uint64_t key = 0;
  do driven.space.start(rng::key(46, 460, key++), driven.proposal);
  while (!(driven.proposal.scalar() > 0));
  driven.scalar = driven.proposal.scalar();
  driven.space.take_counts();
  for (std::uint64_t i = 0; i < 200; ++i) driven.step(i);
  const auto counts = driven.space.take_counts();
  ASSERT_EQ(counts.size(), 1u);
  EXPECT_EQ(counts[0].name, "bidirectional");
  std::uint64_t failed = 0;
  for (const std::uint64_t one : counts[0].failed) failed += one;
  EXPECT_GT(counts[0].proposed, 50u);
  EXPECT_GT(counts[0].accepted, 0u);
  EXPECT_GT(failed, 0u);
  EXPECT_LE(counts[0].accepted + failed, counts[0].proposed);
  EXPECT_GT(counts[0].rays, counts[0].proposed / 2);
  EXPECT_EQ(driven.space.take_counts()[0].proposed, 0u);
}

// A path's seed is its sample and the technique that made it, and it is found again by it.
TEST(PathSpace, SeedsMakeTheirPaths) {
  const auto scene = path::scene_of(path::cases()[1]);
  PathSpace space(context_of(*scene), bidirectional()), other(context_of(*scene), bidirectional());
  SplatList list, again;
  int found = 0;
  for (std::uint64_t key = 0; key < 2000; ++key) {
    space.start(key, list);
    if (!(list.scalar() > 0)) continue;
    ++found;
    const path::PathSeed seed = space.seed(key);
    EXPECT_EQ(seed.sample, key);
    EXPECT_EQ(seed.light_vertices + seed.sensor_vertices, space.present()->path.vertices.size());
    other.start(seed.sample, again);
    EXPECT_EQ(again.scalar(), list.scalar());
    EXPECT_EQ(other.save(), space.save());
  }
  EXPECT_GT(found, 50);
}

}  // namespace
}  // namespace candela::mcmc
