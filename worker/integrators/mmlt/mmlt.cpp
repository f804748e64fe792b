// The mmlt integrator: settings, plan, and the choice of a target (target.h) by them.
#include "worker/integrators/mmlt/mmlt.h"

#include <algorithm>
#include <string>

#include "worker/integrators/bidirectional/plan.h"
#include "worker/integrators/chains/chain_integrator.h"
#include "worker/integrators/mmlt/target.h"
#include "worker/integrators/plan_between.h"
#include "worker/integrators/plan_walks.h"
#include "worker/mcmc/primary_space.h"

namespace candela::integrators {
namespace {

using transport::Between;

// Of paths without a limit: beyond it, walks have long been ended by roulette.
constexpr std::uint32_t kLongest = 1u << 20;

class MmltIntegrator final : public ChainIntegrator {
 public:
  MmltIntegrator(const MmltSettings& settings, const scene::SceneFeatures& features)
      : ChainIntegrator(settings.chains, settings.common.path_options(), features,
                        settings.common.full_plan()),
        options_(chain_options()),
        steps_{settings.steps.step_least, settings.steps.step_most},
        planned_(bidirectional::plan(options_, features, settings.common.full_plan())),
        lengths_(shortest(), std::max(shortest(), std::min(options_.max_depth, kLongest))) {
    plan_.append(planned_.plan);
    if (options_.max_depth < shortest()) {
      planned_.techniques = estimators::Techniques::none();
      plan_.skip("chains", "max_depth leaves nothing to them");
      return;
    }
    note_lasting_media(features, std::min(options_.max_depth, kLongest), options_.rr_depth, plan_);
    plan_.use("path lengths",
              "from " + std::to_string(shortest()) + " edges" +
                  (settings.common.max_depth < 0 ? std::string(", without a limit")
                                                 : " to " + std::to_string(options_.max_depth)));
  }

 private:
  // The shortest length that some technique can make.
  std::uint32_t shortest() const {
    const bool seen = planned_.techniques.hit_light;
    return std::max(options_.min_edges, seen ? 1U : 2U);
  }

  std::unique_ptr<mcmc::StateSpace> make_space(const UnitContext& context,
                                               film::Tallies& tallies) const override {
    return std::make_unique<mcmc::PrimarySpace>(
        with_between(planned_.between, [&](auto between) { return target<between()>(context, tallies); }),
        steps_);
  }
  template <Between kBetween>
  std::unique_ptr<mcmc::PrimaryTarget> target(const UnitContext& context, film::Tallies& tallies) const {
    return std::make_unique<mmlt::Target<kBetween>>(context, options_, planned_.techniques, lengths_,
                                                    tallies);
  }

  estimators::PathOptions options_;
  mcmc::StepSizes steps_;
  Planned planned_;
  mmlt::Lengths lengths_;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_mmlt_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const MmltSettings parsed, parse_settings<MmltSettings>(settings));
  CANDELA_TRY(check(parsed.chains));
  CANDELA_TRY(check(parsed.steps));
  return std::unique_ptr<Integrator>(std::make_unique<MmltIntegrator>(parsed, features));
}

}  // namespace candela::integrators
