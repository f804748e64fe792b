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
  static constexpr std::uint32_t kMaxItems = 0x7fffffffu;

  // Returns the items' order: slot -> index. At most kMaxItems, all finite. The result does not depend on
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
    const auto overlaps = [&](const Node& node) {
      const auto overlap = [&](int axis) {
        return _mm256_and_ps(_mm256_cmp_ps(high[axis], node.low(axis), _CMP_GE_OQ),
                             _mm256_cmp_ps(low[axis], node.high(axis), _CMP_LE_OQ));
      };
      return mask_of(_mm256_and_ps(_mm256_and_ps(overlap(0), overlap(1)), overlap(2)));
    };
    return traverse(overlaps, overlaps, visit);
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
    const auto crosses = [&](const Node& node) {
      __m256 enter = _mm256_setzero_ps(), leave = length;
      for (int axis = 0; axis < 3; ++axis) {
        const __m256 a = _mm256_mul_ps(_mm256_sub_ps(node.low(axis), below[axis]), inverse[axis]),
                     b = _mm256_mul_ps(_mm256_sub_ps(node.high(axis), above[axis]), inverse[axis]);
        enter = _mm256_max_ps(enter, _mm256_min_ps(a, b));
        leave = _mm256_min_ps(leave, _mm256_max_ps(a, b));
      }
      return mask_of(_mm256_cmp_ps(_mm256_mul_ps(enter, slack), leave, _CMP_LE_OQ));
    };
    // A point p has the distance |(p - o) x d| from the line, and rounding changes it by e = kRounding |p -
    // o| at most: (r + e)^2 <= (1 + kSpread) r^2 + (1 + 1 / kSpread) e^2. A child that is not there has no
    // number for a distance: two components of d have one sign, or one is 0.
    const __m256 origin[3] = {_mm256_set1_ps(s.origin.x), _mm256_set1_ps(s.origin.y),
                              _mm256_set1_ps(s.origin.z)},
                 direction[3] = {_mm256_set1_ps(s.direction.x), _mm256_set1_ps(s.direction.y),
                                 _mm256_set1_ps(s.direction.z)},
                 within = _mm256_set1_ps((1 + kSpread) * r * r),
                 rounding = _mm256_set1_ps((1 + 1 / kSpread) * kRounding * kRounding);
    const auto passes = [&](const Node& node) {
      const __m256 x = _mm256_sub_ps(node.low(0), origin[0]), y = _mm256_sub_ps(node.low(1), origin[1]),
                   z = _mm256_sub_ps(node.low(2), origin[2]);
      const auto square = [](__m256 a, __m256 b, __m256 c) {
        return _mm256_fmadd_ps(a, a, _mm256_fmadd_ps(b, b, _mm256_mul_ps(c, c)));
      };
      const auto minor = [&](__m256 a, __m256 b, int first, int second) {
        return _mm256_fmsub_ps(a, direction[second], _mm256_mul_ps(b, direction[first]));
      };
      const __m256 distance = square(minor(y, z, 1, 2), minor(z, x, 2, 0), minor(x, y, 0, 1));
      return mask_of(_mm256_cmp_ps(distance, _mm256_fmadd_ps(rounding, square(x, y, z), within), _CMP_LE_OQ));
    };
    return traverse(crosses, passes, visit);
  }

  std::uint32_t size() const { return count_; }
  std::uint64_t bytes() const { return sides_.capacity() * sizeof(float); }

 private:
  static constexpr float kSlack = 1 - 0x1p-20f;  // of slabs' rounding
  // Rounding changes the cross product of a vector and a unit vector by less than kRounding of the length.
  static constexpr float kRounding = 0x1p-22f, kSpread = 0x1p-4f;
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

  // The nodes or items of one level that a query comes near. It has looked into those before `next`.
  struct Found {
    static constexpr std::uint32_t kMax = 64;
    std::uint32_t next = 0, count = 0;
    std::uint32_t at[kMax];
  };
  // Writes to `to` the children of a node that a mask has bits of, and returns their number. It writes eight
  // in any case: a branch on the mask would be mispredicted at most nodes.
  static std::uint32_t add_children(std::uint32_t node, std::uint32_t mask, std::uint32_t* to) {
    const __m256i bits = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(kPlaces[mask])));
    const __m256i first = _mm256_set1_epi32(static_cast<int>(kWide * node));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), _mm256_add_epi32(first, bits));
    return static_cast<std::uint32_t>(std::popcount(mask));
  }
  // The places of the bits of each mask, a byte each, from the lowest.
  static constexpr std::array<std::uint64_t, 1u << kWide> kPlaces = [] {
    std::array<std::uint64_t, 1u << kWide> places{};
    for (std::uint32_t mask = 0; mask < places.size(); ++mask)
      for (std::uint32_t bit = kWide; bit-- > 0;)
        if ((mask >> bit & 1) != 0) places[mask] = places[mask] << 8 | bit;
    return places;
  }();

  // boxes(node): a bit for each child; points(node): the same if these are points. Many nodes of a level are
  // known before the first of them is looked into, so that they come from memory together; those below it are
  // finished before those behind it.
  template <class Boxes, class Points, class Visit>
  std::uint64_t traverse(const Boxes& boxes, const Points& points, Visit& visit) const {
    if (count_ == 0) return 0;
    std::array<Found, kMaxLevels + 1> found;  // the items, then the nodes by level
    const std::uint32_t top = levels_;
    found[top].at[found[top].count++] = 0;
    std::uint64_t nodes = 0;
    for (std::uint32_t level = top;;) {
      Found& here = found[level];
      if (level == 0) {
        for (std::uint32_t i = 0; i < here.count; ++i) visit(here.at[i]);
        here.count = 0;
        level = 1;
      } else if (here.next == here.count) {
        here.next = here.count = 0;
        if (level++ == top) return nodes;
      } else {
        Found& below = found[level - 1];
        const auto look_into = [&](const auto& overlaps) {
          std::uint32_t next = here.next, count = 0;
          do {
            const std::uint32_t node = here.at[next++];
            count += add_children(node, overlaps(node_at(level - 1, node)), below.at + count);
          } while (next < here.count && count + kWide <= Found::kMax);
          nodes += next - here.next;
          here.next = next;
          below.count = count;
        };
        if (level == 1 && level_[0].high == 0)
          look_into(points);
        else
          look_into(boxes);
        if (level > 1) prefetch(level - 2, below);
        --level;
      }
    }
  }
  void prefetch(std::uint32_t level, const Found& found) const {
    constexpr std::uint32_t kLine = 16;
    for (std::uint32_t i = 0; i < found.count; ++i) {
      const float* begin = sides(level, found.at[i]);
      for (std::uint32_t k = 0; k < level_[level].floats; k += kLine) __builtin_prefetch(begin + k);
    }
  }

  static constexpr std::uint32_t kMaxLevels = 11;  // of 2^31 items
  HugeVector<float> sides_;
  std::array<Level, kMaxLevels> level_{};  // the children of level 0 are the items
  std::uint32_t count_ = 0, levels_ = 0;
};

}  // namespace candela::transport
