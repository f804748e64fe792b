// A tree of boxes over points or pieces of beams: which of them lie within a radius of a point, or of
// a segment. The items are in the order of Morton codes of their boxes' centers, in leaves of kLeaf. A node
// has the boxes of kWide children, which a query tests at once; the tree is complete, so that it needs no
// indices. The order of visits depends on the items alone.
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
  static constexpr std::uint32_t kLeaf = 4, kWide = 8;

  // Returns the items' order: slot -> index. Fewer than 2^31 items, all boxes finite.
  std::vector<std::uint32_t> build(std::span<const ItemBox> boxes, unsigned threads);

  // visit(first, end): slots of a leaf whose box comes within the radius, in rising order.
  template <class Visit>
  void near_point(Vec3 p, float radius, Visit&& visit) const {
    const float r = widened(radius, p);
    const __m256 low[3] = {_mm256_set1_ps(p.x - r), _mm256_set1_ps(p.y - r), _mm256_set1_ps(p.z - r)},
                 high[3] = {_mm256_set1_ps(p.x + r), _mm256_set1_ps(p.y + r), _mm256_set1_ps(p.z + r)};
    traverse(
        [&](const Node& node) {
          const auto overlap = [&](int axis) {
            return _mm256_and_ps(_mm256_cmp_ps(high[axis], _mm256_load_ps(node.low[axis]), _CMP_GE_OQ),
                                 _mm256_cmp_ps(low[axis], _mm256_load_ps(node.high[axis]), _CMP_LE_OQ));
          };
          return mask_of(_mm256_and_ps(_mm256_and_ps(overlap(0), overlap(1)), overlap(2)));
        },
        visit);
  }
  template <class Visit>
  void near_segment(const QuerySegment& s, float radius, Visit&& visit) const {
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
    traverse(
        [&](const Node& node) {
          __m256 enter = _mm256_setzero_ps(), leave = length;
          for (int axis = 0; axis < 3; ++axis) {
            const __m256 a = _mm256_mul_ps(_mm256_sub_ps(_mm256_load_ps(node.low[axis]), below[axis]),
                                           inverse[axis]),
                         b = _mm256_mul_ps(_mm256_sub_ps(_mm256_load_ps(node.high[axis]), above[axis]),
                                           inverse[axis]);
            enter = _mm256_max_ps(enter, _mm256_min_ps(a, b));
            leave = _mm256_min_ps(leave, _mm256_max_ps(a, b));
          }
          return mask_of(_mm256_cmp_ps(_mm256_mul_ps(enter, slack), leave, _CMP_LE_OQ));
        },
        visit);
  }

  std::uint32_t size() const { return count_; }
  std::uint64_t bytes() const { return nodes_.capacity() * sizeof(Node); }

 private:
  static constexpr float kSlack = 1 - 0x1p-20f;  // of slabs' rounding

  // The boxes of kWide children, or leaves, by axis. One that is not there is at infinity, where no query is.
  struct alignas(32) Node {
    float low[3][kWide], high[3][kWide];
  };
  static std::uint32_t mask_of(__m256 comparison) {
    return static_cast<std::uint32_t>(_mm256_movemask_ps(comparison));
  }

  // Rounding in the tests must not lose an item that is within the radius.
  static float widened(float radius, Vec3 p) {
    const float largest = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    return radius * (1 + 0x1p-16f) + largest * 0x1p-20f;
  }
  static float inverse_of(float d) {
    return 1 / (std::abs(d) > 1e-20f ? d : std::copysign(1e-20f, d));  // no product of 0 and infinity
  }

  // overlaps(node): a bit for each child.
  template <class Overlaps, class Visit>
  void traverse(const Overlaps& overlaps, Visit& visit) const {
    if (count_ == 0) return;
    // Each level has a node under way, and a bit for each of its children that is left to visit.
    std::array<std::uint32_t, kMostLevels> index, left;
    const std::uint32_t top = levels_ - 1;
    std::uint32_t level = top;
    index[top] = 0;
    left[top] = overlaps(nodes_[first_[top]]);
    for (;;) {
      while (left[level] == 0)
        if (level++ == top) return;
      const std::uint32_t child =
          kWide * index[level] + static_cast<std::uint32_t>(std::countr_zero(left[level]));
      left[level] &= left[level] - 1;
      if (level == 0) {
        visit(child * kLeaf, std::min((child + 1) * kLeaf, count_));
      } else {
        --level;
        index[level] = child;
        left[level] = overlaps(nodes_[first_[level] + child]);
      }
    }
  }

  static constexpr std::uint32_t kMostLevels = 11;  // of 2^31 items
  std::vector<Node> nodes_;
  std::array<std::uint32_t, kMostLevels> first_{};  // node of each level; the children of level 0 are leaves
  std::uint32_t count_ = 0, levels_ = 0;
};

}  // namespace candela::transport
