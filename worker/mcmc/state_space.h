// State space of a Markov chain. It holds the present state and at most one proposal. The implementation
// chooses how states are represented and proposed: random numbers of an estimator (primary_space.h), or
// paths with mutations of their own.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/chains/chains.h"
#include "worker/mcmc/splat_list.h"

namespace candela::mcmc {

struct Mutation {
  std::uint64_t key = 0;  // of all randomness in it
  bool large = false;     // the proposal is an independent sample of the bootstrap's density
};

class StateSpace {
 public:
  virtual ~StateSpace() = default;

  // The present state becomes the independent sample of this key, whatever it was; `out`: what it adds.
  virtual void start(std::uint64_t key, SplatList& out) = 0;

  // Proposes a state; `out`: what it adds. Returns T(proposal -> present) / T(present -> proposal), the
  // quotient of the two densities of transition: 1 where they are equal. accept() or reject() must follow.
  virtual double propose(const Mutation& mutation, SplatList& out) = 0;
  virtual void accept() = 0;
  virtual void reject() = 0;

  // The present state as bytes, at most chains::kMaxStateBytes; and back, `out` then being what it adds, to
  // the bit what it was. restore() fails (input) on bytes that save() cannot have made.
  virtual std::string save() const = 0;
  virtual Result<void> restore(std::string_view bytes, SplatList& out) = 0;

  // Counts by mutation since the space was made, or since take_counts() was last called: of the calls of
  // propose() alone, so that they are the same however a chain is cut into segments.
  virtual std::vector<chains::MutationCounts> take_counts() { return {}; }
};

}  // namespace candela::mcmc
