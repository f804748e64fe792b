// The pssmlt integrator: settings, plan, and the choice of a target (targets.h) by them.
#include "worker/integrators/pssmlt/pssmlt.h"

#include "worker/integrators/bdpt/plan.h"
#include "worker/integrators/markov/markov.h"
#include "worker/integrators/path/plan.h"
#include "worker/integrators/plan_between.h"
#include "worker/integrators/plan_walks.h"
#include "worker/integrators/pssmlt/targets.h"

namespace candela::integrators {
namespace {

using transport::Between;

class PssmltIntegrator final : public MarkovIntegrator {
 public:
  PssmltIntegrator(const PssmltSettings& settings, const scene::SceneFeatures& features)
      : MarkovIntegrator(settings.markov, features, settings.max_depth, settings.roulette(),
                         settings.hide_emitters, settings.plan.value == "full"),
        over_path_(settings.over.value == "path") {
    const bool full = settings.plan.value == "full";
    const bool choose_emitter = features.emitters > 1 || features.any_mesh_emitter;
    const auto rr_depth = static_cast<std::uint32_t>(settings.roulette());
    if (over_path_) {
      path_limits_ = {most_edges(), rr_depth, least_edges(), true, choose_emitter};
      path_kernel_ = path::kernel_for<mcmc::PrimarySampler>(path::plan(path_limits_, features, full, plan_));
    } else {
      bdpt_limits_ = {most_edges(), rr_depth, least_edges(), choose_emitter,
                      transport::MisHeuristic::balance};
      bdpt_ = bdpt::plan(bdpt_limits_, features, full, plan_);
      note_lasting_media(features, most_edges(), rr_depth, plan_);
    }
  }

 private:
  std::unique_ptr<mcmc::PrimaryTarget> make_target(const UnitContext& context,
                                                   film::Tallies& tallies) const override {
    if (over_path_) return std::make_unique<pssmlt::PathTarget>(context, path_limits_, path_kernel_, tallies);
    return with_between(bdpt_.between,
                        [&](auto between) { return bdpt_target<between()>(context, tallies); });
  }
  template <Between kBetween>
  std::unique_ptr<mcmc::PrimaryTarget> bdpt_target(const UnitContext& context, film::Tallies& tallies) const {
    return std::make_unique<pssmlt::BdptTarget<kBetween>>(context, bdpt_limits_, bdpt_.techniques, tallies);
  }

  bool over_path_;
  path::Limits path_limits_{};
  path::RadianceFunction<mcmc::PrimarySampler> path_kernel_ = nullptr;
  bdpt::Limits bdpt_limits_;
  bdpt::Planned bdpt_;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_pssmlt_integrator(const SettingsMap& settings,
                                                           const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const PssmltSettings parsed, parse_settings<PssmltSettings>(settings));
  CANDELA_TRY(check(parsed.markov));
  return std::unique_ptr<Integrator>(std::make_unique<PssmltIntegrator>(parsed, features));
}

}  // namespace candela::integrators
