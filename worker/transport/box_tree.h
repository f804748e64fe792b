// A tree of boxes over points or pieces of beams: which of them lie within a radius of a point, or of a
// segment. A node has the boxes of kWide children, which a query tests at once; on the lowest level they are
// the items. The tree is complete, so that it needs no indices. The order of visits depends on the items
// alone.
#pragma once

#include <immintrin.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "worker/core/huge_pages.h"
#include "worker/core/vec.h"

namespace candela::transport {

struct ItemBox {
  Vec3 low, high;
};

// Points o + t d, 0 <= t < length. d is unit.
struct QuerySegment {
  Vec3 origin, direction;
  float length;
};

class BoxTree {
 public:
  static constexpr std::uint32_t kWide = 8;
  static constexpr std::uint32_t kMostItems = 0x7fffffffu;

  // Returns the items' order: slot -> index. At most kMostItems, all finite. The result does not depend on
  // `threads`.
  std::vector<std::uint32_t> build(std::span<const ItemBox> boxes, unsigned threads);
  // The same of points, whose tree is half as large.
  std::vector<std::uint32_t> build(std::span<const Vec3> points, unsigned threads);

  // visit(slot): items whose box comes within the radius, and a few more. This and what follows return how
  // many nodes they looked into.
  template <class Visit>
  std::uint64_t near_point(Vec3 p, float radius, Visit&& visit) const {
    const float r = widened(radius, p);
    const __m256 low[3] = {_mm256_set1_ps(p.x - r), _mm256_set1_ps(p.y - r), _mm256_set1_ps(p.z - r)},
                 high[3] = {_mm256_set1_ps(p.x + r), _mm256_set1_ps(p.y + r), _mm256_set1_ps(p.z + r)};
    return traverse(
        [&](const Node& node) {
          const auto overlap = [&](int axis) {
            return _mm256_and_ps(_mm256_cmp_ps(high[axis], node.low(axis), _CMP_GE_OQ),
                                 _mm256_cmp_ps(low[axis], node.high(axis), _CMP_LE_OQ));
          };
          return mask_of(_mm256_and_ps(_mm256_and_ps(overlap(0), overlap(1)), overlap(2)));
        },
        visit);
  }
  template <class Visit>
  std::uint64_t near_segment(const QuerySegment& s, float radius, Visit&& visit) const {
    const float r = widened(radius, s.origin);
    const __m256 below[3] = {_mm256_set1_ps(s.origin.x + r), _mm256_set1_ps(s.origin.y + r),
                             _mm256_set1_ps(s.origin.z + r)},
                 above[3] = {_mm256_set1_ps(s.origin.x - r), _mm256_set1_ps(s.origin.y - r),
                             _mm256_set1_ps(s.origin.z - r)},
                 inverse[3] = {_mm256_set1_ps(inverse_of(s.direction.x)),
                               _mm256_set1_ps(inverse_of(s.direction.y)),
                               _mm256_set1_ps(inverse_of(s.direction.z))};
    const __m256 length = _mm256_set1_ps(std::min(s.length, std::numeric_limits<float>::max())),
                 slack = _mm256_set1_ps(kSlack);
    return traverse(
        [&](const Node& node) {
          __m256 enter = _mm256_setzero_ps(), leave = length;
          for (int axis = 0; axis < 3; ++axis) {
            const __m256 a = _mm256_mul_ps(_mm256_sub_ps(node.low(axis), below[axis]), inverse[axis]),
                         b = _mm256_mul_ps(_mm256_sub_ps(node.high(axis), above[axis]), inverse[axis]);
            enter = _mm256_max_ps(enter, _mm256_min_ps(a, b));
            leave = _mm256_min_ps(leave, _mm256_max_ps(a, b));
          }
          return mask_of(_mm256_cmp_ps(_mm256_mul_ps(enter, slack), leave, _CMP_LE_OQ));
        },
        visit);
  }

  std::uint32_t size() const { return count_; }
  std::uint64_t bytes() const { return sides_.capacity() * sizeof(float); }

 private:
  static constexpr float kSlack = 1 - 0x1p-20f;  // of slabs' rounding
  static constexpr std::uint32_t kSide = 3 * kWide;

  // The boxes of kWide children: their lower sides by axis, then the upper ones; of points these are the
  // same. A child that is not there is at infinity, where no query is.
  struct Node {
    const float *low_sides, *high_sides;
    __m256 low(int axis) const { return _mm256_loadu_ps(low_sides + axis * static_cast<int>(kWide)); }
    __m256 high(int axis) const { return _mm256_loadu_ps(high_sides + axis * static_cast<int>(kWide)); }
  };
  struct Level {
    std::size_t first = 0;               // of sides_
    std::uint32_t floats = 0, high = 0;  // of a node, and where its upper sides begin
  };
  const float* sides(std::uint32_t level, std::uint32_t node) const {
    return sides_.data() + level_[level].first + std::size_t{level_[level].floats} * node;
  }
  Node node_at(std::uint32_t level, std::uint32_t node) const {
    const float* low = sides(level, node);
    return {low, low + level_[level].high};
  }
  static std::uint32_t mask_of(__m256 comparison) {
    return static_cast<std::uint32_t>(_mm256_movemask_ps(comparison));
  }
  std::vector<std::uint32_t> build_levels(std::span<const ItemBox> boxes, bool points, unsigned threads);

  // Rounding in the tests must not lose an item that is within the radius.
  static float widened(float radius, Vec3 p) {
    const float largest = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    return radius * (1 + 0x1p-16f) + largest * 0x1p-20f;
  }
  static float inverse_of(float d) {
    return 1 / (std::abs(d) > 1e-20f ? d : std::copysign(1e-20f, d));  // no product of 0 and infinity
  }

  // overlaps(node): a bit for each child. Many nodes of a level are known before the first of them is looked
  // into, so that they come from memory together; those below it are finished before those behind it.
  template <class Overlaps, class Visit>
  std::uint64_t traverse(const Overlaps& overlaps, Visit& visit) const {
    if (count_ == 0) return 0;
    constexpr std::uint32_t kMost = 64;
    struct Known {
      std::uint32_t next = 0, count = 0;
      std::uint32_t node[kMost];
    };
    std::array<Known, kMostLevels> known;
    const std::uint32_t top = levels_ - 1;
    known[top].node[known[top].count++] = 0;
    std::uint64_t nodes = 0;
    for (std::uint32_t level = top;;) {
      Known& here = known[level];
      const auto for_children = [&](const auto& use) {
        const std::uint32_t node = here.node[here.next++];
        ++nodes;
        for (std::uint32_t left = overlaps(node_at(level, node)); left != 0; left &= left - 1)
          use(kWide * node + static_cast<std::uint32_t>(std::countr_zero(left)));
      };
      if (here.next == here.count) {
        here.next = here.count = 0;
        if (level++ == top) return nodes;
      } else if (level == 0) {
        while (here.next < here.count) for_children(visit);
      } else {
        Known& below = known[level - 1];
        while (here.next < here.count && below.count + kWide <= kMost)
          for_children([&](std::uint32_t child) {
            prefetch(level - 1, child);
            below.node[below.count++] = child;
          });
        --level;
      }
    }
  }
  void prefetch(std::uint32_t level, std::uint32_t node) const {
    constexpr std::uint32_t kLine = 16;
    const float* begin = sides(level, node);
    for (std::uint32_t i = 0; i < level_[level].floats; i += kLine) __builtin_prefetch(begin + i);
  }

  static constexpr std::uint32_t kMostLevels = 11;  // of 2^31 items
  HugeVector<float> sides_;
  std::array<Level, kMostLevels> level_{};  // the children of level 0 are the items
  std::uint32_t count_ = 0, levels_ = 0;
};

}  // namespace candela::transport
