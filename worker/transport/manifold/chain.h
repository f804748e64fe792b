// A chain of surface vertices between two ends, as half vectors see it [half-vector note, sections 2 to 5].
// Vertex 0 is the end towards the light, the last one that towards the sensor.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "worker/core/vec.h"
#include "worker/scene/points/canonical_point.h"
#include "worker/transport/manifold/mat2.h"

namespace candela::transport::manifold {

enum class Scatter : std::uint8_t { end, reflect, refract };

struct ChainVertex {
  Vec3d x;
  Vec3d ng, n;     // unit geometric and shading normal
  Vec3d p_u, p_v;  // orthonormal tangents, perpendicular to ng
  Vec3d n_u, n_v;  // derivatives of n along them
  double eta = 1;  // index on the side of the next vertex over that on the side of the one before
  Scatter scatter = Scatter::end;
  // For the scene that the vertex is in: its name, and how far off the surface a ray has to start.
  scene::CanonicalPoint point;
  double error = 0;
};

// The end towards the light. point: its cosine does not count. direction: x is the unit direction to the
// light, and p_u, p_v are perpendicular to it.
enum class FirstEnd : std::uint8_t { point, surface, direction };

struct Chain {
  FirstEnd first = FirstEnd::point;
  std::vector<ChainVertex> vertices;

  std::size_t inner_count() const { return vertices.size() - 2; }
  bool from_direction() const { return first == FirstEnd::direction; }
  // Unit directions from vertex i, which is no end, towards the light and towards the sensor.
  Vec3d to_light(std::size_t i) const;
  Vec3d to_sensor(std::size_t i) const;
  // The longest edge.
  double size() const;
};

// Makes p_u and p_v orthonormal, and n_u, n_v the derivatives along them. False: the tangents span no plane.
bool orthonormalize(ChainVertex& vertex);

// Why a chain has no half vectors, or none that can be used.
enum class Fault : std::uint8_t {
  none,
  coincident,  // an edge below 1e-6 of the longest
  grazing,     // the half vector lies in the surface
  frame,       // the normal is where the frame is singular
  side,        // the vertex reflects or refracts to the wrong side
  not_finite
};
const char* name_of(Fault fault);

// [half-vector note, sections 2 and 16]
Fault fault_of(const Chain& chain);

}  // namespace candela::transport::manifold
