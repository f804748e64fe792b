// Photon mapping with a radius for each pixel: ppm's eye paths, and statistics of their merges.
#pragma once

#include <utility>

#include "common/stats/inner_merges.h"
#include "worker/integrators/adaptive/light_pass.h"
#include "worker/integrators/adaptive/run.h"
#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/merging/one_radius.h"
#include "worker/integrators/plan_edge_content.h"

namespace candela::integrators::adaptive {

// Statistics: a policy of worker/transport/statistics. make_statistics(first_radius, context, unit, input):
// what those of an eye path start as.
template <class Statistics, class MakeStatistics>
class PhotonMapping final : public IterationIntegrator {
 public:
  PhotonMapping(const estimators::PathOptions& options, Planned planned, const merging::MergeRules& merge,
                Adaptation adaptation, MakeStatistics make_statistics)
      : IterationIntegrator(options, std::move(planned)),
        iterations_{options_, planned_.techniques, merge},
        adaptation_(std::move(adaptation)),
        make_statistics_(std::move(make_statistics)) {}

  // If nothing is merged, there is nothing to decide.
  WorkPlan work(FilmSize size, const NamedState& state) const override {
    if (!planned_.techniques.merges()) return {};
    WorkPlan plan = work_plan(adaptation_, state.film_scale_log2);
    plan.accumulators.push_back(stats::inner_merges_spec(size.width, size.height, state.film_scale_log2));
    return plan;
  }
  Result<Decision> decide(const UnitContext& context, const RunContext& /*run*/) const override {
    return merging::decide_radius(plan(), context, iterations_);
  }
  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& input, UnitOutput& output,
                   const RunContext& run_context) const override {
    if (!planned_.techniques.merges())
      return merging::run_ppm(planned_.between, context, unit, input, iterations_, output, run_context);
    return with_edge_content(planned_.between, [&](auto between) {
      return run_adaptive<estimators::PpmEye<between(), transport::ScaleMap, Statistics>>(
          context, unit, input, iterations_, adaptation_,
          [&](double first_radius) { return make_statistics_(first_radius, context, unit, input); }, output,
          run_context);
    });
  }

 private:
  const merging::IterationOptions iterations_;
  const Adaptation adaptation_;
  const MakeStatistics make_statistics_;
};

// Settings: has common, merge. The scene's plan is `planned`.
template <class Statistics, class Settings, class MakeStatistics>
std::unique_ptr<Integrator> make_photon_mapping(const Settings& settings, Planned planned,
                                                Adaptation adaptation, MakeStatistics make_statistics) {
  if (planned.techniques.merges()) note_statistics(adaptation, planned.plan);
  return std::make_unique<PhotonMapping<Statistics, MakeStatistics>>(
      settings.common.path_options(), std::move(planned), settings.merge.rules(), std::move(adaptation),
      std::move(make_statistics));
}

}  // namespace candela::integrators::adaptive
