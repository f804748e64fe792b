// An axis-aligned box.
#pragma once

#include <algorithm>

#include "worker/core/vec.h"

namespace candela::scene {

struct Bounds {
  Vec3d low{1e300, 1e300, 1e300}, high{-1e300, -1e300, -1e300};
  bool empty() const { return !(low.x <= high.x); }
  void add(Vec3d p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  void add(const Bounds& b) {
    if (b.empty()) return;
    add(b.low);
    add(b.high);
  }
  Vec3d center() const { return empty() ? Vec3d{} : (low + high) * 0.5; }
  double radius() const { return empty() ? 0.0 : length(high - low) * 0.5; }
};

inline bool overlap(const Bounds& a, const Bounds& b) {
  return a.low.x <= b.high.x && b.low.x <= a.high.x && a.low.y <= b.high.y && b.low.y <= a.high.y &&
         a.low.z <= b.high.z && b.low.z <= a.high.z;
}

}  // namespace candela::scene
