// Stretches of media that a walk crosses, for observers of it (beams, statistics of transmittance).
#pragma once

#include <cstdint>
#include <vector>

#include "worker/core/vec.h"
#include "worker/scene/media/tracking.h"

namespace candela::transport {

// The whole stretch of one medium along a ray, before a flight through it may end inside.
struct MediumSegment {
  Ray ray;  // t_max: to where the medium ends
  std::uint32_t medium;
  Spectrum throughput;  // of the walk where the stretch begins
  double survival;      // of the present edge up to there, as weights count it (1 if they do not)
  std::uint32_t edges;  // the number of the present edge
};

// An observer of a walk: stretch() comes before each flight, then scattered(distance) or survived(). steps():
// where the flight's steps are added (Tracking::collide); null: nowhere.
struct NoObserver {
  void stretch(const MediumSegment& /*segment*/) {}
  static std::vector<scene::FlightStep>* steps() { return nullptr; }
  void scattered(float /*distance*/) {}
  void survived() {}
};

// The last stretch that a walk crossed, up to where the flight ended: a short beam.
struct Crossing {
  MediumSegment segment;
  float end = 0;                              // along the ray
  bool some = false;                          // there is one, and the flight through it came to an end
  std::vector<scene::FlightStep> steps = {};  // of the flight, in grids that have colors
};

// Keeps the last crossing for an estimator that looks at it after each step of the walk.
class CrossingObserver {
 public:
  explicit CrossingObserver(Crossing& last) : last_(&last) {}
  void stretch(const MediumSegment& segment) {
    last_->segment = segment;
    last_->some = false;
    last_->steps.clear();
  }
  std::vector<scene::FlightStep>* steps() { return &last_->steps; }
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
