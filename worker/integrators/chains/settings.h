// Settings of integrators of Markov chains: those of all, and those of chains in primary sample space.
#pragma once

#include "common/chains/chains.h"
#include "worker/integrators/regularise.h"
#include "worker/integrators/settings.h"

namespace candela::integrators {

// Small steps in primary sample space.
struct PrimarySettings {
  double step_least = 1.0 / 1024;
  double step_most = 1.0 / 64;

  template <class Visitor>
  void fields(Visitor& visit) {
    visit("step_least", step_least, NumberRange{0, 0.5, true},
          "smallest distance of a small step, of [0, 1)");
    visit("step_most", step_most, NumberRange{0, 0.5, true}, "largest distance of a small step");
  }
};
// The smallest step is no larger than the largest.
Result<void> check(const PrimarySettings& settings);

struct ChainSettings {
  int chains = 1000;
  int bootstrap = 100000;
  int mutations = 16;
  double large_step = 0.3;
  Choice direct{"chain", {"chain", "path"}};
  int direct_samples = 16;
  bool two_stage = true;

  // `of_space`: the settings of the chains' state space, which stand amid these.
  template <class Visitor, class OfSpace>
  void fields(Visitor& visit, OfSpace& of_space) {
    visit("chains", chains, 2, static_cast<int>(chains::kMaxChains),
          "Markov chains of the job, an even number; it does not depend on the workers");
    visit("bootstrap", bootstrap, 1, static_cast<int>(chains::kMaxBootstrapSamples),
          "samples for the first estimate of the normalization b and for the starts of the chains");
    visit("mutations", mutations, 1, 1 << 16,
          "mutations per pixel in one round, in which each chain does one segment");
    visit("large_step", large_step, NumberRange{0, 1},
          "probability of a large step, which forgets the chain's state");
    of_space.fields(visit);
    visit("direct", direct,
          "path: path tracing renders light seen directly or after one bounce, the chains the rest; chain: "
          "the chains render all");
    visit("direct_samples", direct_samples, 1, 1 << 16,
          "with direct=path: eye samples per pixel in one round");
    visit(
        "two_stage", two_stage,
        "chains follow light over the brightness of the image, as a first stage finds it: dark parts of the "
        "image get as many mutations as bright ones");
  }
};
// For chains that mollify what their estimator cannot sample.
struct ChainRegulariseSettings : RegulariseSettings {
  Choice schedule{"power", {"power", "geometric"}};

  template <class Visitor>
  void fields(Visitor& visit) {
    RegulariseSettings::fields(visit);
    visit("regularise_schedule", schedule,
          "how the radius falls over the mutations of a chain: power, by epochs of 10000; geometric, by 1e-4 "
          "each, is for comparison alone: its chains freeze");
  }
};

// The number of chains is even.
Result<void> check(const ChainSettings& settings);

}  // namespace candela::integrators
