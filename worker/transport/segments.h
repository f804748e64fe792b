// Stretches of media that a walk crosses, for observers of it (beams, statistics of transmittance).
#pragma once

#include <cstdint>

#include "worker/core/vec.h"

namespace candela::transport {

// The whole stretch of one medium along a ray, before a flight through it may end inside.
struct MediumSegment {
  Ray ray;  // t_max: to where the medium ends
  std::uint32_t medium;
  Spectrum throughput;  // of the walk where the stretch begins
  double survival;      // of the present edge up to there, as weights count it (1 if they do not)
  std::uint32_t edges;  // the number of the present edge
};

// An observer of a walk: stretch() comes before each flight, then scattered(distance) or survived(), unless
// the flight took all of the light.
struct NoObserver {
  void stretch(const MediumSegment& /*segment*/) {}
  void scattered(float /*distance*/) {}
  void survived() {}
};

}  // namespace candela::transport
