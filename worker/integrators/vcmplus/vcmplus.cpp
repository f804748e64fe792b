// VCM+: vertex connection and merging whose radius follows, at each pixel, from F tests of the weighted light
// that merging finds in sectors around the eye's vertices [Lin 2023, section 6].
#include "worker/integrators/adaptive/run.h"
#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/merging/one_radius.h"
#include "worker/integrators/plan_edge_content.h"
#include "worker/integrators/vcm/plan.h"
#include "worker/integrators/vcmplus/settings.h"
#include "worker/transport/statistics/weighted_sectors.h"

namespace candela::integrators {
namespace {

// Pixels of at most four contributions keep to the best order of the mean square where nothing is known,
// which is ppm's. Those of less than five to each sector, the number below which tests of frequencies are not
// trusted, keep to the radii of vcm.
constexpr adaptive::Follow kNoEvidence{integrator_words::kPpm.alpha.value, 4};
constexpr adaptive::Follow kLittleEvidence{integrator_words::kVcm.alpha.value, 60};

class VcmplusIntegrator final : public IterationIntegrator {
 public:
  VcmplusIntegrator(const estimators::PathOptions& options, Planned planned, const merging::MergeRules& merge,
                    bool merging_layer, adaptive::Adaptation adaptation, bool colors)
      : IterationIntegrator(options, std::move(planned)),
        iterations_{options_, planned_.techniques, merge, false, merging_layer},
        adaptation_(std::move(adaptation)),
        colors_(colors) {}

  // If nothing is merged, there is nothing to decide.
  WorkPlan work(FilmSize /*size*/, const NamedState& state) const override {
    WorkPlan plan;
    if (planned_.techniques.merges()) plan = adaptive::work_plan(adaptation_, state.film_scale_log2);
    plan.layers = iterations_.layers();
    return plan;
  }
  Result<Decision> decide(const UnitContext& context, const RunContext& /*run*/) const override {
    return merging::decide_radius(plan(), context, iterations_);
  }
  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& input, UnitOutput& output,
                   const RunContext& run_context) const override {
    if (!planned_.techniques.merges())
      return merging::run_vcm(planned_.between, context, unit, input, iterations_, output, run_context);
    using Statistics = transport::WeightedSectors;
    return with_edge_content(planned_.between, [&](auto between) {
      using Eye = estimators::VcmEye<between(), transport::Balance, transport::ScaleMap, Statistics>;
      return adaptive::run_adaptive<Eye>(
          context, unit, input, iterations_, adaptation_,
          [this](double first_radius) { return Statistics(first_radius, colors_); }, output, run_context);
    });
  }

 private:
  const merging::IterationOptions iterations_;
  const adaptive::Adaptation adaptation_;
  const bool colors_;  // that the F test looks at
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_vcmplus_integrator(const SettingsMap& settings,
                                                            const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const VcmplusSettings parsed, parse_settings<VcmplusSettings>(settings));
  CANDELA_TRY(adaptive::check(parsed.epochs));
  const estimators::PathOptions options = parsed.common.path_options();
  estimators::Techniques wanted;
  wanted.merge_medium = parsed.merge_media;
  Planned planned = vcm::plan(options, wanted, features, parsed.common.full_plan());
  const bool colors = adaptive::tests_colors(parsed.f_test, features.any_color);
  adaptive::Adaptation adaptation = adaptive::f_test(parsed.epochs, parsed.f_test, colors);
  // alpha=1 is the rule of the paper.
  if (parsed.merge.alpha < 1) adaptive::follow(adaptation, parsed.merge.alpha, kNoEvidence, kLittleEvidence);
  if (planned.techniques.merges()) adaptive::note_statistics(adaptation, planned.plan);
  merging::MergeRules rules = parsed.merge.rules();
  rules.adapts = true;
  return std::unique_ptr<Integrator>(std::make_unique<VcmplusIntegrator>(
      options, std::move(planned), rules, parsed.layers.value == "merging", std::move(adaptation), colors));
}

}  // namespace candela::integrators
