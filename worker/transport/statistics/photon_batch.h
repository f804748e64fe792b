// Photons of a gather, up to a number at a time: their numbers lie side by side, so that the compiler can
// work on eight at once.
#pragma once

#include <cstddef>

#include "worker/core/vec.h"

namespace candela::transport {

struct PhotonBatch {
  static constexpr std::size_t kMax = 64;
  std::size_t count = 0;
  float x[kMax], y[kMax], z[kMax];  // offset from the eye's vertex
  float weight[kMax];

  // False: that was the last place.
  bool add(Vec3 offset, float w) {
    x[count] = offset.x;
    y[count] = offset.y;
    z[count] = offset.z;
    weight[count] = w;
    return ++count < kMax;
  }
};

}  // namespace candela::transport
