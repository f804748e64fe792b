// Claims: a path that a walk made is named by its vertices, and from these names alone has the same
// contribution and densities again; it goes through bytes and back without a change of a bit; bytes that are
// no path are refused; a mutation's range is the smallest that changed.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "tests/unit/path_walks.h"
#include "worker/transport/path/assemble.h"
#include "worker/transport/path/evaluation.h"
#include "worker/transport/path/serialize.h"

namespace candela::transport::path {
namespace {

TEST(PathStates, HaveTheirWalksValues) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const auto scene = scene_of(c);
    rng::Stream stream(rng::key(46, 200));
    int paths = 0, alike = 0, assembled_paths = 0, with_delta = 0;
    for (int n = 0; n < 400; ++n)
      walk(*scene, stream, [&](const WalkedPath& walked) {
        ++paths;
        const auto path = canonical(*scene, walked.path, walked.u_lens);
        ASSERT_TRUE(path);
        EXPECT_TRUE(path->well_formed());
        EXPECT_TRUE(exists(*scene, *path));
        const auto assembled = assemble(*scene, *path);
        if (!assembled) return;  // at the film's rim
        ++assembled_paths;
        EXPECT_NEAR(assembled->film.x, walked.film.x, 1e-3);
        EXPECT_NEAR(assembled->film.y, walked.film.y, 1e-3);
        for (std::size_t i = 0; i < assembled->edges.size(); ++i) {
          EXPECT_NEAR(length(assembled->edges[i].direction), 1, 1e-6);
          EXPECT_LT(length(assembled->edges[i].direction - Vec3d(walked.path.along[i])), 3e-3);
        }
        Rules rules;
        rules.eye_paths = kPixels;
        const Evaluation evaluation(*scene, assembled->path, rules);
        if (!evaluation.valid()) return;
        const Technique technique{Technique::Kind::next_event, 1, {}};
        const std::array<double, 3> value = evaluation.estimator_value(technique);
        bool near = true;
        for (std::size_t k = 0; k < 3; ++k)
          near = near &&
                 std::abs(value[k] - walked.value[k]) <= (2e-3 + 4 * evaluation.rounding()) * walked.value[k];
        alike += near;
        for (const PathVertex& v : path->vertices) with_delta += v.delta;
      });
    EXPECT_GT(paths, 100);
    EXPECT_GE(assembled_paths, paths * 98 / 100);
    // Narrow lobes magnify rounding of directions.
    EXPECT_GE(alike, paths * 96 / 100) << "of " << paths;
    EXPECT_GT(with_delta, 10);
  }
}

TEST(PathStates, GoThroughBytesWithoutAChange) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const auto scene = scene_of(c);
    rng::Stream stream(rng::key(46, 201));
    for (int n = 0; n < 50; ++n)
      walk(*scene, stream, [&](const WalkedPath& walked) {
        const auto path = canonical(*scene, walked.path, walked.u_lens);
        ASSERT_TRUE(path);
        const std::string bytes = to_bytes(*path);
        EXPECT_LE(bytes.size(), 3 + 32 * path->vertices.size());
        const auto again = path_from_bytes(bytes);
        ASSERT_TRUE(again.ok()) << again.error().to_string();
        EXPECT_EQ(*again, *path);
        const auto first = assemble(*scene, *path), second = assemble(*scene, *again);
        ASSERT_EQ(first.has_value(), second.has_value());
        if (!first) return;
        EXPECT_EQ(first->film.x, second->film.x);
        const Evaluation a(*scene, first->path, {}), b(*scene, second->path, {});
        EXPECT_EQ(a.valid(), b.valid());
        if (!a.valid()) return;
        for (std::size_t k = 0; k < 3; ++k)
          EXPECT_EQ(a.contribution()[k].value(), b.contribution()[k].value());
        // Names of names are the same.
        const auto named = canonical(*scene, first->path, walked.u_lens);
        ASSERT_TRUE(named);
        for (std::size_t i = 1; i + 1 < path->vertices.size(); ++i)
          EXPECT_EQ(named->vertices[i].point.primitive, path->vertices[i].point.primitive);
      });
  }
}

Path some_path() {
  Path path;
  path.vertices.resize(5);
  path.vertices[0].kind = Kind::point_light;
  path.vertices[0].object = 3;
  path.vertices[1].point = {7, 9, 2, 0.25, -0.5};
  path.vertices[1].delta = path.vertices[1].transmitted = true;
  path.vertices[2].kind = Kind::medium;
  path.vertices[2].object = 1;
  path.vertices[2].place = {1e4, -2, 1e-300};
  path.vertices[3].point = {scene::kNone, 5, 0, 0.1, 0.2};
  path.vertices[4].kind = Kind::sensor;
  path.vertices[4].place = {0.25, 0.75, 0};
  return path;
}

TEST(PathBytes, RefuseWhatIsNoPath) {
  const Path path = some_path();
  const std::string bytes = to_bytes(path);
  ASSERT_TRUE(path_from_bytes(bytes).ok());
  EXPECT_EQ(*path_from_bytes(bytes), path);
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_FALSE(path_from_bytes(std::string_view(bytes).substr(0, size)).ok());
  EXPECT_FALSE(path_from_bytes(bytes + "x").ok());
  rng::Stream stream(rng::key(46, 202));
  for (int i = 0; i < 2000; ++i) {
    std::string other = bytes;
    const auto at = static_cast<std::size_t>(stream.next_double() * static_cast<double>(other.size()));
    other[at] = static_cast<char>(stream.next_double() * 256);
    const auto read = path_from_bytes(other);
    if (read.ok())
      EXPECT_EQ(to_bytes(*read), other);
    else
      EXPECT_EQ(read.error().field, "state");
  }
}

TEST(PathSeeds, AreThreeIntegers) {
  const PathSeed seed{0x123456789abcdef0ULL, 3, 4};
  const std::string bytes = to_bytes(seed);
  EXPECT_EQ(bytes.size(), 16u);
  ASSERT_TRUE(seed_from_bytes(bytes).ok());
  EXPECT_EQ(*seed_from_bytes(bytes), seed);
  EXPECT_FALSE(seed_from_bytes(bytes.substr(1)).ok());
}

TEST(PathRanges, AreTheSmallestThatChanged) {
  const Path path = some_path();
  EXPECT_EQ(changed_range(path, path).begin, path.vertices.size());
  std::vector<PathVertex> by(3, path.vertices[3]);
  by[0].point.u = 0.3;
  by[2].point.v = 0.4;
  const Path longer = path.replaced({1, 3}, by);
  EXPECT_EQ(longer.vertices.size(), 6u);
  EXPECT_TRUE(longer.well_formed());
  const PathRange range = changed_range(path, longer);
  EXPECT_EQ(range.begin, 1u);
  EXPECT_EQ(range.end, 3u);
  const PathRange back = changed_range(longer, path);
  EXPECT_EQ(back.begin, 1u);
  EXPECT_EQ(back.end, 4u);
  EXPECT_EQ(longer.replaced(back, std::span(path.vertices).subspan(1, 2)), path);
  Path open = path;
  open.vertices.pop_back();
  EXPECT_FALSE(open.well_formed());
}

}  // namespace
}  // namespace candela::transport::path
