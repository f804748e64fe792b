// The merging radius of the first iteration, as settings, scene and film decide it.
#pragma once

#include <cstdint>
#include <string>

#include "worker/integrators/integrator.h"
#include "worker/integrators/merging/iteration_options.h"

namespace candela::integrators::merging {

std::uint64_t light_path_count(const MergeRules& rules, const UnitContext& context);

// In scene units, and how it was chosen.
struct ChosenRadius {
  double value = 1;
  std::string why = {};
};

// By the settings of `rules` (settings.h). An automatic radius is that of the disc in which kAutomaticPhotons
// photons of an iteration lie: the median over what a grid of eye paths merges at first, in media of the
// ball, from a pilot of few light paths. It is at most most_pixels() pixels wide, or kFallbackFraction of the
// scene's bounding sphere if that is more; where the pilot finds nothing it is that fraction. A pure function
// of the scene, the film's size, the seed, and the arguments.
inline constexpr int kAutomaticPhotons = 10;
ChosenRadius choose_radius(const UnitContext& context, const MergeRules& rules,
                           const estimators::PathOptions& paths, const estimators::Techniques& techniques);

// If connections find the light near lamps, a radius of a pixel blurs small ones, unless it adapts; if only
// merging does, more of a blur is less than the noise; and photons in media are rarer.
double most_pixels(const MergeRules& rules, const estimators::Techniques& techniques);

// Says in the plan which was chosen.
void note_radius(const ChosenRadius& chosen, const UnitContext& context, Plan& plan);

// Decides the radius for these options, if anything merges; `plan` is what will run.
Decision decide_radius(Plan plan, const UnitContext& context, const IterationOptions& options);
// Decision::bytes of a radius.
std::string radius_bytes(double radius);
// The radius that the pilot decided, in scene units; 1 where nothing merges. Fails (input) on other bytes.
Result<double> decided_radius(const UnitInput& input, const IterationOptions& options);

}  // namespace candela::integrators::merging
