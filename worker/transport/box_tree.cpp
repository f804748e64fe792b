#include "worker/transport/box_tree.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>
#include <tbb/task_arena.h>

#include <limits>

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
  leaves_ = 0;
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

    const std::uint32_t used = (count_ + kLeaf - 1) / kLeaf;
    leaves_ = 1;
    while (leaves_ < used) leaves_ *= 2;
    nodes_.assign(std::size_t{2} * leaves_, kEmpty);
    tbb::parallel_for(std::uint32_t{0}, used, [&](std::uint32_t leaf) {
      ItemBox box = kEmpty;
      for (std::uint32_t slot = leaf * kLeaf; slot < std::min((leaf + 1) * kLeaf, count_); ++slot) {
        slots[slot] = order[slot].index;
        box = both(box, boxes[slots[slot]]);
      }
      nodes_[leaves_ + leaf] = box;
    });
    for (std::uint32_t level = leaves_ / 2; level > 0; level /= 2)
      tbb::parallel_for(level, 2 * level, [&](std::uint32_t node) {
        nodes_[node] = both(nodes_[2 * node], nodes_[2 * node + 1]);
      });
  });
  return slots;
}

}  // namespace candela::transport
