// The plan of optimis for a scene.
#pragma once

#include "worker/estimators/first_vertex.h"
#include "worker/integrators/optimis/settings.h"
#include "worker/integrators/planned.h"
#include "worker/scene/features.h"

namespace candela::integrators::optimis {

// Origin of the weights of the image.
enum class ReadOut : std::uint8_t {
  film,  // the film is the image: a heuristic of densities
  sums,  // optimal weights from the sums of the job
};

struct PlannedFirstVertex {
  Planned planned;
  estimators::FirstVertexSetup setup;  // without techniques: the path tracer's own
  ReadOut read_out = ReadOut::film;
  std::uint32_t lights = 0;  // or groups of lights, whose visibility is learned; 0: none
  bool on_trial = false;     // a trial decides whether optimal weights stay
};

// Optimal weights stay if they leave no more than this of the balance heuristic's variance: sums and reading
// the image cost 6 to 8 % of the time of direct light (docs/studies/mis-scenes.md).
inline constexpr double kMaxVariance = 0.94;
// Iterations of a pixel in the trial, of either half.
inline constexpr std::uint64_t kTrialIterations = 32;
// Says in the plan what the trial found: the variance by optimal weights over that by the balance heuristic.
void tell_trial(double ratio, Plan& plan);

// Fails (usage) if the scene has more groups of lights than there may be, or layers by expression that
// optimal weights do not have.
Result<PlannedFirstVertex> plan(const OptimisSettings& settings, const estimators::PathOptions& options,
                                const scene::SceneFeatures& features);

}  // namespace candela::integrators::optimis
