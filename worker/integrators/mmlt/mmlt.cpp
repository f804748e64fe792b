// Multiplexed Metropolis light transport [Hachisuka 2014]: the length of the path and the technique that
// makes it are part of a chain's state.
// The mmlt integrator: settings, plan, and the choice of a target (target.h) by them.
#include <algorithm>
#include <string>

#include "worker/integrators/bidirectional/plan.h"
#include "worker/integrators/chains/chain_integrator.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/mmlt/mollified.h"
#include "worker/integrators/mmlt/settings.h"
#include "worker/integrators/mmlt/target.h"
#include "worker/integrators/plan_edge_content.h"
#include "worker/integrators/plan_walks.h"
#include "worker/mcmc/primary_space.h"

namespace candela::integrators {
namespace {

using transport::EdgeContent;

// For paths without a limit: roulette ends walks long before this length.
constexpr std::uint32_t kLongest = 1u << 20;

class MmltIntegrator final : public ChainIntegrator {
 public:
  MmltIntegrator(const MmltSettings& settings, const scene::SceneFeatures& features,
                 const ChainRegularization& regularization, const Plan& regularized)
      : ChainIntegrator(settings.chains, settings.common.path_options(), features,
                        settings.common.full_plan()),
        options_(chain_options()),
        steps_{settings.steps.step_least, settings.steps.step_most},
        planned_(bidirectional::plan(options_, features, settings.common.full_plan(),
                                     settings.regularise.mollifies())),
        lengths_(shortest(), std::max(shortest(), std::min(options_.max_depth, kLongest))) {
    plan_.append(planned_.plan);
    regularization_ = regularization;
    plan_.append(regularized);
    if (options_.max_depth < shortest()) {
      planned_.techniques = estimators::Techniques::none();
      plan_.skip("chains", "max_depth leaves nothing to them");
      return;
    }
    if (regularization.runs()) {
      // Also if all surfaces are specular, and nothing else is connected: these are what a state chooses
      // from.
      estimators::Techniques& t = planned_.techniques;
      t.next_event = t.light_image = t.light_paths = true;
      t.connect = options_.max_depth >= 3;
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

  std::unique_ptr<mcmc::StateSpace> make_space(const UnitContext& context, film::SampleCounts& sample_counts,
                                               double bandwidth) const override {
    if (context.scene.objects().path_edits != nullptr)
      return std::make_unique<mcmc::PrimarySpace>(target<EdgeContent::media, true>(context, sample_counts),
                                                  steps_);
    if (regularization_.runs())
      return std::make_unique<mcmc::PrimarySpace>(
          mmlt::make_mollified_target(context, options_, planned_.techniques, lengths_, bandwidth,
                                      sample_counts),
          steps_);
    return std::make_unique<mcmc::PrimarySpace>(
        with_edge_content(planned_.between,
                          [&](auto between) { return target<between()>(context, sample_counts); }),
        steps_);
  }
  template <EdgeContent kEdgeContent, bool kEdits = false>
  std::unique_ptr<mcmc::PrimaryTarget> target(const UnitContext& context,
                                              film::SampleCounts& sample_counts) const {
    return std::make_unique<mmlt::Target<kEdgeContent, false, kEdits>>(context, options_, planned_.techniques,
                                                                       lengths_, sample_counts);
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
  Plan regularized;
  CANDELA_ASSIGN(
      const ChainRegularization regularization,
      chain_regularization(parsed.regularise, parsed.chains, features, parsed.common.path_options().max_depth,
                           transport::Connecting::bidirectional, regularized));
  return std::unique_ptr<Integrator>(
      std::make_unique<MmltIntegrator>(parsed, features, regularization, regularized));
}

}  // namespace candela::integrators
