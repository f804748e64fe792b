#include "worker/integrators/vcm/vcm.h"

#include "worker/integrators/bidirectional/pilot.h"
#include "worker/integrators/plan_between.h"
#include "worker/integrators/vcm/kernel.h"
#include "worker/integrators/vcm/plan.h"

namespace candela::integrators {
namespace {

using transport::Between;
using vcm::Limits;
using vcm::Techniques;

class VcmIntegrator final : public Integrator {
 public:
  VcmIntegrator(const Limits& limits, bool power, vcm::Planned planned)
      : limits_(limits), power_(power), planned_(std::move(planned)) {}

  Result<void> run(const UnitContext& context, const Unit& unit, film::UnitFilm& film,
                   const RunContext& run_context) const override {
    return with_between(planned_.between, [&](auto between) {
      return run_between<between()>(context, unit, film, run_context);
    });
  }

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    return bidirectional::pilot(context, count, limits_.max_depth, limits_.rr_depth, limits_.choose_emitter,
                                limits_.hide_emitters);
  }

  const Plan& plan() const override { return planned_.plan; }

 private:
  template <Between kBetween>
  Result<void> run_between(const UnitContext& context, const Unit& unit, film::UnitFilm& film,
                           const RunContext& run_context) const {
    if (power_)
      return vcm::Kernel<kBetween, transport::Power>(context, limits_, planned_.techniques)
          .run(unit, film, run_context);
    return vcm::Kernel<kBetween, transport::Balance>(context, limits_, planned_.techniques)
        .run(unit, film, run_context);
  }

  Limits limits_;
  bool power_;
  vcm::Planned planned_;
};

template <class Settings>
Limits limits_of(const Settings& settings, const scene::SceneFeatures& features) {
  Limits limits;
  limits.max_depth = settings.common.depth();
  limits.rr_depth = static_cast<std::uint32_t>(settings.common.rr_depth);
  limits.hide_emitters = settings.common.hide_emitters;
  limits.choose_emitter = features.emitters > 1 || features.any_mesh_emitter;
  limits.merge = settings.merge.rules();
  return limits;
}

}  // namespace

Result<std::unique_ptr<Integrator>> make_vcm_integrator(const SettingsMap& settings,
                                                        const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const VcmSettings parsed, parse_settings<VcmSettings>(settings));
  const Limits limits = limits_of(parsed, features);
  Techniques wanted;
  wanted.merge_medium = parsed.merge_media;
  return std::unique_ptr<Integrator>(std::make_unique<VcmIntegrator>(
      limits, parsed.heuristic.value == "power",
      vcm::make_plan(wanted, limits, parsed.common.plan.value == "full", features)));
}

Result<std::unique_ptr<Integrator>> make_bpm_integrator(const SettingsMap& settings,
                                                        const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const BpmSettings parsed, parse_settings<BpmSettings>(settings));
  const Limits limits = limits_of(parsed, features);
  Techniques wanted;
  wanted.next_event = wanted.connect = wanted.light_image = wanted.hit_lens = false;
  return std::unique_ptr<Integrator>(std::make_unique<VcmIntegrator>(
      limits, parsed.heuristic.value == "power",
      vcm::make_plan(wanted, limits, parsed.common.plan.value == "full", features)));
}

}  // namespace candela::integrators
