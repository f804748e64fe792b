// Metropolis light transport in primary sample space [Kelemen 2002]: chains over the random numbers of path
// tracing or bidirectional path tracing.
// The pssmlt integrator: settings, plan, and the choice of a target (targets.h) by them.
#include "worker/integrators/bidirectional/plan.h"
#include "worker/integrators/chains/chain_integrator.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/path/plan.h"
#include "worker/integrators/plan_edge_content.h"
#include "worker/integrators/plan_walks.h"
#include "worker/integrators/pssmlt/mollified.h"
#include "worker/integrators/pssmlt/settings.h"
#include "worker/integrators/pssmlt/targets.h"
#include "worker/mcmc/primary_space.h"

namespace candela::integrators {
namespace {

using transport::EdgeContent;

class PssmltIntegrator final : public ChainIntegrator {
 public:
  PssmltIntegrator(const PssmltSettings& settings, const scene::SceneFeatures& features,
                   const ChainRegularization& regularization, const Plan& regularized)
      : ChainIntegrator(settings.chains, settings.path_options(), features, settings.common.full_plan()),
        over_path_(settings.over.value == "path"),
        options_(chain_options()),
        steps_{settings.steps.step_least, settings.steps.step_most} {
    regularization_ = regularization;
    const Mollifies mollifies = settings.regularise.mollifies();
    if (over_path_) {
      options_.heuristic = transport::MisHeuristic::power;
      planned_ = path::plan(options_, features, settings.common.full_plan(), false, mollifies);
    } else {
      planned_ = bidirectional::plan(options_, features, settings.common.full_plan(), mollifies);
      note_lasting_media(features, options_.max_depth, options_.rr_depth, planned_.plan);
    }
    plan_.append(planned_.plan);
    plan_.append(regularized);
    // Also if all surfaces are specular, and nothing else is connected.
    if (regularization.runs() && !over_path_) planned_.techniques.light_paths = true;
  }

 private:
  std::unique_ptr<mcmc::StateSpace> make_space(const UnitContext& context, film::SampleCounts& sample_counts,
                                               double bandwidth) const override {
    return std::make_unique<mcmc::PrimarySpace>(make_target(context, sample_counts, bandwidth), steps_);
  }
  std::unique_ptr<mcmc::PrimaryTarget> make_target(const UnitContext& context,
                                                   film::SampleCounts& sample_counts,
                                                   double bandwidth) const {
    if (regularization_.runs())
      return pssmlt::make_mollified_target(over_path_, context, options_, planned_.techniques, bandwidth,
                                           sample_counts);
    if (over_path_)
      return std::make_unique<pssmlt::PathTarget>(
          context, options_, planned_.techniques,
          estimators::path_radiance_in<mcmc::PrimarySampler>(context.scene, planned_.between,
                                                             context.letters != nullptr),
          sample_counts);
    if (context.scene.objects().path_edits != nullptr)
      return bdpt_target<EdgeContent::media, true>(context, sample_counts);
    return with_edge_content(planned_.between,
                             [&](auto between) { return bdpt_target<between()>(context, sample_counts); });
  }
  template <EdgeContent kEdgeContent, bool kEdits = false>
  std::unique_ptr<mcmc::PrimaryTarget> bdpt_target(const UnitContext& context,
                                                   film::SampleCounts& sample_counts) const {
    return std::make_unique<pssmlt::BdptTarget<kEdgeContent, false, kEdits>>(
        context, options_, planned_.techniques, sample_counts);
  }

  bool over_path_;
  estimators::PathOptions options_;
  mcmc::StepSizes steps_;
  Planned planned_;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_pssmlt_integrator(const SettingsMap& settings,
                                                           const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const PssmltSettings parsed, parse_settings<PssmltSettings>(settings));
  CANDELA_TRY(check(parsed.chains));
  CANDELA_TRY(check(parsed.steps));
  using transport::Connecting;
  const Connecting techniques =
      parsed.over.value == "path" ? Connecting::next_event : Connecting::bidirectional;
  Plan regularized;
  CANDELA_ASSIGN(const ChainRegularization regularization,
                 chain_regularization(parsed.regularise, parsed.chains, features,
                                      parsed.path_options().max_depth, techniques, regularized));
  return std::unique_ptr<Integrator>(
      std::make_unique<PssmltIntegrator>(parsed, features, regularization, regularized));
}

}  // namespace candela::integrators
