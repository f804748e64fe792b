// Vertex connection and merging, and bidirectional photon mapping: what is left of it without connections.
#include "common/stats/inner_merges.h"
#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/merging/chosen_radius.h"
#include "worker/integrators/merging/one_radius.h"
#include "worker/integrators/vcm/plan.h"
#include "worker/integrators/vcm/settings.h"

namespace candela::integrators {
namespace {

using estimators::PathOptions;
using estimators::Techniques;

class VcmIntegrator final : public IterationIntegrator {
 public:
  VcmIntegrator(const PathOptions& options, Planned planned, const merging::MergeRules& merge,
                bool merging_layer)
      : IterationIntegrator(options, std::move(planned)),
        iterations_{options_, planned_.techniques, merge, false, merging_layer} {}

  WorkPlan work(FilmSize size, const NamedState& state) const override {
    WorkPlan plan{.layers = iterations_.layers()};
    if (planned_.techniques.photons_alone())
      plan.accumulators = {stats::inner_merges_spec(size.width, size.height, state.film_scale_log2)};
    return plan;
  }

  Result<Decision> decide(const UnitContext& context, const RunContext& /*run*/) const override {
    return merging::decide_radius(plan(), context, iterations_);
  }
  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& input, UnitOutput& output,
                   const RunContext& run_context) const override {
    return merging::run_vcm(planned_.between, context, unit, input, iterations_, output, run_context);
  }

 private:
  const merging::IterationOptions iterations_;
};

template <class Settings>
std::unique_ptr<Integrator> make(const Settings& settings, const Techniques& wanted, bool merging_layer,
                                 const scene::SceneFeatures& features) {
  const PathOptions options = settings.common.path_options();
  return std::make_unique<VcmIntegrator>(options,
                                         vcm::plan(options, wanted, features, settings.common.full_plan()),
                                         settings.merge.rules(), merging_layer);
}

}  // namespace

Result<std::unique_ptr<Integrator>> make_vcm_integrator(const SettingsMap& settings,
                                                        const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const VcmSettings parsed, parse_settings<VcmSettings>(settings));
  Techniques wanted;
  wanted.merge_medium = parsed.merge_media;
  return make(parsed, wanted, parsed.layers.value == "merging", features);
}

Result<std::unique_ptr<Integrator>> make_bpm_integrator(const SettingsMap& settings,
                                                        const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const BpmSettings parsed, parse_settings<BpmSettings>(settings));
  Techniques wanted;
  wanted.next_event = wanted.connect = wanted.light_image = wanted.hit_lens = false;
  return make(parsed, wanted, false, features);
}

}  // namespace candela::integrators
