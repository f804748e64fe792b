// The balance heuristic with merges of points and beams in media: the extended balance heuristic
// [Krivanek 2014], where
//   PP : PB : BP : BB = N V_3 : N V_2 / e : N V_2 / l : N V_1 sin / (e l)
// at a vertex. e and l: the hazards where the eye's and the light's subpath have the vertex. In a merge these
// are two places, whose hazards differ in a grid; a vertex of one walk has one. With short beams eta is a
// function of the medium, the hazard and the angle alone, whatever the distances. Where beams are long, e and
// l are the hazards times the survival of the edge by which that subpath arrives (MediumMerges::at): a walk
// knows the survival of the edge by which it leaves a vertex when it arrives at the next one.
//
// Walks know eta: pending_medium holds the sum of the vertices' eta themselves, and MergeFactors::medium
// is 1.
#pragma once

#include "worker/core/vec.h"
#include "worker/transport/mis/balance_power.h"

namespace candela::transport {

inline double sine_between(Vec3 a, Vec3 b) {
  return length(cross(Vec3d(a), Vec3d(b)));  // the root of 1 - cos^2 has no digits at small angles
}

struct BeamBalance : BalancePower<1> {
  static constexpr bool kMergesBeams = true;
  struct Departure : MisDeparture {
    bool medium = false;    // the vertex left is in one
    double long_beams = 0;  // its merges that are to be divided by the survival of the edge under way
  };

  // The sum of all merges in media at a vertex; wo, wi: away from it.
  static double merges(const MediumMerges& m, float hazard, Vec3 wo, Vec3 wi, double light_edge,
                       double eye_edge) {
    const auto h = static_cast<double>(hazard);
    return m.at(h, h, sine_between(wo, wi), light_edge, eye_edge);
  }

  // The same for a walk that leaves a vertex. survival: of the edge that it arrived by.
  static MediumMerges::Leaving leaving(const MediumMerges& m, bool from_light, float hazard, Vec3 wo, Vec3 wi,
                                       float survival) {
    return m.leaving(from_light, static_cast<double>(hazard), sine_between(wo, wi),
                     static_cast<double>(survival));
  }

  static Departure leave_end(double hits, double end_density, bool can_be_hit, double pdf, double cosine) {
    return {BalancePower::leave_end(hits, end_density, can_be_hit, pdf, cosine)};
  }
  // As BalancePower, but two vertices in media are connected by chance (MisFactors::connect_media).
  static Block arrive_later(const Departure& d, const MisFactors& factors, double at, double pdf_area,
                            bool surface, double survival) {
    Block block;
    if (d.long_beams > 0) {
      Departure whole = d;
      whole.carried.pending_medium = pending_medium(d, survival);
      block = BalancePower::arrive_later(whole, factors, at, pdf_area);
    } else {
      block = BalancePower::arrive_later(d, factors, at, pdf_area);
    }
    if (d.medium && !surface) block.known *= factors.connect_media;
    return block;
  }
  // As BalancePower, without the merges at a vertex in a medium: those are add_merges'.
  static Departure leave_vertex(const Block& block, bool surface, bool delta, double pdf, double pdf_reverse,
                                double factor_out) {
    Departure d{BalancePower::leave_vertex(block, true, delta || !surface, pdf, pdf_reverse, factor_out),
                !surface};
    if (!surface) {
      d.connects = 1;
      d.carried.pending += block.known;
    }
    return d;
  }
  static void add_merges(Departure& d, const MediumMerges::Leaving& merges) {
    d.carried.pending_medium += merges.known;
    d.long_beams = merges.beams;
  }
  // The pending merges in media. Those of long beams at the vertex left are divided by `survival`, of the
  // edge under way.
  static double pending_medium(const Departure& d, double survival) {
    return d.carried.pending_medium + d.long_beams / std::max(survival, MediumMerges::kMinSurvival);
  }
  static double sum_departure(const Departure& d, const MergeFactors& eta, double survival) {
    Block carried = d.carried;
    carried.pending_medium = pending_medium(d, survival);
    return sum_pending(carried, eta);
  }
};

}  // namespace candela::transport
