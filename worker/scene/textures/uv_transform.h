// The transformation of (u, v) that a texture applies before its lookup.
#pragma once

#include <algorithm>
#include <limits>

#include "common/description/object.h"
#include "worker/core/vec.h"

namespace candela::scene {

// The upper left 2 x 3 part of to_uv that acts on (u, v, 1). Mitsuba takes the upper left 3 x 3 block of a 4
// x 4 matrix as the affine map of the plane, and the XML's translate and scale write a 4 x 4 one, whose
// translation is in the last column.
struct UvTransform {
  double m[2][3] = {{1, 0, 0}, {0, 1, 0}};
  bool identity = true;

  Vec2 operator()(Vec2 uv) const {
    if (identity) return uv;
    return {static_cast<float>(m[0][0] * uv.x + m[0][1] * uv.y + m[0][2]),
            static_cast<float>(m[1][0] * uv.x + m[1][1] * uv.y + m[1][2])};
  }
  // The chain rule: from derivatives by the transformed coordinates to those by (u, v).
  Vec2 gradient(double dx, double dy) const {
    return {finite(m[0][0] * dx + m[1][0] * dy), finite(m[0][1] * dx + m[1][1] * dy)};
  }
  static UvTransform from(const description::Object& object) {
    UvTransform t;
    if (object.find("to_uv") == nullptr) return t;
    const description::Mat4 a = object.get_transform("to_uv");
    t.identity = false;
    for (std::size_t row = 0; row < 2; ++row) {
      t.m[row][0] = a[4 * row];
      t.m[row][1] = a[4 * row + 1];
      t.m[row][2] = a[4 * row + 3];
    }
    return t;
  }

 private:
  static float finite(double v) {
    constexpr double largest = std::numeric_limits<float>::max();
    return static_cast<float>(std::clamp(v, -largest, largest));
  }
};

}  // namespace candela::scene
