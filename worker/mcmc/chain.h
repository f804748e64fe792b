// A segment of one Metropolis chain [Metropolis 1953] [Veach 1997, ch. 11].
//
// The chain's states x have the density I(x) / b, I the scalar contribution, b its integral. Two estimators
// of the image F are taken of the same mutations and weighed against each other [Kelemen 2002, Sec. 4], by
// the balance heuristic with b0, a first estimate of b that is the same for the whole job:
//   the chain's states,  density I / b,   weight (I / b0) / (I / b0 + p)
//   large steps, which are independent uniform samples, p of them a mutation, weight p / (I / b0 + p)
// whatever became of them. The weights sum to one for every b0, and none depends on b. Of each mutation both
// the proposal y and the present state x count as the next state, with the probabilities a and 1 - a of
// becoming it [Veach 1997, Sec. 11.3.3: expected values]. So to the film go, F divided by (I / b0 + p),
//   layer 0   times a for y and 1 - a for x: b0 / b times what the chain's share of the image is
//   layer 1   for y of large steps: the rest of the image
// each times pixels / mutations of a segment (docs/normalisation.md).
#pragma once

#include <atomic>
#include <cstdint>

#include "common/base/result.h"
#include "common/chains/chains.h"
#include "worker/mcmc/state_space.h"
#include "worker/transport/splat.h"

namespace candela::mcmc {

inline constexpr std::uint32_t kChainsLayer = 0, kIndependentLayer = 1;

struct ChainRules {
  std::uint64_t seed = 0;  // of the job
  double b0 = 0;           // > 0
  double prob_large = 0.3;
  std::uint64_t segment_mutations = 0;
  double pixels = 1;
  // The importance of the film is a factor of the scalar contribution I. Null: it is 1 everywhere.
  const ImageImportance* importance = nullptr;
  // The target changes between segments: a state of an earlier segment may have the contribution 0. The chain
  // then takes the first proposal that has any. Records have sums of mollified paths.
  bool states_vanish = false;
};

// The key of bootstrap sample i, which is where a chain that starts there starts from.
std::uint64_t bootstrap_key(std::uint64_t seed, std::uint64_t sample);

// Progress of a unit's chains, for all its threads.
class ChainProgress {
 public:
  // told: may be null; in [0, 1].
  ChainProgress(double all_mutations, std::atomic<float>* told) : all_(all_mutations), told_(told) {}
  void add(std::uint64_t mutations) {
    const std::uint64_t done = done_.fetch_add(mutations, std::memory_order_relaxed) + mutations;
    if (told_ != nullptr)
      told_->store(static_cast<float>(static_cast<double>(done) / all_), std::memory_order_relaxed);
  }

 private:
  double all_;
  std::atomic<float>* told_;
  std::atomic<std::uint64_t> done_{0};
};

// Receivers of the contributions and counts of a chain.
struct ChainOutlets {
  const transport::Splatter* film = nullptr;  // null: nowhere (tests of the chain alone)
  film::SampleCounts& sample_counts;          // rejected samples
  const std::atomic<bool>* stop = nullptr;
  ChainProgress* progress = nullptr;
  void (*fault)(std::uint64_t key, float* rgb) = nullptr;  // of integrators::RunContext
  // Letters for layers by expressions: first the chains' part for every expression, then the independent
  // parts; null: the job has none.
  const transport::PathLetters* letters = nullptr;
  // Layer of what mollified paths brought: of the chains' part, the independent part behind it; 0: none.
  std::uint32_t mollified_layer = 0;
};

// Receives the contributions of mutations. The weight of a list leaves out the number of mutations and
// pixels; the key names it.
class Deposit {
 public:
  virtual ~Deposit() = default;
  virtual void add(std::uint32_t layer, const SplatList& list, double weight, std::uint64_t key) = 0;
};

// A chain on its way.
struct Walker {
  StateSpace& space;
  SplatList present;           // of the space's present state
  double scalar = 0;           // its scalar contribution, > 0 unless states vanish
  std::uint64_t key = 0;       // of the chain
  chains::ChainCounts counts;  // mutations so far name the next one
};

// So many mutations of a chain, of a segment or of a short chain inside a unit. With rules.prob_large = 0 and
// rules.b0 = e each mutation deposits the energy e. False: it was stopped, and what was deposited is useless.
bool run_mutations(Walker& walker, std::uint64_t mutations, const ChainRules& rules,
                   const ChainOutlets& outlets, Deposit& deposit);

// One segment of chain number `chain`: `record` becomes the chain after it. Fails (input) where the start
// cannot be of this job. A stop leaves film and record useless.
Result<void> run_segment(StateSpace& space, const ChainRules& rules, std::uint64_t chain,
                         const chains::ChainStart& start, const ChainOutlets& outlets,
                         chains::ChainRecord& record);

// The scalar contribution of `list`, 0 where it cannot be used: then it is emptied and its cause counted.
double usable_scalar(SplatList& list, film::SampleCounts& sample_counts);

}  // namespace candela::mcmc
