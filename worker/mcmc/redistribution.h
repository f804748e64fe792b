// Energy redistribution [Cline 2005]: independent seeds start chains that spread their energy, and that end
// with the unit [metropolis-photons note, sections 1 and 2].
//
// A seed u of scalar contribution I starts n chains of M mutations each. With the energy e_d of a chain, and
// at most n_max chains a seed,
//   x = min(I / e_d, n_max),   e = I / x,   n = floor(x + xi),   xi uniform and used for nothing else
// so that E[n e | u] = I. Each mutation deposits e F / (I M N) of the states that it leads to, N the number
// of seeds. Mutations keep the measure I du, whatever they start from; so the sum over all chains has the
// mean F for every M >= 1 and every e_d > 0, without a normalization and without burn-in.
//
// Rounding to the nearest number, cuts of I, and limits to the deposits of one state would remove light for
// ever [metropolis-photons note, section 3]; n_max raises the energy instead.
#pragma once

#include <cstdint>

#include "worker/mcmc/chain.h"

namespace candela::mcmc {

struct RedistributionRules {
  double energy = 1;            // e_d, > 0, in units of I
  std::uint64_t mutations = 1;  // M of each chain, >= 1
  double max_chains = 20;       // n_max of a seed, >= 1
  // The importance of the film is a factor of I. Null: it is 1 everywhere.
  const ImageImportance* importance = nullptr;
};

struct ChainsOfSeed {
  std::uint64_t count = 0;  // n
  double energy = 0;        // e, of each chain
};
// scalar: I > 0. u: uniform in [0, 1).
ChainsOfSeed chains_of_seed(double scalar, const RedistributionRules& rules, double u);

// Keys of a seed: of the independent sample, of xi, of the chains. No other randomness has them.
struct SeedKeys {
  std::uint64_t sample = 0, rounding = 0, chains = 0;
};

// Work of some seeds.
struct RedistributionCounts {
  std::uint64_t chains = 0, mutations = 0, accepted = 0;
};

// One seed and its chains. The weight of a deposit leaves out 1 / (M N). False: it was stopped, and what was
// deposited is useless.
bool redistribute(StateSpace& space, const SeedKeys& keys, const RedistributionRules& rules,
                  const ChainOutlets& outlets, Deposit& deposit, RedistributionCounts& counts);

}  // namespace candela::mcmc
