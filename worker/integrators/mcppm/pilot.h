// The pilot's decision: chains, or ppm's light paths alone.
#pragma once

#include <cstdint>

#include "worker/integrators/integrator.h"
#include "worker/integrators/merging/iteration_options.h"
#include "worker/transport/between.h"

namespace candela::integrators::mcppm {

// Chains do not pay if more of the light paths are visible [metropolis-photons note, section 8].
inline constexpr double kMostVisible = 0.2;
// With fewer visible paths an iteration is dark or flickers, whatever the number of mutations (ibid.).
inline constexpr double kFewestVisible = 10;

struct VisibleFraction {
  std::uint64_t visible = 0, light_paths = 0;  // of the pilot
  double value() const { return static_cast<double>(visible) / static_cast<double>(light_paths); }
};

// The share of the light paths of the first iteration that leave photons within the radius of its eye paths'
// gather places, from a pilot of few paths. A large film is replaced by a smaller one whose discs are as much
// larger: they cover the same share of the surfaces. A pure function of the scene, the film's size, the seed
// and the arguments. Fails only if it is stopped.
Result<VisibleFraction> visible_fraction(transport::Between between, const UnitContext& context,
                                         const merging::IterationOptions& options, double radius,
                                         const RunContext& run);

// Decides, and says so in the plan. full: whoever asks for everything gets chains. mutations: of an
// iteration.
bool decide_chains(const VisibleFraction& fraction, std::uint64_t light_paths, std::uint64_t mutations,
                   bool full, Plan& plan);

}  // namespace candela::integrators::mcppm
