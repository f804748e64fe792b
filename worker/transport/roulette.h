// Russian roulette: the probability with which a path goes on. A path survives with 1 / floor times the
// throughput's largest component (radiance's 1/eta^2 undone), at most kMaxSurvival so that it ends where
// nothing is absorbed. That bound does not hold for a path whose throughput roulette has scaled up above its
// start's, up to free_depth edges: at reflectances above the bound's root the variance would have no bound.
#pragma once

#include <algorithm>
#include <cstdint>

namespace candela::transport {

inline constexpr float kMaxSurvival = 0.95f;

struct Roulette {
  float floor;               // of the throughput, below which a path may end
  std::uint32_t free_depth;  // edges

  // longest: 1 or kMaxSurvival.
  constexpr float survival(float throughput, float longest) const {
    return std::min(throughput * (1 / floor), longest);
  }
};

// Roulette of the subpaths of walk.h, whose light other techniques find too, and of path tracing, which has
// no other. The factors are measured (docs/integrators/transport.md, path.md).
inline constexpr Roulette kSubpathRoulette{0.5f, 1024};
inline constexpr Roulette kPathRoulette{0.25f, 1u << 14};

}  // namespace candela::transport
