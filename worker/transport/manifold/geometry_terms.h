// The geometric part of a chain's contribution, in area measure and in the measure of half vectors
// [half-vector note, sections 1 and 7; Kaplanyan 2017, Eq. 7.5 and 7.7].
//
//   prod G_i / |J| = |d o_0_perp / d x_k|_c  prod |d o_i_perp / d c_i|
//
// The right side needs no 1 / l^2 and no inverse: pencil() has its first factor by two differentials that
// run along the chain [Igehy 1999]. It keeps its digits in corners, where the left side loses them.
#pragma once

#include <vector>

#include "worker/transport/manifold/chain.h"
#include "worker/transport/manifold/constraint.h"

namespace candela::transport::manifold {

// G_i of the edge from vertex i to the next one: the shading normal's cosine here, the geometric one there.
// From a direction: the cosine there alone.
double geometry_term(const Chain& chain, std::size_t i);

// |d o_perp / d c| at vertex i for a fixed direction towards the light.
double projected_by_constraint(Form form, const Chain& chain, std::size_t i);

// |d omega_i / d c| at vertex i for a fixed direction towards the sensor, omega_i the direction towards the
// light per solid angle: the delta function of a slope is that of this direction times it.
double light_angle_by_constraint(const Chain& chain, std::size_t i);

// log |d o_0_perp / d x_k| with all slopes fixed: the log of the generalized geometric term from the first
// end to the last. From a direction: of the area across it. Infinite at a caustic on x_k.
double log_pencil(const Chain& chain);

// log of prod G_i / |J| by the pencil, in the form's measure. specular: by inner vertex, whether its
// constraint is held: then its factor is left to the bsdf; empty: none.
double log_contribution(Form form, const Chain& chain, const std::vector<bool>& specular = {});

}  // namespace candela::transport::manifold
