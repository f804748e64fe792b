// The pssmlt integrator: settings, plan, and the choice of a target (targets.h) by them.
#include "worker/integrators/pssmlt/pssmlt.h"

#include "worker/integrators/bidirectional/plan.h"
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
    const auto rr_depth = static_cast<std::uint32_t>(settings.roulette());
    options_ = {most_edges(), rr_depth, least_edges(),
                over_path_ ? transport::MisHeuristic::power : transport::MisHeuristic::balance};
    if (over_path_) {
      const path::Planned planned = path::plan(options_, features, full, plan_);
      techniques_ = planned.techniques;
      between_ = planned.between;
    } else {
      const bidirectional::Planned planned = bidirectional::plan(options_, features, full, plan_);
      techniques_ = planned.techniques;
      between_ = planned.between;
      note_lasting_media(features, most_edges(), rr_depth, plan_);
    }
  }

 private:
  std::unique_ptr<mcmc::PrimaryTarget> make_target(const UnitContext& context,
                                                   film::Tallies& tallies) const override {
    if (over_path_)
      return std::make_unique<pssmlt::PathTarget>(
          context, options_, techniques_, estimators::path_radiance_for<mcmc::PrimarySampler>(between_),
          tallies);
    return with_between(between_, [&](auto between) { return bdpt_target<between()>(context, tallies); });
  }
  template <Between kBetween>
  std::unique_ptr<mcmc::PrimaryTarget> bdpt_target(const UnitContext& context, film::Tallies& tallies) const {
    return std::make_unique<pssmlt::BdptTarget<kBetween>>(context, options_, techniques_, tallies);
  }

  bool over_path_;
  estimators::PathOptions options_;
  estimators::Techniques techniques_;
  Between between_ = Between::media;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_pssmlt_integrator(const SettingsMap& settings,
                                                           const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const PssmltSettings parsed, parse_settings<PssmltSettings>(settings));
  CANDELA_TRY(check(parsed.markov));
  return std::unique_ptr<Integrator>(std::make_unique<PssmltIntegrator>(parsed, features));
}

}  // namespace candela::integrators
