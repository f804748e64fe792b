// A short chain inside a unit: it starts from an exact sample and ends with the unit. Its target is the
// indicator function of a set of primary samples, so a proposal is accepted if and only if it is in the set.
//
// The mutation keeps the uniform density on the set. The start is uniform on the set, hence so is each state
// [metropolis-photons note, sections 1 and 6]. No burn-in, no normalization constant; nothing of the chain
// goes to another unit.
#pragma once

#include <atomic>
#include <concepts>
#include <cstdint>

#include "common/rng/stream.h"
#include "worker/mcmc/primary_state.h"

namespace candela::mcmc {

struct ShortChain {
  std::uint64_t start = 0;  // key of the first state, which is in the set
  std::uint64_t key = 0;    // of the mutations; no other randomness of the unit has it
  std::uint64_t mutations = 0;
};

// Mutations of chain number `chain` of `chains`, which share `mutations`. A function of numbers alone: if a
// length depended on states, states would not be uniform given their weights.
constexpr std::uint64_t short_chain_length(std::uint64_t mutations, std::uint64_t chains,
                                           std::uint64_t chain) {
  return mutations / chains + (chain < mutations % chains ? 1 : 0);
}

// The set, and what its elements bring. It holds a present state and at most one proposal.
//   start(numbers)     the present state is that of these numbers
//   propose(numbers)   the proposal is that of these numbers; true: it is in the set
//   accept(), reject() the proposal becomes the present state, or is forgotten
//   deposit(weight)    the present state counts with this weight, and no more after that
template <class T>
concept IndicatorTarget = requires(T target, PrimaryState& numbers) {
  target.start(numbers);
  { target.propose(numbers) } -> std::same_as<bool>;
  target.accept();
  target.reject();
  target.deposit(1.0);
};

// Runs the chain and returns the number of accepted mutations. The weights of the chain's states, the start
// included, sum to one. A stop leaves the deposits useless.
template <IndicatorTarget Target>
std::uint64_t run_short_chain(PrimaryState& numbers, const ShortChain& chain, Target& target,
                              const std::atomic<bool>* stop = nullptr) {
  const double states = static_cast<double>(chain.mutations) + 1;
  std::uint64_t accepted = 0, stay = 1;  // stay: how often the present state counts so far
  numbers.start(chain.start);
  target.start(numbers);
  for (std::uint64_t t = 0; t < chain.mutations; ++t) {
    if (t % 64 == 0 && stop != nullptr && stop->load(std::memory_order_relaxed)) return accepted;
    numbers.propose(rng::combine(chain.key, t), false);
    if (target.propose(numbers)) {
      target.deposit(static_cast<double>(stay) / states);
      numbers.accept();
      target.accept();
      ++accepted;
      stay = 1;
    } else {
      numbers.reject();
      target.reject();
      ++stay;
    }
  }
  target.deposit(static_cast<double>(stay) / states);
  return accepted;
}

}  // namespace candela::mcmc
