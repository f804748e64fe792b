#include "worker/integrators/vcm/vcm.h"

#include "worker/integrators/bidirectional/pilot.h"
#include "worker/integrators/merging/iterations.h"
#include "worker/integrators/plan_between.h"
#include "worker/integrators/vcm/plan.h"

namespace candela::integrators {
namespace {

using estimators::PathOptions;
using estimators::Techniques;
using transport::Between;
using transport::MisHeuristic;

class VcmIntegrator final : public Integrator {
 public:
  VcmIntegrator(const PathOptions& options, const merging::MergeRules& merge, vcm::Planned planned)
      : options_{options, planned.techniques, merge}, planned_(std::move(planned)) {}

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                   UnitOutput& output, const RunContext& run_context) const override {
    return with_between(planned_.between, [&](auto between) {
      return run_between<between()>(context, unit, *output.film, run_context);
    });
  }

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    return bidirectional::pilot(context, count, options_.paths);
  }

  const Plan& plan() const override { return planned_.plan; }

 private:
  template <Between kBetween>
  Result<void> run_between(const UnitContext& context, const Unit& unit, film::UnitFilm& film,
                           const RunContext& run_context) const {
    if (options_.paths.heuristic == MisHeuristic::power)
      return run_weighted<kBetween, transport::Power>(context, unit, film, run_context);
    return run_weighted<kBetween, transport::Balance>(context, unit, film, run_context);
  }
  template <Between kBetween, class Mis>
  Result<void> run_weighted(const UnitContext& context, const Unit& unit, film::UnitFilm& film,
                            const RunContext& run_context) const {
    return merging::run_iterations<estimators::VcmEye<kBetween, Mis, transport::ConstantEta>>(
        context, unit, options_, film, run_context);
  }

  merging::IterationOptions options_;
  vcm::Planned planned_;
};

template <class Settings>
PathOptions path_options(const Settings& settings) {
  return {settings.common.depth(), static_cast<std::uint32_t>(settings.common.rr_depth),
          settings.common.hide_emitters ? 2u : 1u,
          settings.heuristic.value == "power" ? MisHeuristic::power : MisHeuristic::balance};
}

}  // namespace

Result<std::unique_ptr<Integrator>> make_vcm_integrator(const SettingsMap& settings,
                                                        const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const VcmSettings parsed, parse_settings<VcmSettings>(settings));
  const PathOptions options = path_options(parsed);
  Techniques wanted;
  wanted.merge_medium = parsed.merge_media;
  return std::unique_ptr<Integrator>(std::make_unique<VcmIntegrator>(
      options, parsed.merge.rules(),
      vcm::make_plan(wanted, options, parsed.common.plan.value == "full", features)));
}

Result<std::unique_ptr<Integrator>> make_bpm_integrator(const SettingsMap& settings,
                                                        const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const BpmSettings parsed, parse_settings<BpmSettings>(settings));
  const PathOptions options = path_options(parsed);
  Techniques wanted;
  wanted.next_event = wanted.connect = wanted.light_image = wanted.hit_lens = false;
  return std::unique_ptr<Integrator>(std::make_unique<VcmIntegrator>(
      options, parsed.merge.rules(),
      vcm::make_plan(wanted, options, parsed.common.plan.value == "full", features)));
}

}  // namespace candela::integrators
