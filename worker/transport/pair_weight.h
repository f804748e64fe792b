// The weight of one of two techniques.
#pragma once

namespace candela::transport {

// The MIS weight of a technique with density p against one of density q, as a ratio so that it neither over-
// nor underflows. [Veach 1997, Eq. 9.8 (balance) and 9.13 (power, beta = 2)]
inline float mis_weight(float p, float q, bool power) {
  const float ratio = q / p;
  return 1.0f / (1.0f + (power ? ratio * ratio : ratio));
}

}  // namespace candela::transport
