// Choice of any emitter with the same probability.
#pragma once

#include <algorithm>
#include <cstdint>

#include "worker/scene/emitters/choice/choice.h"

namespace candela::scene {

class UniformChooser {
 public:
  UniformChooser() = default;
  explicit UniformChooser(std::size_t count) : count_(static_cast<std::uint32_t>(count)) {}

  bool choose(Vec3 /*p*/, Vec3 /*front*/, double u, EmitterChoice& out) const {
    if (count_ == 0) return false;
    const double x = u * count_;
    out.emitter = std::min(static_cast<std::uint32_t>(x), count_ - 1);
    out.prob = 1 / static_cast<float>(count_);
    out.rest = std::clamp(x - out.emitter, 0.0, 1.0 - 0x1p-53);
    return true;
  }
  float prob(Vec3 /*p*/, Vec3 /*front*/, std::uint32_t /*emitter*/) const {
    return 1 / static_cast<float>(count_);
  }

 private:
  std::uint32_t count_ = 0;
};

}  // namespace candela::scene
