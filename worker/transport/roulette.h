// Russian roulette: the probability with which a path goes on. A path survives with 1 / floor times the
// throughput's largest component (radiance's 1/eta^2 undone), at most a bound so that it ends where nothing
// is absorbed. The bound does not hold for a path whose throughput roulette has scaled up above its start's,
// up to free_depth edges: at reflectances above the bound's root the variance would have no bound.
#pragma once

#include <algorithm>
#include <cstdint>

namespace candela::transport {

inline constexpr float kMaxSurvival = 0.95f;

// The bound at a vertex in a medium, of a walk of `edges` edges. From kSlowEnds on it ends with probability
// 1 / edges: its weight grows as edges, where 1 / kMaxSurvival an edge would make walks of thousands of
// edges, the rule in dense media that absorb nothing, fireflies that hardly ever come. Media without an end
// would not end such walks: from kLongestWalk on the first bound keeps memory and the number of connections
// finite.
inline constexpr std::uint32_t kSlowEnds = 20, kLongestWalk = 1u << 12;
constexpr float longest_survival_in_media(std::uint32_t edges) {
  return edges < kSlowEnds || edges >= kLongestWalk ? kMaxSurvival : 1 - 1 / static_cast<float>(edges);
}

struct Roulette {
  float floor;               // of the throughput, below which a path may end
  std::uint32_t free_depth;  // edges

  // True if a walk of this throughput would live on for sure but for the bound.
  constexpr bool binds(float throughput) const { return throughput * (1 / floor) > kMaxSurvival; }
  // longest: the bound.
  constexpr float survival(float throughput, float longest) const {
    return std::min(throughput * (1 / floor), longest);
  }
};

// Roulette of the subpaths of walk.h, whose light other techniques find too, and of path tracing, which has
// no other. The factors are measured (docs/integrators/transport.md, path.md).
inline constexpr Roulette kSubpathRoulette{0.5f, 1024};
inline constexpr Roulette kPathRoulette{0.25f, 1u << 14};

}  // namespace candela::transport
