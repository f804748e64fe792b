// The limits of walks and the heuristics, as options of estimators have them: without the walks' own headers.
#pragma once

#include <cstdint>

namespace candela::transport {

struct WalkRules {
  std::uint32_t max_edges = 1u << 30;  // to its last vertex
  std::uint32_t rr_depth = 2;          // edges from which Russian roulette may end it
  bool meets_lens = false;             // walks from the light look for the lens
  float film_border = 0;               // pixels around the film that still matter
  double eye_paths = 1;                // per iteration: pixels
};

enum class MisHeuristic : std::uint8_t { balance, power, maximum, cutoff };

}  // namespace candela::transport
