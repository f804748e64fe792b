// Trials of step sizes before a job: a chain must not learn them on its way [half-vector note, sections 9 and
// 16].
//
// Let X have the density that the chains follow, Y be a proposal of a mutation with steps of size s, a the
// probability of its acceptance, d^2 its PathMutator::squared_move. The best size has the largest
//   E[a d^2] / E[rays]
// which is the expected squared jumping distance [Pasarica 2010] for the work. Sizes of one mutation are
// tried at the same states with the same random numbers.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "worker/mcmc/path_space.h"

namespace candela::mcmc {

// The sizes that are tried, the default first; one alone if the mutation has no steps.
std::vector<StepSize> sizes_of_trials(const MutatorEntry& entry);

// Sums over proposals.
struct StepScore {
  double moves = 0;  // of a d^2
  std::uint64_t rays = 0;
  void add(const StepScore& other) {
    moves += other.moves;
    rays += other.rays;
  }
};

class StepTrials {
 public:
  // importance: of the film; null: 1 everywhere. What they refer to must outlive this.
  StepTrials(const MutatorContext& context, std::span<const MutatorShare> shares,
             const ImageImportance* importance = nullptr);

  // Number of scores: of each share, of each of its sizes_of_trials(); none if it has one size alone.
  std::size_t score_count() const { return trials_.size(); }
  // Makes so many proposals of each from the state that PathSpace::start(start_key) makes, and adds to the
  // scores. key: of all randomness.
  void run(std::uint64_t start_key, std::uint64_t key, std::uint32_t proposals, std::span<StepScore> scores);

 private:
  struct Trial {
    std::size_t share = 0;
    std::unique_ptr<PathSpace> space;  // of this mutation alone
  };
  std::vector<Trial> trials_;
  const ImageImportance* importance_;
};

// The best size of each share by sums of scores; the default if nothing moved.
std::vector<StepSize> best_sizes(std::span<const MutatorShare> shares, std::span<const StepScore> scores);

}  // namespace candela::mcmc
