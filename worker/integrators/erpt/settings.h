#pragma once

#include <vector>

#include "worker/integrators/chains/settings.h"
#include "worker/integrators/common_settings.h"
#include "worker/integrators/regularise.h"
#include "worker/mcmc/path_space.h"

namespace candela::integrators {

// Mutations and their shares.
struct ErptMutations {
  Choice preset{"erpt", {"erpt", "mept"}};
  std::vector<double> shares;  // of preset=erpt, in the order of mcmc::mutators()

  ErptMutations();
  template <class Visitor>
  void fields(Visitor& visit) {
    visit(
        "preset", preset,
        "erpt: the shares below; mept (manifold exploration): manifold alone, in place of the shares below");
    for (std::size_t i = 0; i < shares.size(); ++i)
      visit(mcmc::mutators()[i].name, shares[i], NumberRange{0, 1}, mcmc::mutators()[i].doc);
  }
  // The mutations of the preset whose share is above 0.
  std::vector<mcmc::MutatorShare> chosen() const;
};

struct ErptSettings {
  static constexpr double kMaxSeeds = 64;        // per pixel
  static constexpr int kMaxBootstrap = 1 << 22;  // 32 MB of the pilot

  CommonSettings common{integrator_words::kErpt};
  double seeds = 1;
  double chains_per_seed = 0;
  int max_chains = 20;
  double mutations_per_seed = 2;
  int chain_length = 0;
  int bootstrap = 20000;
  ErptMutations mutations;
  Choice direct{"path", {"chain", "path"}};
  int direct_samples = 1;
  bool two_stage = true;
  bool step_trials = false;
  RegulariseSettings regularise;

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit, integrator_words::kRrDepth.minimum,
                       "not read: seeds and their chains have no Russian roulette, and the paths of path "
                       "tracing beside them are short");
    visit("seeds", seeds, NumberRange{0, kMaxSeeds, true}, "seeds of an iteration per pixel");
    visit("chains_per_seed", chains_per_seed, NumberRange{0, 1000},
          "chains that a seed starts on average; 0: 2 / (1 + rho^2), rho^2 the relative variance of seeds in "
          "the pilot");
    visit("max_chains", max_chains, 1, 1000, "most chains of one seed; a brighter seed has brighter chains");
    visit("mutations_per_seed", mutations_per_seed, NumberRange{0, 1000, true},
          "with chain_length=0: mutations of an iteration for each seed, on average");
    visit("chain_length", chain_length, 0, 1 << 20,
          "mutations of a chain; 0: mutations_per_seed over the chains of a seed");
    visit("bootstrap", bootstrap, 1, kMaxBootstrap,
          "independent samples of the pilot, from which the energy of a chain follows");
    mutations.fields(visit);
    visit("direct", direct,
          "path: path tracing renders light seen directly or after one bounce, the chains the rest; chain: "
          "the chains render light after one bounce too");
    visit("direct_samples", direct_samples, 1, 1 << 10,
          "eye samples per pixel in an iteration, for what is left to path tracing");
    visit("two_stage", two_stage,
          "seeds and chains follow light over the brightness of the image, as a first stage finds it: dark "
          "parts of the image get as many mutations as bright ones");
    visit("step_trials", step_trials, kStepTrialsDoc);
    regularise.fields(visit);
    common.plan_field(visit);
  }
};
// One of the shares is above 0; with preset=mept all have their defaults.
Result<void> check(const ErptSettings& settings);

}  // namespace candela::integrators
