// Bidirectional path tracing [Veach 1997, ch. 10]: a path from the eye and one from the light for each pixel,
// every vertex of the one connected to every vertex of the other, all weighed by multiple importance
// sampling.
// The bdpt integrator: settings, plan, and the choice of an estimator (estimators/bidirectional.h) by them.
#include "worker/estimators/edited_subpaths.h"
#include "worker/integrators/bdpt/lettered.h"
#include "worker/integrators/bdpt/mollified.h"
#include "worker/integrators/bdpt/run_kernel.h"
#include "worker/integrators/bdpt/settings.h"
#include "worker/integrators/bidirectional/plan.h"
#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/plan_edge_content.h"
#include "worker/integrators/plan_walks.h"
#include "worker/scene/objects.h"

namespace candela::integrators {
namespace {

using bdpt::TechniqueLayers;
using estimators::PathOptions;
using transport::EdgeContent;
using transport::MisHeuristic;

template <EdgeContent kB, class MisT, bool kL, bool kE = false>
struct FilmConfig : estimators::BidirectionalConfig<kB, MisT, bdpt::FilmSink, kL> {
  static constexpr bool kEdits = kE;
};

using bdpt::Run;
using bdpt::run_kernel;

template <EdgeContent kEdgeContent, bool kEdits = false>
Run run_for(MisHeuristic heuristic) {
  switch (heuristic) {
    case MisHeuristic::balance:
      return &run_kernel<FilmConfig<kEdgeContent, transport::Balance, false, kEdits>>;
    case MisHeuristic::power:
      return &run_kernel<FilmConfig<kEdgeContent, transport::Power, false, kEdits>>;
    case MisHeuristic::maximum:
    case MisHeuristic::cutoff:
      break;
  }
  return &run_kernel<FilmConfig<kEdgeContent, transport::Balance, true, kEdits>>;
}

class BdptIntegrator final : public IterationIntegrator {
 public:
  BdptIntegrator(const PathOptions& options, Planned planned, TechniqueLayers layers,
                 const Regularization& regularization)
      : IterationIntegrator(options, std::move(planned)),
        layers_(std::move(layers)),
        regularization_(regularization) {}

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                   UnitOutput& output, const RunContext& run_context) const override {
    Run chosen = nullptr;
    if (context.scene.objects().path_edits != nullptr)
      chosen = run_for<EdgeContent::media, true>(options_.heuristic);
    else if (regularization_.runs())
      chosen = bdpt::mollified_run_for(options_.heuristic);
    else if (const scene::SceneFeatures& f = context.scene.features();
             context.letters != nullptr && f.media == 0 && !f.any_passthrough)
      chosen = bdpt::lettered_run_for(options_.heuristic);
    else
      chosen = with_edge_content(planned_.between,
                                 [&](auto between) { return run_for<between()>(options_.heuristic); });
    return chosen(context, options_, planned_.techniques, layers_, regularization_, unit, *output.film,
                  run_context);
  }

  WorkPlan work(FilmSize /*size*/, const NamedState& /*state*/) const override {
    return {.layers = layers_.names()};
  }

 private:
  const TechniqueLayers layers_;
  const Regularization regularization_;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_bdpt_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const BdptSettings parsed, parse_settings<BdptSettings>(settings));
  PathOptions options = parsed.common.path_options();
  options.heuristic = heuristic_named(parsed.heuristic.value);
  Planned planned =
      bidirectional::plan(options, features, parsed.common.full_plan(), parsed.regularise.mollifies());
  note_lasting_media(features, options.max_depth, options.rr_depth, planned.plan);
  const Regularization regularization = plan_regularization(
      parsed.regularise, features, options.max_depth, transport::Connecting::bidirectional, planned.plan);
  CANDELA_TRY(check(regularization, features));
  // Also if all surfaces are specular, and nothing else is connected.
  if (regularization.runs()) planned.techniques.light_paths = true;
  TechniqueLayers layers;
  if (const std::string& asked = parsed.layers.value; asked != "none" && options.max_depth > 0)
    layers = TechniqueLayers(asked != "unweighted", asked != "weighted",
                             static_cast<std::uint32_t>(parsed.layer_depth), options.max_depth,
                             features.finite_lens);
  if (regularization.layer()) layers.add_mollified();
  const std::size_t layer_count = layers.names().size();
  if (layer_count + 1 > film::kMaxLayers) {
    return usage_error("techniques of paths of " + std::to_string(parsed.layer_depth) + " edges need " +
                       std::to_string(layer_count) + " layers; a film has at most " +
                       std::to_string(film::kMaxLayers - 1))
        .with_field("layer_depth")
        .with_mend("lower layer_depth, or ask for weighted or unweighted layers alone");
  }
  return std::unique_ptr<Integrator>(
      std::make_unique<BdptIntegrator>(options, std::move(planned), std::move(layers), regularization));
}

}  // namespace candela::integrators
