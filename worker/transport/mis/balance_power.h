// Weights of multiple importance sampling for paths made of an eye and a light subpath, with and without
// merging: the recursive form of [Georgiev 2012 TR, Eq. 31-40], rearranged so that the merging radius stays
// out of what a vertex stores.
//
// A path x_0 ... x_k runs from the light to the eye. P_i and Q_i are the densities of x_i as the light's and
// the eye's walk choose it: per area on surfaces, per volume in media, per solid angle for x_0 outside the
// scene, discrete where there is but one choice. The techniques that can make the path, by the number s of
// its vertices that came from the light, and their densities:
//   hit_light    s = 0      Q_0 Q_1 ... Q_k
//   next_event   s = 1      C_0 Q_1 ... Q_k,       C_0: x_0 chosen as seen from x_1
//   connect      1 < s < k  P_0 ... P_{s-1} Q_s ... Q_k
//   light_image  s = k      P_0 ... P_{k-1} C_k,   C_k: the lens' point as seen from x_{k-1}
//   hit_lens     s = k + 1  P_0 ... P_k
//   merge at x_s            P_0 ... P_s Q_s ... Q_k eta,   eta = number of light paths * effective area
//   (volume)
// times the samples each takes per eye path, which MisFactors holds: 0 where it is not run. A weight is one
// technique's density over the sum of all, raised to a power where the heuristic says so.
//
// For the densities with fewer vertices from the light than s, relative to P_0 ... P_s Q_s ... Q_k, the
// vertex x_s of a light subpath keeps
//   sum = known + q (pending + pending_surface eta_surface + pending_medium eta_medium),
// q: the density per solid angle with which the eye's walk would go from x_s to x_{s-1}, not known before the
// direction it comes from is; and the eye's vertices likewise, with the roles exchanged. In the report's
// terms known is dVCM, pending + pending_surface eta is dVC, and dVM is dVC / eta. All are ratios, so that
// long paths neither over- nor underflow; they are double because single factors span what floats cannot.
//
// Not part of any density: Russian roulette, surfaces passed straight, and the choice of the color channel
// of a flight. Weights need only be the same function of the path in all techniques.
//
// BalancePower is a policy of walks (walk.h): Block is what a vertex keeps, Departure what the walk carries
// from one vertex to the next, and the functions are the recursion in steps that know nothing of scenes.
#pragma once

#include <algorithm>

#include "worker/transport/mis/factors.h"
#include "worker/transport/mis/unweighted.h"

namespace candela::transport {

// Sums stay below it, so that no infinity meets an eta or a density of 0. Paths of any length have ratios far
// smaller, unless at each of a thousand vertices the two walks' densities differ by orders of magnitude.
inline constexpr double kMaxRatio = 1e250;

struct MisBlock {
  double known = 0;
  double pending = 0, pending_surface = 0, pending_medium = 0;

  // Further densities of a vertex, which weights need where the walk is, but no connection does later.
  struct Densities {
    bool previous_connects = false;  // the vertex before could be connected, in the direction the walk took
    // Density of the direction that the walk arrived by, per solid angle, survival included.
    double pdf_arrival = 0;
    // Density with which the walk chose this vertex: per area, or volume; survival included.
    double pdf_area = 0;
    // The reverse density is pdf_reverse (solid angle) times this; 1 at infinity.
    double back_area = 0;
    // Set by Walk::scatter: the density, towards the vertex before, of a walk of the other kind that comes
    // from the direction chosen. For delta lobes see Walk.
    double pdf_reverse = 0;
  };
};

// A walk between two of its vertices: what the next one's block will be made of.
struct MisDeparture {
  double pdf = 0;       // of the direction, per solid angle; infinite light's first edge: of the place, per
                        // area across it
  double leave = 0;     // (cosine or hazard at the vertex left) / pdf
  double connects = 0;  // 1 where the vertex left can be connected to; the first edge: see Walk
  MisBlock carried;     // of the vertex left; known + pdf_reverse * pending in its `pending`
};

// kBeta: 1 for the balance heuristic [Veach 1997, Eq. 9.8], 2 for the power heuristic [Veach 1997, Eq. 9.13].
template <int kBeta>
struct BalancePower {
  static_assert(kBeta == 1 || kBeta == 2);
  static constexpr bool kWeighs = true;
  static constexpr bool kMergesBeams = false;  // see beam_balance.h
  using Block = MisBlock;
  using Departure = MisDeparture;

  static double raise(double ratio) { return kBeta == 1 ? ratio : ratio * ratio; }

  // Relative densities of all techniques on this vertex's side of the path. pdf_reverse: q above.
  static double sum(const Block& block, double pdf_reverse, const MergeFactors& eta) {
    return block.known + raise(pdf_reverse) * sum_pending(block, eta);
  }
  static double sum_pending(const Block& block, const MergeFactors& eta) {
    return block.pending + block.pending_surface * eta.surface + block.pending_medium * eta.medium;
  }
  // The same sum for a walk under way. survival: of its edge.
  static double sum_departure(const Departure& d, const MergeFactors& eta, double /*survival*/) {
    return sum_pending(d.carried, eta);
  }

  // A walk leaves its end point, and then arrives at and leaves vertex after vertex. `pdf`, `cosine` or
  // `factor_out` (cosine or hazard at the vertex left): see Departure; `at`: cosine or hazard where the walk
  // arrives; pdf_area: of that vertex, per area or volume.

  // end_density: of the end point alone. can_be_hit: walks of the other kind may come upon it.
  static Departure leave_end(double hits, double end_density, bool can_be_hit, double pdf, double cosine) {
    Departure d;
    d.pdf = pdf;
    d.leave = cosine / pdf;
    d.connects = 1;
    d.carried.pending = can_be_hit ? hits * raise(1 / end_density) : 0;
    return d;
  }

  // At the light's walk's first vertex. direct_density: with which next event estimation there chooses the
  // light's point, 0 if it cannot; end_density: with which the walk chose it.
  static Block arrive_from_light(const Departure& d, const MisFactors& factors, double at, double pdf_area,
                                 double direct_density, double end_density) {
    Block block;
    if (direct_density > 0)
      block.known = factors.next_event * raise(direct_density / (end_density * pdf_area));
    block.pending = raise(d.leave / at) * d.carried.pending;
    return block;
  }

  // At the eye's walk's first vertex.
  static Block arrive_from_eye(const Departure& d, const MisFactors& factors, double at, double pdf_area,
                               double survival) {
    Block block;
    // The lens' point has the same density whether the eye's walk or a light path's connection chose it.
    block.known = factors.light_image * raise(1 / pdf_area);
    // A light path that meets the lens does so whatever its flight through the last medium (look_for_lens).
    block.pending = raise(d.leave / at) * d.carried.pending * raise(1 / survival);
    return block;
  }

  // At a later vertex, on a surface or in a medium. survival: of the edge that ends there.
  static Block arrive_later(const Departure& d, const MisFactors& factors, double at, double pdf_area,
                            bool /*surface*/ = true, double /*survival*/ = 1) {
    Block block;
    const double turned = raise(d.leave / at);
    if (d.connects > 0) block.known = factors.connect * raise(1 / pdf_area);
    block.pending = std::min(turned * d.carried.pending, kMaxRatio);
    block.pending_surface = std::min(turned * d.carried.pending_surface, kMaxRatio);
    block.pending_medium = std::min(turned * d.carried.pending_medium, kMaxRatio);
    return block;
  }

  // From the vertex of this block, by a delta lobe or not.
  static Departure leave_vertex(const Block& block, bool surface, bool delta, double pdf, double pdf_reverse,
                                double factor_out) {
    Departure d;
    d.pdf = pdf;
    d.leave = factor_out / pdf;
    d.connects = delta ? 0 : 1;
    const double reverse = raise(pdf_reverse);
    d.carried.pending = reverse * block.pending + (delta ? 0 : block.known);
    d.carried.pending_surface = reverse * block.pending_surface;
    d.carried.pending_medium = reverse * block.pending_medium;
    if (!delta) (surface ? d.carried.pending_surface : d.carried.pending_medium) += 1;
    return d;
  }
};

using Balance = BalancePower<1>;
using Power = BalancePower<2>;

}  // namespace candela::transport
