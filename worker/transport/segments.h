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

// The last stretch that a walk crossed, up to where the flight ended: a short beam.
struct Crossing {
  MediumSegment segment;
  float end = 0;      // along the ray
  bool some = false;  // there is one, and the flight through it came to an end
};

// Keeps the last crossing for an estimator that looks at it after each step of the walk.
class CrossingObserver {
 public:
  explicit CrossingObserver(Crossing& last) : last_(&last) {}
  void stretch(const MediumSegment& segment) { *last_ = {segment, 0, false}; }
  void scattered(float distance) { end(distance); }
  void survived() { end(last_->segment.ray.t_max); }

 private:
  void end(float at) {
    last_->end = at;
    last_->some = true;
  }
  Crossing* last_;
};

}  // namespace candela::transport
