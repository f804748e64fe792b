// Gaussian proposals of slopes, and the densities of the two mutations that use them
// [half-vector note, sections 9 to 12].
//
// The precision of vertex i's step,
//   Lambda_i = 2 / (gamma alpha_i)^2 I + K_i^T K_i / (w_i s)^2,
// adds what the lobe's roughness and the image allow: K_i moves the film position, in pixels, per unit of
// c_i; s is the step wanted on the film, of which the vertex has the share w_i = alpha_i / sum alpha_j.
// Lambda depends on the chain, so densities of both directions are evaluated.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "worker/transport/manifold/block_tridiagonal.h"
#include "worker/transport/manifold/chain.h"
#include "worker/transport/manifold/surfaces.h"

namespace candela::transport::manifold {

struct StepRules {
  double gamma = 1;        // proposal's roughness over the lobe's
  double image_step = 20;  // s, in pixels
};

// A chain with all that its mutations need. The Jacobian is that of slopes.
struct PreparedChain {
  Chain chain;
  std::vector<double> alphas;  // by inner vertex; 0: specular, its slope is held at 0
  std::vector<Pair> slopes;
  std::vector<Blocks> blocks;
  BlockTridiagonal jacobian;
  std::vector<Mat2> precisions;  // of vertices that are not specular
  bool from_sensor = false;      // of projections
};

// to_film: pixels per unit of the tangent coordinates of the last inner vertex. Nothing: the chain has no
// half vectors or no inverse of its Jacobian.
std::optional<PreparedChain> prepare(Chain chain, std::vector<double> alphas, const Mat2& to_film,
                                     const StepRules& rules);

// Slopes of a proposal; normals: two independent standard normal numbers for each inner vertex.
std::vector<Pair> propose_slopes(const PreparedChain& from, std::span<const Pair> normals);
// log T in the measure of slopes. For a walk `to` has the slopes at which the walk arrived.
double log_pdf_slopes(const PreparedChain& from, std::span<const Pair> to);

// A pair of independent standard normal numbers from two uniform ones in [0, 1).
Pair normal_pair(double u, double v);

// The one-step mutation: predicted by the Jacobian, projected, and no walk. The chain has no specular
// vertex. False: a ray misses.
bool propose_one_step(const PreparedChain& from, std::span<const Pair> slopes, const Surfaces& surfaces,
                      Chain& to);
// Its log density in the product of area measures, from the two chains alone:
//   q = p(c' | c) |J| prod G(y_{i-1}, y_i) / G(y_{i-1}, x'_i)
// with x'_i the predicted place on the tangent plane at x_i, and c' = c + J (x' - x). Nothing: the mutation
// never proposes it. slopes: if given gets c'.
std::optional<double> log_pdf_one_step_area(const PreparedChain& from, const Chain& to,
                                            std::vector<Pair>* slopes = nullptr);

}  // namespace candela::transport::manifold
