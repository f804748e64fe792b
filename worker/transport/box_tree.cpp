#include "worker/transport/box_tree.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "common/base/work_monitor.h"

namespace candela::transport {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr ItemBox kEmpty{{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};

ItemBox both(const ItemBox& a, const ItemBox& b) {
  return {{std::min(a.low.x, b.low.x), std::min(a.low.y, b.low.y), std::min(a.low.z, b.low.z)},
          {std::max(a.high.x, b.high.x), std::max(a.high.y, b.high.y), std::max(a.high.z, b.high.z)}};
}

struct alignas(16) Center {
  float at[3];
  std::uint32_t index;
};

constexpr std::size_t kAlone = 4096;  // items that are not worth another thread

// The longest side of the centers' box.
struct Side {
  int axis;
  float low, length;
};
Side longest_side(std::span<const Center> items) {
  const auto load = [](const Center& item) { return _mm_load_ps(item.at); };  // and the index, for nothing
  __m128 least = load(items[0]), most = least;
  for (const Center& item : items) {
    least = _mm_min_ps(least, load(item));
    most = _mm_max_ps(most, load(item));
  }
  alignas(16) float low[4], length[4];
  _mm_store_ps(low, least);
  _mm_store_ps(length, _mm_sub_ps(most, least));
  const auto axis = static_cast<int>(std::max_element(length, length + 3) - length);
  return {axis, low[axis], length[axis]};
}

// Moves the items for which is_first() is true before the others, and returns their number. It has no branch
// on is_first(), which would be mispredicted for half of the items.
template <class IsFirst>
std::size_t partition(std::span<Center> items, const IsFirst& is_first) {
  std::size_t count = 0;
  for (Center& item : items) {
    const Center moved = item;
    item = items[count];
    items[count] = moved;
    count += is_first(moved) ? 1 : 0;
  }
  return count;
}

// Moves the `first` items with the least centers along a side before the others. The index decides among
// equal centers, so that the two parts do not depend on how they are found.
void select(std::span<Center> items, std::size_t first, const Side& side) {
  constexpr std::size_t kFew = 512;
  constexpr int kBins = 256;
  const int axis = side.axis;
  if (const float scale = kBins / side.length;
      items.size() > kFew && scale > 0 && scale < std::numeric_limits<float>::infinity()) {
    const auto bin_of = [&](const Center& item) {
      return std::min(static_cast<int>((item.at[axis] - side.low) * scale), kBins - 1);
    };
    std::uint32_t counts[kBins] = {};
    for (const Center& item : items) ++counts[bin_of(item)];
    int bin = 0;  // that has the first of the others
    std::size_t below = 0;
    while (below + counts[bin] <= first) below += counts[bin++];
    partition(items, [&](const Center& item) { return bin_of(item) < bin; });
    items = items.subspan(below);
    first -= below;
    partition(items, [&](const Center& item) { return bin_of(item) == bin; });
    items = items.first(counts[bin]);
  }
  std::nth_element(items.begin(), items.begin() + static_cast<std::ptrdiff_t>(first), items.end(),
                   [axis](const Center& a, const Center& b) {
                     return a.at[axis] != b.at[axis] ? a.at[axis] < b.at[axis] : a.index < b.index;
                   });
}

// Orders the items so that those of each subtree are near each other. A range is cut in two across the
// longest side of its centers' box. The first part fills its subtree: the greatest power of two that leaves
// something to the second.
void arrange(std::span<Center> items) {
  constexpr std::size_t kGroup = BoxTree::kWide;
  if (items.size() <= kGroup) {
    std::sort(items.begin(), items.end(), [](const Center& a, const Center& b) { return a.index < b.index; });
    return;
  }
  if (items.size() > kAlone) work_step();
  const std::size_t first = std::bit_ceil(items.size()) / 2;
  select(items, first, longest_side(items));
  const auto arrange_first = [&, monitor = watched_work()] {
    const WatchedWork watch(monitor);
    arrange(items.first(first));
  };
  const auto arrange_rest = [&, monitor = watched_work()] {
    const WatchedWork watch(monitor);
    arrange(items.subspan(first));
  };
  if (items.size() > kAlone) {
    tbb::parallel_invoke(arrange_first, arrange_rest);
  } else {
    arrange_first();
    arrange_rest();
  }
}

}  // namespace

std::vector<std::uint32_t> BoxTree::build(std::span<const ItemBox> boxes, unsigned threads) {
  return build_levels(boxes, false, threads);
}

std::vector<std::uint32_t> BoxTree::build(std::span<const Vec3> points, unsigned threads) {
  std::vector<ItemBox> boxes(points.size());
  std::transform(points.begin(), points.end(), boxes.begin(), [](Vec3 p) { return ItemBox{p, p}; });
  return build_levels(boxes, true, threads);
}

std::vector<std::uint32_t> BoxTree::build_levels(std::span<const ItemBox> boxes, bool points,
                                                 unsigned threads) {
  count_ = static_cast<std::uint32_t>(boxes.size());
  levels_ = 0;
  if (count_ == 0) return {};
  tbb::task_arena arena(static_cast<int>(std::max(1u, threads)));
  std::vector<Center> order(count_);
  std::vector<std::uint32_t> slots(count_);
  arena.execute([&, monitor = watched_work()] {
    const WatchedWork watch(monitor);
    tbb::parallel_for(std::uint32_t{0}, count_, [&](std::uint32_t i) {
      const auto center = [](float a, float b) { return 0.5f * a + 0.5f * b; };
      const auto& [low, high] = boxes[i];
      order[i] = {{center(low.x, high.x), center(low.y, high.y), center(low.z, high.z)}, i};
    });
    arrange(order);

    const auto nodes_above = [](std::uint32_t children) { return (children + kWide - 1) / kWide; };
    std::size_t floats = 0;
    std::uint32_t children = count_;
    do {
      const bool alike = points && levels_ == 0;
      level_[levels_] = {floats, alike ? kSide : 2 * kSide, alike ? 0 : kSide};
      children = nodes_above(children);
      floats += std::size_t{level_[levels_++].floats} * children;
    } while (children > 1);
    sides_.resize(floats);
    std::vector<ItemBox> below(count_);
    tbb::parallel_for(std::uint32_t{0}, count_, [&](std::uint32_t slot) {
      slots[slot] = order[slot].index;
      below[slot] = boxes[slots[slot]];
    });
    for (std::uint32_t level = 0; level < levels_; ++level) {
      const auto count = static_cast<std::uint32_t>(below.size());
      std::vector<ItemBox> here(nodes_above(count));
      tbb::parallel_for(std::uint32_t{0}, static_cast<std::uint32_t>(here.size()), [&](std::uint32_t i) {
        float* low = sides_.data() + level_[level].first + std::size_t{level_[level].floats} * i;
        float* high = low + level_[level].high;
        std::fill(low, low + level_[level].floats, kInfinity);
        ItemBox whole = kEmpty;
        for (std::uint32_t k = 0; k < std::min(kWide, count - kWide * i); ++k) {
          const ItemBox& box = below[kWide * i + k];
          whole = both(whole, box);
          for (std::uint32_t axis = 0; axis < 3; ++axis) {
            low[axis * kWide + k] = box.low[axis];
            high[axis * kWide + k] = box.high[axis];
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
