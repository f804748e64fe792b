// What a kernel of the path tracer is made of: its random numbers, what the plan decided, limits, weights.
#pragma once

#include <cstdint>

#include "worker/transport/between.h"

namespace candela::integrators::path {

inline constexpr std::uint32_t kCameraDimensions = 2;
// A vertex's block; the last two where there are media: the flight that ends at it, and light's way to it.
inline constexpr std::uint32_t kEmitterChoice = 0, kEmitterPoint = 1, kLobe = 2, kDirection = 3,
                               kRoulette = 4, kFlight = 5, kTransmittance = 6;
inline constexpr std::uint32_t kBlock = 5, kMediaBlock = 7;
inline constexpr std::uint32_t kStratifiedVertices = 2;
inline constexpr float kRouletteFloor = 0.25f;  // throughput below which a path may end
inline constexpr float kLongestSurvival =
    0.95f;  // keeps a path from living for ever where nothing is absorbed
// Up to this depth the bound does not hold in media, nor, where throughput has been scaled up above 1,
// between surfaces that scatter: at reflectances above the bound's root (0.975) the variance would have no
// bound. In a cloud that absorbs nothing the lengths of paths fall off as slowly as n^-3/2, and a bound's
// survivors, scaled up, would carry light in samples too rare to come up.
inline constexpr std::uint32_t kLongFlight = 1u << 14;

using transport::Between;
using transport::kMostPasses;

// What the plan decided, as compile-time facts of the kernel.
struct Techniques {
  bool next_event = true;    // sample emitters
  bool hit_emitters = true;  // surfaces may emit
  bool environment = true;   // light may arrive from outside the scene
  bool weigh = true;         // both techniques can find the same light
  Between between = Between::media;
};

struct Limits {
  std::uint32_t max_depth;
  std::uint32_t rr_depth;
  std::uint32_t least_edges;  // of paths that count: 2 leaves out emitters seen by the camera
  bool power_heuristic;
  bool choose_emitter;  // Scene::sample_direct reads its u_select
};

// The MIS weight of a technique with density p against one of density q, as a ratio so that it neither over-
// nor underflows. [Veach 1997, Eq. 9.8 (balance) and 9.13 (power, beta = 2)]
inline float mis_weight(float p, float q, bool power) {
  const float ratio = q / p;
  return 1.0f / (1.0f + (power ? ratio * ratio : ratio));
}

}  // namespace candela::integrators::path
