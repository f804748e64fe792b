// A binary tree of boxes over points or pieces of beams: which of them lie within a radius of a point, or of
// a segment. The items are in the order of Morton codes of their boxes' centers, in leaves of kLeaf; the tree
// over the leaves is complete, so that it needs no indices. The order of visits depends on the items alone.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
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
  static constexpr std::uint32_t kLeaf = 4;

  // Returns the items' order: slot -> index. Fewer than 2^31 items, all boxes finite.
  std::vector<std::uint32_t> build(std::span<const ItemBox> boxes, unsigned threads);

  // visit(first, end): slots of a leaf whose box comes within the radius, in rising order.
  template <class Visit>
  void near_point(Vec3 p, float radius, Visit&& visit) const {
    const float r = widened(radius, p);
    traverse(
        [&](const ItemBox& box) {
          return p.x >= box.low.x - r && p.x <= box.high.x + r && p.y >= box.low.y - r &&
                 p.y <= box.high.y + r && p.z >= box.low.z - r && p.z <= box.high.z + r;
        },
        visit);
  }
  template <class Visit>
  void near_segment(const QuerySegment& s, float radius, Visit&& visit) const {
    const float r = widened(radius, s.origin);
    const Vec3 inverse{inverse_of(s.direction.x), inverse_of(s.direction.y), inverse_of(s.direction.z)};
    traverse(
        [&](const ItemBox& box) {
          if (!(box.low.x <= box.high.x)) return false;  // empty
          const float ax = (box.low.x - r - s.origin.x) * inverse.x,
                      bx = (box.high.x + r - s.origin.x) * inverse.x;
          const float ay = (box.low.y - r - s.origin.y) * inverse.y,
                      by = (box.high.y + r - s.origin.y) * inverse.y;
          const float az = (box.low.z - r - s.origin.z) * inverse.z,
                      bz = (box.high.z + r - s.origin.z) * inverse.z;
          const float enter = std::max(std::max(std::min(ax, bx), std::min(ay, by)), std::min(az, bz));
          const float leave = std::min(std::min(std::max(ax, bx), std::max(ay, by)), std::max(az, bz));
          return enter <= leave * kSlack && leave >= 0 && enter <= s.length;
        },
        visit);
  }

  std::uint32_t size() const { return count_; }
  std::uint64_t bytes() const { return nodes_.capacity() * sizeof(ItemBox); }

 private:
  static constexpr float kSlack = 1 + 0x1p-20f;  // of slabs' rounding

  // Rounding in the tests must not lose an item that is within the radius.
  static float widened(float radius, Vec3 p) {
    const float largest = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    return radius * (1 + 0x1p-16f) + largest * 0x1p-20f;
  }
  static float inverse_of(float d) {
    return 1 / (std::abs(d) > 1e-20f ? d : std::copysign(1e-20f, d));  // no product of 0 and infinity
  }

  template <class Overlaps, class Visit>
  void traverse(const Overlaps& overlaps, Visit& visit) const {
    if (count_ == 0 || !overlaps(nodes_[1])) return;
    std::array<std::uint32_t, 64> stack;
    std::uint32_t top = 0;
    for (std::uint32_t node = 1;;) {
      if (node >= leaves_) {
        const std::uint32_t first = (node - leaves_) * kLeaf;
        visit(first, std::min(first + kLeaf, count_));
      } else {
        const std::uint32_t left = 2 * node;
        const bool goes_left = overlaps(nodes_[left]), goes_right = overlaps(nodes_[left + 1]);
        if (goes_left) {
          if (goes_right) stack[top++] = left + 1;
          node = left;
          continue;
        }
        if (goes_right) {
          node = left + 1;
          continue;
        }
      }
      if (top == 0) return;
      node = stack[--top];
    }
  }

  std::vector<ItemBox> nodes_;  // of a heap: 1 is the root, the children of i are 2 i and 2 i + 1
  std::uint32_t count_ = 0, leaves_ = 0;
};

}  // namespace candela::transport
