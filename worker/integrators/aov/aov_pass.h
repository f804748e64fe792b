// Sums of AOVs (common/job/aov.h): a set of eye samples beside the integrator's, of the same number. They
// have random numbers of their own, so that the image does not know of them.
//
// An eye sample goes along the camera's ray to the first surface. A surface that light passes straight (mask,
// null, thin glass) is seen with the probability that a sample of its bsdf does not pass; otherwise the
// sample goes on behind it. Media are not seen. Nothing is followed through mirrors and lenses
// (docs/decisions/045).
#pragma once

#include <optional>
#include <vector>

#include "common/film/accumulator.h"
#include "common/job/aov.h"
#include "worker/integrators/integrator.h"
#include "worker/scene/features.h"
#include "worker/scene/objects.h"

namespace candela::integrators {

class AovPass {
 public:
  // `chains`: of a job of Markov chains. Each segment then brings as many eye samples as it has mutations.
  AovPass(std::vector<Aov> aovs, std::optional<ChainPlan> chains) : aovs_(std::move(aovs)), chains_(chains) {}

  bool any() const { return !aovs_.empty(); }
  // Some AOV needs a scene whose hits are all parameterized.
  bool reads_parameters() const;
  // One for each AOV, in order, and of chains the count of samples. Scales follow the scene's extent,
  // the keys of mattes are names of `objects`.
  std::vector<film::AccumulatorSpec> accumulators(const scene::SceneFeatures& features,
                                                  const scene::SceneObjects& objects) const;
  // One line for the plan.
  std::string plan_text() const;

  // Adds the samples of a unit of iterations or segments to output.aovs. Counts rays, no eye samples.
  // Precondition: context.scene is parameterized if reads_parameters().
  Result<void> run(const UnitContext& context, const Unit& unit, UnitOutput& output,
                   const RunContext& run) const;

 private:
  Result<void> run_iterations(const UnitContext& context, const Unit& unit, UnitOutput& output,
                              const RunContext& run) const;
  Result<void> run_segments(const UnitContext& context, const Unit& unit, UnitOutput& output,
                            const RunContext& run) const;

  std::vector<Aov> aovs_;
  std::optional<ChainPlan> chains_;
};

}  // namespace candela::integrators
