#include "worker/scene/emitters/choice/surface_lanes.h"

#include <cmath>
#include <cstring>

#include "worker/scene/emitters/cone.h"
#include "worker/scene/emitters/light_bounds.h"

// These functions are inlined: how vectors would be passed on processors without AVX does not matter.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace candela::scene {
namespace {

// GCC's and clang's vectors: arithmetic, comparisons and ?: by lane, rounded as a float each. Processors
// without vectors of eight floats get two of four.
using Floats = float __attribute__((vector_size(SurfaceLanes::kWidth * sizeof(float))));

inline Floats load(const std::array<float, SurfaceLanes::kWidth>& lane) {
  Floats out;
  std::memcpy(&out, lane.data(), sizeof(out));
  return out;
}
inline Floats all(float value) {
  return Floats{} + value;
}
inline Floats root(const Floats& x) {
  Floats out{};
  for (std::size_t k = 0; k < SurfaceLanes::kWidth; ++k) out[k] = std::sqrt(x[k]);
  return out;
}
// The values of std::min(a, b), std::max(a, b) and std::clamp(c, -1, 1).
inline Floats lesser(const Floats& a, const Floats& b) {
  return b < a ? b : a;
}
inline Floats greater(const Floats& a, const Floats& b) {
  return a < b ? b : a;
}
inline Floats as_cosine(const Floats& c) {
  return c < -1.0f ? all(-1.0f) : (c > 1.0f ? all(1.0f) : c);
}
inline Floats sine_of(const Floats& cosine) {
  return root(greater(all(0.0f), 1.0f - cosine * cosine));
}
// subtract_angle (cone.h).
inline void subtract(Floats& cos_a, Floats& sin_a, const Floats& cos_b, const Floats& sin_b) {
  const auto none = cos_a >= cos_b;
  const Floats c = cos_a * cos_b + sin_a * sin_b, s = sin_a * cos_b - cos_a * sin_b;
  cos_a = none ? all(1.0f) : c;
  sin_a = none ? all(0.0f) : s;
}

}  // namespace

void SurfaceLanes::add(std::uint32_t emitter, const SurfaceLane& lane) {
  if (blocks_.empty() || blocks_.back().used == kWidth) blocks_.emplace_back();
  Block& b = blocks_.back();
  const std::size_t k = b.used++;
  const auto place = [k](Lane& x, Lane& y, Lane& z, Vec3 v) {
    x[k] = v.x;
    y[k] = v.y;
    z[k] = v.z;
  };
  place(b.center_x, b.center_y, b.center_z, lane.extent.center);
  place(b.axis_x, b.axis_y, b.axis_z, lane.extent.axis);
  place(b.corner_x, b.corner_y, b.corner_z, lane.corner);
  place(b.normal_x, b.normal_y, b.normal_z, lane.normal);
  b.radius[k] = lane.extent.radius;
  b.cos_spread[k] = lane.extent.cos_spread;
  b.sin_spread[k] = lane.extent.sin_spread;
  b.cone[k] = lane.cone ? 1.0f : 0.0f;
  b.strength[k] = lane.strength;
  b.flat[k] = is_zero(lane.normal) ? 0.0f : 1.0f;
  b.emitter[k] = emitter;
  if (lane.ask) to_ask_.push_back(emitter);
}

// SurfaceExtent::importance, line by line, for eight surfaces.
void SurfaceLanes::importances(Vec3 p, Vec3 front, float* of_emitters) const {
  const bool both_sides = is_zero(front);
  for (const Block& b : blocks_) {
    const Floats vx = load(b.center_x) - p.x, vy = load(b.center_y) - p.y, vz = load(b.center_z) - p.z;
    const Floats d2 = vx * vx + vy * vy + vz * vz;
    const Floats radius = load(b.radius), strength = load(b.strength);
    const Floats r2 = greater(radius * radius, all(1e-36f));
    const Floats d = root(d2), inverse_d = 1.0f / d;
    const Floats sin_extent = lesser(all(1.0f), radius * inverse_d), cos_extent = sine_of(sin_extent);
    Floats result = strength * inverse_d * inverse_d;

    const Floats facing = load(b.axis_x) * vx + load(b.axis_y) * vy + load(b.axis_z) * vz;
    Floats c = as_cosine(-facing * inverse_d), s = sine_of(c);
    subtract(c, s, load(b.cos_spread), load(b.sin_spread));
    subtract(c, s, cos_extent, sin_extent);
    const auto cone = load(b.cone) > 0.0f;
    result *= cone ? greater(c, all(kMinBoundCosine)) : all(1.0f);
    auto dark = cone & (c < -kCosineSlack);

    // At the reference. Light from both sides of it has no cosine there.
    const Floats h = front.x * vx + front.y * vy + front.z * vz;
    auto below = h <= -radius * (1 + kCosineSlack) - kCosineSlack * d;
    if (both_sides) {
      below = below & (h < h);  // nowhere
    } else {
      c = as_cosine(h * inverse_d);
      s = sine_of(c);
      subtract(c, s, cos_extent, sin_extent);
      result *= greater(c, all(kMinBoundCosine));
    }

    result = dark ? all(0.0f) : lesser(result, all(kMaxImportance));
    result = d2 <= r2 ? lesser(strength / r2, all(kMaxImportance)) : result;
    const Floats before = (p.x - load(b.corner_x)) * load(b.normal_x) +
                          (p.y - load(b.corner_y)) * load(b.normal_y) +
                          (p.z - load(b.corner_z)) * load(b.normal_z);
    const auto behind = (load(b.flat) > 0.0f) & ~(before > 0.0f);
    result = (below | behind) ? all(0.0f) : result;
    for (std::uint32_t k = 0; k < b.used; ++k) of_emitters[b.emitter[k]] = result[k];
  }
}

}  // namespace candela::scene
