// The constraint of a vertex of a chain, its half vector in the frame of its shading normal, and the
// derivatives by the vertex and its neighbors [half-vector note, sections 2 to 5; Jakob 2012].
//
// H = i + eta o, with i towards the light, o towards the sensor.
//   slope   c = (s.H, t.H) / (n.H)                 all of the plane
//   disk    c = sgn(n.H) (s.H, t.H) / |H|          the unit disk
// c = 0 is the law of reflection, or Snell's.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/transport/manifold/chain.h"
#include "worker/transport/manifold/mat2.h"

namespace candela::transport::manifold {

enum class Form : std::uint8_t { slope, disk };

// Derivatives of the constraint of vertex i by its neighbor towards the light (a), itself (b), and its
// neighbor towards the sensor (c), in the tangent coordinates of each.
struct Blocks {
  Mat2 a, b, c;
};

// Precondition of all: fault_of(chain) is none.
Pair constraint(Form form, const Chain& chain, std::size_t i);
Blocks blocks(Form form, const Chain& chain, std::size_t i);

// For all inner vertices, in order.
std::vector<Pair> constraints(Form form, const Chain& chain);
std::vector<Blocks> blocks(Form form, const Chain& chain);

// |d omega_i / d c| at vertex i for a fixed direction towards the sensor, omega_i the direction towards the
// light per solid angle: the delta function of a slope is that of this direction times it.
double light_angle_by_constraint(const Chain& chain, std::size_t i);

}  // namespace candela::transport::manifold
