// An edge of a walk that is under way: what weights would know at a vertex made on it, wherever that is.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "worker/core/measure.h"
#include "worker/transport/mis/beam_balance.h"
#include "worker/transport/segments.h"

namespace candela::transport {

struct EdgeStart {
  BeamBalance::Departure departure;
  Vec3 from;                  // of a finite start
  bool finite = true;         // false: light from outside
  double survival = 1;        // from there to where the stretch begins
  double origin_density = 1;  // light walks: of the end point alone
  std::uint32_t edges = 1;    // the edge's number
};

// Start of the edge on which the walk made its last crossing. Call it before Walk::scatter.
template <class Walk>
EdgeStart edge_start(const Walk& walk, const MediumSegment& segment) {
  return {walk.departure(), walk.from(),           walk.from_finite(),
          segment.survival, walk.origin_density(), segment.edges};
}

// A vertex in a medium on an edge, as the walk would have made it.
struct EdgeVertex {
  double distance_squared, survival, pdf_volume;
};
// hazard: at `place`; stretch_survival: from the stretch's beginning to it.
inline EdgeVertex vertex_on(const EdgeStart& e, Vec3d place, double hazard, double stretch_survival) {
  EdgeVertex v{};
  v.distance_squared = e.finite ? length_squared(place - Vec3d(e.from)) : 1;
  v.survival = e.survival * stretch_survival;
  v.pdf_volume = solid_angle_to_area_by_spread(
      e.departure.pdf, v.survival / std::max(v.distance_squared, std::numeric_limits<double>::min()), hazard);
  return v;
}
// Its blocks. direct_density: see BalancePower::arrive_from_light; not read where edges > 1.
inline MisBlock eye_block(const EdgeStart& e, const MisFactors& factors, const EdgeVertex& v, double hazard) {
  if (!(e.departure.pdf > 0)) return {};
  return e.edges > 1
             ? BeamBalance::arrive_later(e.departure, factors, hazard, v.pdf_volume, false, v.survival)
             : BeamBalance::arrive_from_eye(e.departure, factors, hazard, v.pdf_volume, v.survival);
}
inline MisBlock light_block(const EdgeStart& e, const MisFactors& factors, const EdgeVertex& v, double hazard,
                            double direct_density) {
  if (!(e.departure.pdf > 0)) return {};
  return e.edges > 1
             ? BeamBalance::arrive_later(e.departure, factors, hazard, v.pdf_volume, false, v.survival)
             : BeamBalance::arrive_from_light(e.departure, factors, hazard, v.pdf_volume, direct_density,
                                              e.origin_density);
}

}  // namespace candela::transport
