#include "worker/integrators/bdpt/lettered.h"

#include "worker/integrators/bdpt/run_kernel.h"

namespace candela::integrators::bdpt {
namespace {

template <class MisT, bool kL>
struct LetteredConfig {
  static constexpr transport::Between kBetween = transport::Between::nothing;
  static constexpr bool kLists = kL;
  static constexpr bool kLetters = true;
  using Mis = MisT;
  using Sampler = samplers::Sampler;
  using Sink = FilmSink;
  using Choice = estimators::EveryTechnique;
};

}  // namespace

Run lettered_run_for(transport::MisHeuristic heuristic) {
  using transport::MisHeuristic;
  switch (heuristic) {
    case MisHeuristic::balance:
      return &run_kernel<LetteredConfig<transport::Balance, false>>;
    case MisHeuristic::power:
      return &run_kernel<LetteredConfig<transport::Power, false>>;
    case MisHeuristic::maximum:
    case MisHeuristic::cutoff:
      break;
  }
  return &run_kernel<LetteredConfig<transport::Balance, true>>;
}

}  // namespace candela::integrators::bdpt
