// A path from a light to the sensor as a state of a Markov chain: vertices that name where they are, from
// which all numbers follow, and the edges between them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "worker/core/vec.h"
#include "worker/scene/points/canonical_point.h"

namespace candela::transport::path {

enum class Kind : std::uint8_t {
  surface_light,   // a point on an area emitter
  point_light,     // an emitter with a place alone; that is its own
  directed_light,  // an emitter with a direction alone; that is its own
  distant_light,   // a direction to light from outside the scene
  surface,
  medium,
  sensor
};
inline constexpr std::size_t kKinds = 7;

struct PathVertex {
  Kind kind = Kind::surface;
  // Surfaces: the path turns here by a delta lobe, which transmits or reflects. Two paths that differ in
  // a flag alone are two states.
  bool delta = false, transmitted = false;
  // The path turns here by a delta lobe that has the form of a cone (mollified.h). Then `delta` is false.
  bool mollified = false;
  std::uint32_t object = scene::kNone;  // the index of the emitter, or of the medium
  scene::CanonicalPoint point;          // of surfaces and surface lights
  // Medium: the place. Distant light: the unit direction to it. Sensor: x and y are the numbers that choose
  // the point on the lens.
  Vec3d place;

  friend bool operator==(const PathVertex&, const PathVertex&) = default;
};

constexpr bool is_light(Kind kind) {
  return kind <= Kind::distant_light;
}
constexpr bool is_on_surface(Kind kind) {
  return kind == Kind::surface_light || kind == Kind::surface;
}

// From a vertex to the next one, towards the sensor.
struct PathEdge {
  Vec3d direction;    // unit
  double length = 0;  // 0: one of its ends is infinitely far away
};

// The vertices [begin, end) of a path, which a mutation replaces. Nothing else of the path changes.
struct PathRange {
  std::size_t begin = 0, end = 0;
};

struct Path {
  std::vector<PathVertex> vertices;  // x_0, on the light, to x_k, on the sensor

  std::size_t edge_count() const { return vertices.empty() ? 0 : vertices.size() - 1; }  // k
  std::size_t inner_count() const { return vertices.size() < 2 ? 0 : vertices.size() - 2; }
  Path replaced(PathRange range, std::span<const PathVertex> by) const;
  // A light, vertices that scatter, and the sensor.
  bool well_formed() const;

  friend bool operator==(const Path&, const Path&) = default;
};

// The smallest range of `from` that has to be replaced to make `to` of it; `from` and `to` may differ in
// length.
PathRange changed_range(const Path& from, const Path& to);

// Origin of a chain's first path: the sample of the bootstrap, and of its subpaths the numbers of
// vertices from the light and from the sensor that were joined.
struct PathSeed {
  std::uint64_t sample = 0;
  std::uint32_t light_vertices = 0, sensor_vertices = 0;
  friend bool operator==(const PathSeed&, const PathSeed&) = default;
};

}  // namespace candela::transport::path
