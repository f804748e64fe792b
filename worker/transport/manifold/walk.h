// Newton's walk of a chain to given slopes: a predictor in the tangent planes, a corrector by rays
// [half-vector note, section 10; Jakob 2012, Sec. 4]. It is a function of the chain and the targets alone:
// no random numbers, no limits of time, no state that adapts.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "worker/transport/manifold/block_tridiagonal.h"
#include "worker/transport/manifold/chain.h"
#include "worker/transport/manifold/surfaces.h"

namespace candela::transport::manifold {

struct WalkRules {
  std::uint32_t max_iterations = 15;
  double min_step = 1.0 / 40;
  // Maximum distance of the end of a walk back from the first start, over the size of the chain.
  double return_distance = 1e-6;
};

// Largest error of a constraint at which a walk ends; alpha 0: specular. The note's (section 10), but at most
// 1e-8: a walk that ends at 1e-4 of a wide lobe does not come back to within return_distance.
double tolerance(double gamma, double alpha);

enum class WalkEnd : std::uint8_t {
  converged,
  singular,       // J has no inverse
  short_step,     // no step that is long enough lowers the error
  iterations,     // too many of them
  unusable_start  // the chain has no half vectors
};

struct Walked {
  WalkEnd end = WalkEnd::converged;
  std::uint32_t iterations = 0;
  bool converged() const { return end == WalkEnd::converged; }
};

// The end from which predicted points are projected onto surfaces: the one from which the first-order change
// of the chain is smaller. A direction is no place for a ray to start.
bool projects_from_sensor(const Chain& chain, const BlockTridiagonal& factored);

// Each inner vertex becomes what a ray from its already projected neighbor towards its predicted place meets.
bool project(Chain& chain, std::span<const Vec3d> predicted, bool from_sensor, const Surfaces& surfaces);

// The places of the inner vertices after steps in their tangent planes.
std::vector<Vec3d> predicted_places(const Chain& chain, std::span<const Pair> steps);

// Moves the inner vertices until their slopes are `targets`, by inner vertex; the ends are where they are to
// be. tolerances: by inner vertex. If it does not converge the chain is left in any state.
Walked walk(Chain& chain, std::span<const Pair> targets, std::span<const double> tolerances,
            const Surfaces& surfaces, const WalkRules& rules);

// True if the walk from `moved` to the slopes `back` of `start`, with the ends of `start`, arrives there. A
// mutation that fails this test is rejected; without it detailed balance does not hold.
bool returns(const Chain& moved, const Chain& start, std::span<const Pair> back,
             std::span<const double> tolerances, const Surfaces& surfaces, const WalkRules& rules);

}  // namespace candela::transport::manifold
