#include "worker/integrators/optimis/plan.h"

#include <fmt/format.h>

#include "worker/integrators/path/plan.h"

namespace candela::integrators::optimis {
namespace {

scene::LightTechnique selection_named(std::string_view name) {
  return name == "uniform" ? scene::LightTechnique::uniform
         : name == "power" ? scene::LightTechnique::power
                           : scene::LightTechnique::adapted;
}

mis::Heuristic weights_named(std::string_view name) {
  for (const mis::HeuristicName& h : mis::kHeuristics)
    if (h.name == name) return h.heuristic;
  return mis::Heuristic::balance;  // what optimal weights correct
}

// Bytes of the sums of a pixel at the master, both halves.
std::size_t sum_bytes(std::size_t techniques) {
  return 2 * 8 * (mis::packed_size(techniques) + mis::kColors * techniques);
}

}  // namespace

PlannedFirstVertex plan(const OptimisSettings& settings, const estimators::PathOptions& options,
                        const scene::SceneFeatures& features) {
  const bool full = settings.common.full_plan();
  PlannedFirstVertex out{path::plan(options, features, full), {}};
  Plan& plan = out.planned.plan;
  estimators::FirstVertexSetup& setup = out.setup;
  setup.direct_only = settings.depth.value == "direct";
  setup.heuristic = weights_named(settings.weights.value);
  setup.bsdf_is_alone = out.planned.between != transport::Between::nothing;
  // Direct light of other techniques than bsdf sampling, and vertices to light.
  const bool sampled = full || out.planned.techniques.next_event;
  if (sampled && settings.techniques.has("light")) {
    for (const std::string& name : settings.selection.values) {
      if (!full && features.emitters == 1 && !setup.selections.empty())
        plan.skip(fmt::format("light selection '{}'", name),
                  "there is one emitter: all selections are the same");
      else
        setup.selections.push_back(selection_named(name));
    }
  }
  setup.bsdf = sampled && settings.techniques.has("bsdf");
  if (setup.bsdf)
    plan.decide(setup.bsdf, "bsdf sampling as a technique of direct light",
                full || out.planned.techniques.hit_light, "its rays can find light",
                "only point-like emitters: bsdf sampling cannot find them");
  // The choice of lights leaves a smooth environment to scattered rays (scene/emitters/choice/choice.h).
  if (!setup.bsdf && !setup.selections.empty() && features.any_environment && features.emitters > 1) {
    setup.bsdf = true;
    plan.use("bsdf sampling as a technique of direct light",
             "samples of lights may leave the environment out");
  }
  if (setup.selections.empty() && features.any_delta_emitter)
    plan.note("direct light", "bsdf sampling finds no light from points and directions: it is missing");
  const std::size_t n = setup.techniques();
  if (settings.weights.value != "optimal") {
    plan.skip("optimal weights", "weights=" + settings.weights.value);
  } else if (n < 2) {
    plan.skip("optimal weights", n == 0 ? "no light is sampled" : "one technique needs no weights");
  } else if (setup.bsdf_is_alone && setup.selections.size() < 2) {
    plan.skip("optimal weights",
              "bsdf rays cross media or pass surfaces straight, which no weight foresees, and one technique "
              "is left");
  } else {
    setup.controls = true;
    plan.use("optimal weights", fmt::format("{} techniques, {} bytes of sums a pixel, read by {}", n,
                                            sum_bytes(n), settings.estimator.value));
    if (setup.bsdf_is_alone)
      plan.skip("optimal weights of bsdf sampling",
                "its rays cross media or pass surfaces straight, which no weight foresees");
  }
  return out;
}

}  // namespace candela::integrators::optimis
