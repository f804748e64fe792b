#include "worker/integrators/bdpt/lettered.h"

#include "worker/integrators/bdpt/run_kernel.h"

namespace candela::integrators::bdpt {
namespace {

template <class MisT, bool kL>
struct LetteredConfig : estimators::BidirectionalConfig<transport::EdgeContent::nothing, MisT, FilmSink, kL> {
  static constexpr bool kLetters = true;
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
