// The pilot's decision: chains, or ppm's light paths alone.
#pragma once

#include <cstdint>

#include "worker/integrators/integrator.h"
#include "worker/integrators/merging/iteration_options.h"
#include "worker/transport/between.h"

namespace candela::integrators::mcppm {

// Chains do not pay if more of the light paths are visible [metropolis-photons note, section 8].
inline constexpr double kMaxVisible = 0.2;
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
Result<VisibleFraction> visible_fraction(transport::EdgeContent between, const UnitContext& context,
                                         const merging::IterationOptions& options, double radius,
                                         const RunContext& run);

// Work of an iteration.
struct IterationSize {
  std::uint64_t light_paths = 0, mutations = 0;
};
// The same sum of both, split so that the variance of a pixel is least if one of the visible light paths in
// `pixels` goes to it: N : M = sqrt((1 - b) / b) : sqrt(tau (pixels - 1)), tau = 10. At least kFewestVisible
// of the light paths are visible if the sum allows it, and one is traced. [metropolis-photons note, section
// 8]
IterationSize split_by(const VisibleFraction& fraction, const IterationSize& size, double pixels);

// Decides, and says so in the plan. full: whoever asks for everything gets chains.
bool decide_chains(const VisibleFraction& fraction, const IterationSize& size, bool full, Plan& plan);

}  // namespace candela::integrators::mcppm
