// Choice by power, wherever the reference: for light paths, which have none, and for measurements.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/scene/emitters/choice/choice.h"
#include "worker/scene/emitters/distribution.h"

namespace candela::scene {

class PowerChooser {
 public:
  PowerChooser() = default;
  // By emitter; see EmitterSet::weight_of_power.
  explicit PowerChooser(const std::vector<double>& powers) : powers_(powers) {}

  bool choose(double u, EmitterChoice& out) const {
    if (!(powers_.total() > 0)) return false;
    out.emitter = powers_.sample(u, &out.rest);
    out.prob = prob(out.emitter);
    return true;
  }
  bool choose(Vec3 /*p*/, Vec3 /*front*/, double u, EmitterChoice& out) const { return choose(u, out); }

  float prob(std::uint32_t emitter) const {
    return powers_.total() > 0 ? static_cast<float>(powers_.probability(emitter)) : 0.0f;
  }
  float prob(Vec3 /*p*/, Vec3 /*front*/, std::uint32_t emitter) const { return prob(emitter); }

 private:
  Distribution powers_;  // of luminance
};

}  // namespace candela::scene
