#include "worker/mcmc/redistribution.h"

#include <algorithm>
#include <cmath>

#include "common/rng/stream.h"

namespace candela::mcmc {

ChainsOfSeed chains_of_seed(double scalar, const RedistributionRules& rules, double u) {
  const double expected = std::min(scalar / rules.energy, rules.max_chains);
  if (!(expected > 0)) return {};
  return {static_cast<std::uint64_t>(std::floor(expected + u)), scalar / expected};
}

bool redistribute(StateSpace& space, const SeedKeys& keys, const RedistributionRules& rules,
                  const ChainOutlets& outlets, Deposit& deposit, RedistributionCounts& counts) {
  Walker walker{space, SplatList(rules.importance), 0, 0, {}};
  space.start(keys.sample, walker.present);
  if (outlets.fault != nullptr && !walker.present.splats().empty()) {
    outlets.fault(keys.sample, &walker.present.editable()[0].value.r);
    walker.present.sum_again();
  }
  const double scalar = usable_scalar(walker.present, outlets.sample_counts);
  if (!(scalar > 0)) return true;
  const ChainsOfSeed chains = chains_of_seed(scalar, rules, rng::Stream(keys.rounding).next_double());
  ChainRules of_chain;
  of_chain.b0 = chains.energy;
  of_chain.prob_large = 0;
  const SplatList seed = walker.present;
  for (std::uint64_t c = 0; c < chains.count; ++c) {
    if (c > 0) {
      space.start(keys.sample, walker.present);
      walker.present = seed;
    }
    walker.scalar = scalar;
    walker.key = rng::combine(keys.chains, c);
    walker.counts = {};
    if (!run_mutations(walker, rules.mutations, of_chain, outlets, deposit)) return false;
    ++counts.chains;
    counts.mutations += walker.counts.mutations;
    counts.accepted += walker.counts.accepted;
  }
  return true;
}

}  // namespace candela::mcmc
