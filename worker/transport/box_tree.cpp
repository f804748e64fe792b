#include "worker/transport/box_tree.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <limits>
#include <utility>

namespace candela::transport {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr ItemBox kEmpty{{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};

ItemBox both(const ItemBox& a, const ItemBox& b) {
  return {{std::min(a.low.x, b.low.x), std::min(a.low.y, b.low.y), std::min(a.low.z, b.low.z)},
          {std::max(a.high.x, b.high.x), std::max(a.high.y, b.high.y), std::max(a.high.z, b.high.z)}};
}

// The lowest 21 bits, each followed by two zeros.
std::uint64_t spread(std::uint64_t x) {
  x = (x | x << 32) & 0x1f00000000ffffULL;
  x = (x | x << 16) & 0x1f0000ff0000ffULL;
  x = (x | x << 8) & 0x100f00f00f00f00fULL;
  x = (x | x << 4) & 0x10c30c30c30c30c3ULL;
  return (x | x << 2) & 0x1249249249249249ULL;
}

struct Coded {
  std::uint64_t code;
  std::uint32_t index;
  friend bool operator<(const Coded& a, const Coded& b) {
    return a.code != b.code ? a.code < b.code : a.index < b.index;
  }
};

}  // namespace

std::vector<std::uint32_t> BoxTree::build(std::span<const ItemBox> boxes, unsigned threads) {
  count_ = static_cast<std::uint32_t>(boxes.size());
  nodes_.clear();
  levels_ = 0;
  if (count_ == 0) return {};
  ItemBox all = kEmpty;
  for (const ItemBox& box : boxes) all = both(all, box);
  const Vec3d low(all.low), size = Vec3d(all.high) - low;
  const double longest = std::max({size.x, size.y, size.z});
  const double scale = longest > 0 ? 2097151.0 / longest : 0;

  tbb::task_arena arena(static_cast<int>(std::max(1u, threads)));
  std::vector<Coded> order(count_);
  std::vector<std::uint32_t> slots(count_);
  arena.execute([&] {
    tbb::parallel_for(std::uint32_t{0}, count_, [&](std::uint32_t i) {
      const Vec3d center = (Vec3d(boxes[i].low) + Vec3d(boxes[i].high)) * 0.5 - low;
      order[i] = {spread(static_cast<std::uint64_t>(center.x * scale)) << 2 |
                      spread(static_cast<std::uint64_t>(center.y * scale)) << 1 |
                      spread(static_cast<std::uint64_t>(center.z * scale)),
                  i};
    });
    tbb::parallel_sort(order.begin(), order.end());  // no two are equal: one order

    std::uint32_t children = (count_ + kLeaf - 1) / kLeaf, nodes = 0;
    const std::uint32_t leaves = children;
    do {
      first_[levels_++] = nodes;
      children = (children + kWide - 1) / kWide;
      nodes += children;
    } while (children > 1);
    Node none;
    for (auto* sides : {&none.low, &none.high})
      for (auto& side : *sides) std::fill(std::begin(side), std::end(side), kInfinity);
    nodes_.assign(nodes, none);
    std::vector<ItemBox> below(leaves);
    tbb::parallel_for(std::uint32_t{0}, leaves, [&](std::uint32_t leaf) {
      ItemBox box = kEmpty;
      for (std::uint32_t slot = leaf * kLeaf; slot < std::min((leaf + 1) * kLeaf, count_); ++slot) {
        slots[slot] = order[slot].index;
        box = both(box, boxes[slots[slot]]);
      }
      below[leaf] = box;
    });
    for (std::uint32_t level = 0; level < levels_; ++level) {
      const auto count = static_cast<std::uint32_t>(below.size());
      std::vector<ItemBox> here((count + kWide - 1) / kWide);
      tbb::parallel_for(std::uint32_t{0}, static_cast<std::uint32_t>(here.size()), [&](std::uint32_t i) {
        Node& node = nodes_[first_[level] + i];
        ItemBox whole = kEmpty;
        for (std::uint32_t k = 0; k < std::min(kWide, count - kWide * i); ++k) {
          const ItemBox& box = below[kWide * i + k];
          whole = both(whole, box);
          for (int axis = 0; axis < 3; ++axis) {
            node.low[axis][k] = box.low[axis];
            node.high[axis][k] = box.high[axis];
          }
        }
        here[i] = whole;
      });
      below = std::move(here);
    }
  });
  return slots;
}

}  // namespace candela::transport
