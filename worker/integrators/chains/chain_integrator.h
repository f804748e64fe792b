// Common parts of integrators of Markov chains: bootstrap, segments over threads, direct light.
// Each brings the state space that its chains walk over.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "worker/integrators/chains/settings.h"
#include "worker/integrators/integrator.h"
#include "worker/integrators/path/plan.h"
#include "worker/mcmc/image_importance.h"
#include "worker/mcmc/mutators/registry.h"
#include "worker/mcmc/state_space.h"

namespace candela::integrators {

// What a chain's state space depends on, beside the job.
struct SpaceRules {
  double bandwidth = 0;                   // of mollified paths, if there are any
  std::span<const mcmc::StepSize> sizes;  // of mutations' steps; none: nobody chose them
};

class ChainIntegrator : public Integrator {
 public:
  Result<Decision> decide(const UnitContext& context, const RunContext& run) const final;
  WorkPlan work(FilmSize size, const NamedState& state) const final;
  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& input, UnitOutput& output,
                   const RunContext& run) const final;
  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const final;

 protected:
  // options: of all paths. The plan has items of direct light and of what Metropolis may gain.
  // shortest: edges of the shortest path that chains can follow, at most 3; whatever is shorter is left to
  // path tracing.
  ChainIntegrator(const ChainSettings& settings, const estimators::PathOptions& options,
                  const scene::SceneFeatures& features, bool full_plan, std::uint32_t shortest = 1);

  // Fails where the chains cannot follow light in such a scene.
  virtual Result<void> check_scene(const scene::Scene& /*scene*/) const { return {}; }
  // Step sizes of the mutations, by trials before the job; as many as step_count() says. Adds lines to the
  // plan.
  virtual Result<std::vector<mcmc::StepSize>> choose_steps(const UnitContext& /*context*/,
                                                           const mcmc::ImageImportance& /*importance*/,
                                                           Plan& /*plan*/, const RunContext& /*run*/) const {
    return std::vector<mcmc::StepSize>();
  }
  // 0: choose_steps() chooses none.
  virtual std::size_t step_count() const { return 0; }
  // Another one for each thread and chain. It counts into the sample counts and outlives neither them nor the
  // context.
  virtual std::unique_ptr<mcmc::StateSpace> make_space(const UnitContext& context,
                                                       film::SampleCounts& sample_counts,
                                                       const SpaceRules& rules) const = 0;

  // Options of the paths that the chains follow.
  const estimators::PathOptions& chain_options() const { return chain_options_; }

  Plan plan_;
  ChainRegularization regularization_;

 private:
  // The pilot decides these for the whole job.
  struct Decided {
    std::vector<mcmc::StepSize> sizes;
    mcmc::ImageImportance importance;
  };

  ChainPlan chain_plan(FilmSize size) const;
  Result<void> run_bootstrap(const UnitContext& context, const Unit& unit, const Decided& decided,
                             UnitOutput& output, const RunContext& run) const;
  // With b0 = 0 (nothing found) chains stand still, and only what needs no chain is added. Fails (input) if
  // a start cannot be one of this job and index.
  Result<void> run_segments(const UnitContext& context, const Unit& unit, const UnitInput& input,
                            const Decided& decided, UnitOutput& output, const RunContext& run) const;

  ChainSettings settings_;
  bool direct_by_path_ = false;
  estimators::PathOptions all_options_, chain_options_, direct_options_;
  Planned direct_;
};

// Decides which paths the chains mollify, and adds a line to the plan. Fails (usage) if the other settings,
// or the job's layers, exclude it.
Result<ChainRegularization> chain_regularization(const ChainRegulariseSettings& settings,
                                                 const ChainSettings& chains,
                                                 const scene::SceneFeatures& features,
                                                 std::uint32_t max_depth, transport::Connecting techniques,
                                                 Plan& plan);

}  // namespace candela::integrators
