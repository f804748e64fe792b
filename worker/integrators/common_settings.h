// Settings that every integrator has.
#pragma once

#include "common/job/integrator_words.h"
#include "worker/estimators/options.h"
#include "worker/integrators/settings.h"

namespace candela::integrators {

struct CommonSettings {
  int max_depth = integrator_words::kDefaultMaxDepth;
  int rr_depth;
  bool hide_emitters = integrator_words::kHideEmitters.default_value;
  Choice plan{"auto", {"auto", "full"}};

  explicit CommonSettings(const integrator_words::IntegratorWords& words) : rr_depth(words.rr_depth) {}

  bool full_plan() const { return plan.value == "full"; }
  estimators::PathOptions path_options() const {
    return {max_depth < 0 ? estimators::kNoDepthLimit : static_cast<std::uint32_t>(max_depth),
            static_cast<std::uint32_t>(rr_depth), hide_emitters ? 2u : 1u};
  }

  template <class Visitor>
  void path_fields(Visitor& visit, int min_rr_depth = integrator_words::kRrDepth.minimum,
                   std::string_view rr_doc = "path depth from which Russian roulette may end a path") {
    using namespace integrator_words;
    visit(kMaxDepth.name, max_depth, kMaxDepth.minimum, kMaxDepth.maximum,
          "edges of the longest path; -1 none, 1 shows emitters only, 2 adds direct light");
    visit(kRrDepth.name, rr_depth, min_rr_depth, kRrDepth.maximum, rr_doc);
    visit(kHideEmitters.name, hide_emitters, "the camera does not see emitters");
  }
  template <class Visitor>
  void plan_field(Visitor& visit) {
    visit("plan", plan, "auto leaves out what the scene does not need; full runs everything");
  }
};

inline transport::MisHeuristic heuristic_named(std::string_view name) {
  using transport::MisHeuristic;
  return name == "balance"   ? MisHeuristic::balance
         : name == "power"   ? MisHeuristic::power
         : name == "maximum" ? MisHeuristic::maximum
                             : MisHeuristic::cutoff;
}

}  // namespace candela::integrators
