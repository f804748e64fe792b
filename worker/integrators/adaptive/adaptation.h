// Parts that integrators with a radius per pixel share: a table of radii by level, a state of one level a
// pixel, statistics for each epoch, and a rule that decides the state from them (common/adaptive).
#pragma once

#include <string_view>
#include <vector>

#include "common/adaptive/levels.h"
#include "common/stages/work_plan.h"
#include "worker/integrators/adaptive/settings.h"
#include "worker/integrators/integrator.h"
#include "worker/integrators/planned.h"
#include "worker/transport/kernels.h"

namespace candela::integrators::adaptive {

struct Adaptation {
  EpochPlan epochs;  // its rule's name is that of the state too
  candela::adaptive::Levels levels;
  // Planes of the state beside the plane of levels: each has one byte a pixel, below this number.
  std::vector<int> planes = {};
  std::vector<film::AccumulatorSpec> (*accumulators)(int film_scale_log2) = nullptr;
};

// True if the F test looks at colors: in a scene of grays luminance tells all.
bool tests_colors(const FTestSettings& test, bool scene_has_color);
// The F test's, by the rule "fppm". colors: each channel is tested, at a level such that the three together
// reject with probability alpha_f at most.
Adaptation f_test(const EpochSettings& epochs, const FTestSettings& test, bool colors);
// The schedule of pixels whose sums come from at most `evidence` contributions: that of radii that shrink
// with to_alpha.
struct Follow {
  double to_alpha = 1;
  std::uint64_t evidence = 0;
};
// Pixels with at most none.evidence (little.evidence, the larger bound) contributions follow the schedule of
// none.to_alpha (little.to_alpha) if its radii are smaller; alpha is the radii's own exponent.
void follow(Adaptation& adaptation, double alpha, const Follow& none, const Follow& little);
// The chi-squared test's, by the rule "cppm".
Adaptation count_test(const EpochSettings& epochs, const CountTestSettings& test);
// The plug-in bandwidth's, by the rule "appm". media: merges in media too. pilot=reference adds a plane of
// levels of pilots to the state.
Adaptation plug_in(const EpochSettings& epochs, const PlugInSettings& bandwidth, transport::Kernel kernel,
                   bool media);

// Accumulators and epochs.
WorkPlan work_plan(const Adaptation& adaptation, int film_scale_log2);

// Says in the plan what memory and network are asked for.
void note_statistics(const Adaptation& adaptation, Plan& plan);

// A plane of a unit's state, by default the levels of its pixels. Fails (input) where the state is absent, or
// not of this film and these levels in all its planes.
Result<std::string_view> level_map(const UnitInput& input, const Adaptation& adaptation,
                                   const UnitContext& context, std::size_t plane = 0);

}  // namespace candela::integrators::adaptive
