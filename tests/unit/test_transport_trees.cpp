// The structures that find photons and pieces of beams in media. Deterministic: fixed seeds.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
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
  BoxTree one, many, of_points;
  const auto order = one.build(boxes, 1), again = many.build(boxes, 4);
  EXPECT_EQ(order, again);
  EXPECT_EQ(order, of_points.build(points, 4));
  for (int query = 0; query < 300; ++query) {
    const QuerySegment s{somewhere(stream, 1), direction(stream), static_cast<float>(uniform(stream) * 3)};
    const float radius = 0.03f;
    std::vector<int> seen(points.size(), 0), of_tree(points.size(), 0), near(points.size(), 0);
    one.near_segment(s, radius, [&](std::uint32_t slot) { ++seen[order[slot]]; });
    of_points.near_segment(s, radius, [&](std::uint32_t slot) { ++of_tree[order[slot]]; });
    one.near_point(s.origin, radius, [&](std::uint32_t slot) { ++near[order[slot]]; });
    for (std::size_t i = 0; i < points.size(); ++i) {
      ASSERT_LE(std::max(seen[i], of_tree[i]), 1);
      const Projection at = project(s.origin, s.direction, points[i]);
      const double r2 = static_cast<double>(radius) * static_cast<double>(radius);
      if (at.distance_squared < r2 && at.along >= 0 && at.along < static_cast<double>(s.length)) {
        ASSERT_EQ(std::min(seen[i], of_tree[i]), 1) << i;
      }
      if (length_squared(Vec3d(points[i]) - Vec3d(s.origin)) < r2) {
        ASSERT_EQ(near[i], 1) << i;
      }
    }
  }
}

// Claim: rounding loses no item that is within the radius, near or far from the place where a segment begins
// and from 0, along an axis or not; and a tree of points visits none at two radii if no distance is far.
TEST(MediumStructures, RoundingLosesNoItem) {
  rng::Stream stream(8);
  for (const double place : {0.0, 1.0, 1e4})
    for (const float radius : {1e-3f, 0.1f, 10.0f})
      for (int query = 0; query < 30; ++query) {
        const Vec3 axes[] = {{1, 0, 0}, {0, -1, 0}, {0, 0, 1}, direction(stream)};
        const QuerySegment s{somewhere(stream, place), axes[query % 4],
                             (query % 8 < 4 ? 1e4f : 1e7f) * radius};
        const Frame frame = make_frame(s.direction);
        std::vector<Vec3> points;
        for (int i = 0; i < 500; ++i) {
          const double across = static_cast<double>(radius) * (i % 2 == 0 ? 0.99999 : 2),
                       along = static_cast<double>(s.length) * uniform(stream),
                       phi = 2 * std::numbers::pi * uniform(stream);
          points.push_back(Vec3(Vec3d(s.origin) + Vec3d(s.direction) * along +
                                (Vec3d(frame.s) * std::cos(phi) + Vec3d(frame.t) * std::sin(phi)) * across));
        }
        std::vector<ItemBox> boxes;
        for (const Vec3 p : points) boxes.push_back({p, p});
        BoxTree of_points, of_boxes;
        const auto order = of_points.build(points, 1);
        ASSERT_EQ(of_boxes.build(boxes, 1), order);
        int far = 0;
        for (const BoxTree* tree : {&of_points, &of_boxes}) {
          std::vector<int> seen(points.size(), 0);
          tree->near_segment(s, radius, [&](std::uint32_t slot) { ++seen[order[slot]]; });
          for (std::size_t i = 0; i < points.size(); ++i) {
            const Projection at = project(s.origin, s.direction, points[i]);
            const double distance = std::sqrt(at.distance_squared) / static_cast<double>(radius);
            ASSERT_LE(seen[i], 1);
            if (distance < 1 && at.along >= 0 && at.along < static_cast<double>(s.length)) {
              ASSERT_EQ(seen[i], 1) << place << " " << radius << " " << query << " " << at.along;
            } else if (tree == &of_points && distance > 1.5) {
              far += seen[i];
            }
          }
        }
        // The tests widen by a millionth of distances, from the origin and from 0: of far ones more than a
        // radius.
        if (query % 8 < 4 && (place < 1e4 || radius > 1e-3f)) {
          EXPECT_EQ(far, 0) << place << " " << radius << " " << query;
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
        points->prefetch(medium, s.origin, radius);
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
