// Claims: paths in scenes are chains of half vectors, whose contribution is their geometry over the Jacobian
// [half-vector note, section 19, test 2]; walks in scenes arrive, come back, and change nothing outside the
// segment; lobes have the indices and roughnesses of their bsdfs.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "tests/unit/manifold_geometry.h"
#include "tests/unit/path_walks.h"
#include "worker/scene/bsdfs/bsdf_build.h"
#include "worker/scene/bsdfs/lobe_shapes.h"
#include "worker/transport/manifold/proposal.h"
#include "worker/transport/manifold/walk.h"
#include "worker/transport/path/evaluation.h"
#include "worker/transport/path/segment.h"

namespace candela::transport::path {
namespace {

using namespace manifold;  // NOLINT(google-build-using-namespace)

TEST(Segments, HaveTheContributionOfTheirHalfVectors) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const auto scene = scene_of(c);
    rng::Stream stream(rng::key(46, 210));
    int chains = 0;
    for (int n = 0; n < 200; ++n)
      walk(*scene, stream, [&](const WalkedPath& walked) {
        const auto path = canonical(*scene, walked.path, walked.u_lens);
        ASSERT_TRUE(path);
        const auto assembled = assemble(*scene, *path);
        if (!assembled) return;
        Segment segment;
        const std::size_t k = path->edge_count();
        const NoSegment reason = make_segment(*scene, *path, *assembled, 0, k, segment);
        if (reason == NoSegment::far_sensor) {
          EXPECT_TRUE(assembled->path.lens_infinite);
          return;
        }
        ASSERT_EQ(reason, NoSegment::none);
        const Chain& chain = segment.chain;
        ASSERT_EQ(chain.inner_count(), path->inner_count());
        if (fault_of(chain) != Fault::none) return;
        BlockTridiagonal factored;
        if (!factored.factor(blocks(Form::slope, chain))) return;
        double log_geometry = 0, log_steps = 0;
        for (std::size_t i = 0; i <= chain.inner_count(); ++i)
          log_geometry += std::log(geometry_term(chain, i));
        for (std::size_t i = 1; i <= chain.inner_count(); ++i)
          log_steps += std::log(projected_by_constraint(Form::slope, chain, i));
        const double pencil = log_pencil(chain);
        const double generalized =
            std::log(geometry_term(chain, 0) * std::abs(det(factored.by_last_end().front())));
        EXPECT_NEAR(pencil, generalized, 1e-6);
        EXPECT_NEAR(pencil, log_geometry - factored.log_abs_det() - log_steps, 1e-6);
        // A specular vertex has the slope 0, but for the rounding of the walk that found it.
        for (std::size_t i = 1; i <= chain.inner_count(); ++i)
          if (segment.alphas[i - 1] == 0) {
            EXPECT_LT(max_abs(constraint(Form::slope, chain, i)), 1e-3);
          }
        ++chains;
      });
    if (c.sensor != kOrthographic) {
      EXPECT_GT(chains, 60);
    }
  }
}

TEST(Segments, WalkAndReturn) {
  for (const Case& c : cases()) {
    if (c.sensor == kOrthographic) continue;
    SCOPED_TRACE(c.name);
    const auto scene = scene_of(c);
    rng::Stream stream(rng::key(46, 211));
    int walks = 0, converged = 0, returned = 0;
    for (int n = 0; n < 150; ++n)
      walk(*scene, stream, [&](const WalkedPath& walked) {
        const auto path = canonical(*scene, walked.path, walked.u_lens);
        ASSERT_TRUE(path);
        const auto assembled = assemble(*scene, *path);
        Segment segment;
        if (!assembled ||
            make_segment(*scene, *path, *assembled, 0, path->edge_count(), segment) != NoSegment::none)
          return;
        const std::size_t m = segment.chain.inner_count();
        const ChainVertex& last = segment.chain.vertices[m];
        const auto film = to_film(*scene, last, assembled->edges.back().length, walked.u_lens);
        ASSERT_TRUE(film);
        const auto from = prepare(segment.chain, segment.alphas, *film, {0.1, 0.02 * kFilm});
        if (!from) return;
        std::vector<Pair> z;
        std::vector<double> tolerances;
        for (std::size_t i = 0; i < m; ++i) {
          const double u = stream.next_double();
          z.push_back(normal_pair(u, stream.next_double()));
          tolerances.push_back(tolerance(0.1, segment.alphas[i]));
        }
        // Specular slopes are where the rays of floats put them: first to 0.
        std::vector<Pair> at = from->slopes;
        for (std::size_t i = 0; i < m; ++i)
          if (segment.alphas[i] == 0) at[i] = {};
        const SceneSurfaces surfaces(*scene, segment);
        Chain start = segment.chain;
        if (!manifold::walk(start, at, tolerances, surfaces, {}).converged()) return;
        ++walks;
        Chain moved = start;
        const std::vector<Pair> to = propose_slopes(*from, z);
        if (!manifold::walk(moved, to, tolerances, surfaces, {}).converged()) return;
        ++converged;
        returned += returns(moved, start, at, tolerances, surfaces, {});
        const Path there = with_segment(*path, segment, moved);
        EXPECT_TRUE(exists(*scene, there));
        const PathRange range = changed_range(*path, there);
        EXPECT_GE(range.begin, 1u);
        EXPECT_LE(range.end, path->edge_count());
        const auto assembled_there = assemble(*scene, there);
        if (!assembled_there) return;  // it left the film
        // The chain that follows from the names is the chain that the walk ended with.
        Segment again;
        const NoSegment reason = make_segment(*scene, there, *assembled_there, 0, there.edge_count(), again);
        ASSERT_EQ(reason, NoSegment::none);
        for (std::size_t i = 1; i <= m; ++i) {
          EXPECT_EQ(again.chain.vertices[i].x, moved.vertices[i].x);
          EXPECT_EQ(again.chain.vertices[i].n, moved.vertices[i].n);
        }
      });
    EXPECT_GT(walks, 40);
    EXPECT_GT(converged, walks / 2);
    EXPECT_GE(returned, converged * 97 / 100);
  }
}

TEST(LobeShapes, AreThoseOfTheBsdf) {
  const auto scene = scene_of(cases()[0]);
  const auto shapes = [&](Vec3 to) {
    scene::SurfaceHit hit;
    const Vec3 from{0, 0, 0};
    EXPECT_TRUE(scene->intersect({from, normalize(to)}, hit));
    scene::ClosureArena arena;
    const Vec3 wo = hit.shading.to_local(-normalize(to));
    return scene::lobe_shapes(scene->closure(hit, wo, arena), wo);
  };
  const auto glass = shapes({-1, 0.3f, 3.5f});
  ASSERT_EQ(glass.size(), 2u);
  EXPECT_EQ(glass[0].alpha, 0);
  EXPECT_FALSE(glass[0].transmitted);
  EXPECT_TRUE(glass[1].transmitted);
  EXPECT_NEAR(glass[1].eta, 1.5046 / 1.000277, 1e-5);
  const auto metal = shapes({1, -0.2f, 3.4f});
  ASSERT_EQ(metal.size(), 1u);
  EXPECT_NEAR(metal[0].alpha, 0.2, 1e-6);
  const auto plastic = shapes({0, -1.4f, 2});
  ASSERT_EQ(plastic.size(), 2u);
  EXPECT_EQ(plastic[0].alpha, 0);
  EXPECT_EQ(plastic[1].alpha, 1);
  const auto matt = shapes({0.2f, 1.5f, 5});
  ASSERT_EQ(matt.size(), 1u);
  EXPECT_EQ(matt[0].alpha, 1);
}

}  // namespace
}  // namespace candela::transport::path
