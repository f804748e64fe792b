// The structures that find photons and pieces of beams in media. Deterministic: fixed seeds.
#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <utility>
#include <vector>

#include "tests/unit/media_fixture.h"
#include "worker/transport/box_tree.h"
#include "worker/transport/photon_points.h"

namespace candela::transport {
namespace {

using test::direction;
using test::fog;
using test::somewhere;
using test::uniform;

// Claim: trees find every item near a point or a segment that looking at all of them finds, each once, in an
// order that the number of threads does not change.
TEST(MediumStructures, TreesFindWhatLiesNear) {
  rng::Stream stream(3);
  std::vector<ItemBox> boxes;
  std::vector<Vec3> points;
  for (int i = 0; i < 5000; ++i) {
    points.push_back(somewhere(stream, i % 10 == 0 ? 1000 : 1));
    boxes.push_back({points.back(), points.back()});
  }
  BoxTree one, many;
  const auto order = one.build(boxes, 1), again = many.build(boxes, 4);
  EXPECT_EQ(order, again);
  for (int query = 0; query < 300; ++query) {
    const QuerySegment s{somewhere(stream, 1), direction(stream), static_cast<float>(uniform(stream) * 3)};
    const float radius = 0.03f;
    std::vector<int> seen(points.size(), 0), near(points.size(), 0);
    one.near_segment(s, radius, [&](std::uint32_t slot) { ++seen[order[slot]]; });
    one.near_point(s.origin, radius, [&](std::uint32_t slot) { ++near[order[slot]]; });
    for (std::size_t i = 0; i < points.size(); ++i) {
      ASSERT_LE(seen[i], 1);
      const Projection at = project(s.origin, s.direction, points[i]);
      const double r2 = static_cast<double>(radius) * static_cast<double>(radius);
      if (at.distance_squared < r2 && at.along >= 0 && at.along < static_cast<double>(s.length)) {
        ASSERT_EQ(seen[i], 1) << i;
      }
      if (length_squared(Vec3d(points[i]) - Vec3d(s.origin)) < r2) {
        ASSERT_EQ(near[i], 1) << i;
      }
    }
  }
}

// Claim: a tree of any size visits each item that is near once, in rising order, and nothing where no item
// is; near a segment without an end, too.
TEST(MediumStructures, TreesOfAnySizeHaveTheirItemsAlone) {
  rng::Stream stream(4);
  for (const int count : {1, 3, 4, 5, 31, 32, 33, 255, 256, 257, 2047, 2049}) {
    std::vector<Vec3> points;
    std::vector<ItemBox> boxes;
    for (int i = 0; i < count; ++i) {
      points.push_back(somewhere(stream, 1));
      boxes.push_back({points.back(), points.back()});
    }
    BoxTree of_boxes, of_points;
    const auto order = of_boxes.build(boxes, 2);
    EXPECT_EQ(order, of_points.build(points, 1));
    EXPECT_EQ(std::set<std::uint32_t>(order.begin(), order.end()).size(), boxes.size());
    for (const BoxTree* tree : {&of_boxes, &of_points}) {
      std::uint32_t next = 0;
      const auto visit = [&](std::uint32_t slot) { ASSERT_EQ(slot, next++); };
      for (const float length : {1.0f, std::numeric_limits<float>::infinity()}) {
        next = 0;
        tree->near_segment({somewhere(stream, 1), direction(stream), length}, 10, visit);
        EXPECT_EQ(next, boxes.size()) << count;
      }
      next = 0;
      tree->near_point(somewhere(stream, 1), 10, visit);
      EXPECT_EQ(next, boxes.size()) << count;
    }
  }
}

// Claim: photons of a medium within the radius of a place, which is another in each medium, are found once,
// those of other media never, with and without the tree beside the searches, which finds those beside a
// segment in any medium; each has the survival it was kept with.
TEST(MediumStructures, PhotonsAreFoundInTheirMedium) {
  const auto scene = fog("fog-null");
  rng::Stream stream(6);
  constexpr std::uint32_t kMedia = 3;
  const float radii[kMedia] = {0.05f, 0.2f, 0.1f};
  PhotonBuffer<MisBlock> buffers[2];
  for (int i = 0; i < 3000; ++i) {
    Vertex<MisBlock> v;
    v.kind = VertexKind::medium;
    v.hit.p = somewhere(stream, 1);
    v.wo = direction(stream);
    v.medium = i % 7 == 0 ? 1U : 0U;  // the third has none
    v.throughput = Spectrum(1);
    v.edges = static_cast<std::uint32_t>(i);  // names it
    v.survival = static_cast<float>(uniform(stream));
    ASSERT_TRUE(buffers[i % 2].keep(*scene, v, true));
  }
  const PhotonBuffer<MisBlock>* const chunks[] = {&buffers[0], &buffers[1]};
  PhotonPoints both, searches, tree;
  ASSERT_TRUE(both.build(chunks, {radii, true, nullptr}, 2).ok());
  ASSERT_TRUE(searches.build(chunks, {radii, false, nullptr}, 1).ok());
  ASSERT_TRUE(tree.build(chunks, {{}, true, nullptr}, 1).ok());
  using Found = std::multiset<std::pair<std::uint32_t, float>>;
  std::size_t met = 0;
  for (int query = 0; query < 300; ++query) {
    const QuerySegment s{somewhere(stream, 1), direction(stream), static_cast<float>(uniform(stream) * 2)};
    const auto expected = [&](const auto& near) {
      Found found;
      for (const PhotonBuffer<MisBlock>& buffer : buffers)
        for (std::size_t i = 0; i < buffer.size(); ++i)
          if (near(buffer.photons()[i].medium(), buffer.positions()[i]))
            found.emplace(buffer.photons()[i].edges, buffer.survivals()[i]);
      return found;
    };
    for (std::uint32_t medium = 0; medium < kMedia; ++medium) {
      const float radius = radii[medium];
      const Found wanted = expected([&](std::uint32_t m, Vec3 p) {
        const Vec3 d = p - s.origin;
        return m == medium && dot(d, d) <= radius * radius;
      });
      for (const PhotonPoints* points : {&both, &searches}) {
        RangeSearch::Query steps;
        points->announce(medium, s.origin, radius);
        points->find(medium, s.origin, radius, steps);
        Found found;
        points->near_point(medium, steps, [&](const Photon<MisBlock>& photon, float) {
          found.emplace(photon.edges, points->survival(photon));
        });
        ASSERT_EQ(found, wanted) << medium;
      }
      met += wanted.size();
    }
    const Found wanted = expected([&](std::uint32_t, Vec3 p) {
      const Projection at = project(s.origin, s.direction, p);
      return at.distance_squared < 0.01 && at.along >= 0 && at.along < static_cast<double>(s.length);
    });
    for (const PhotonPoints* points : {&both, &tree}) {
      Found found;
      points->near_segment(s, 0.1f, [&](const Photon<MisBlock>& photon, const Projection&) {
        found.emplace(photon.edges, points->survival(photon));
      });
      ASSERT_EQ(found, wanted);
    }
  }
  EXPECT_GT(met, 500U);
}

}  // namespace
}  // namespace candela::transport
