// The space of paths as a chain's state space [Veach 1997, ch. 11].
//
// A bootstrap sample, and a large step, is one path: its length k is drawn (path_lengths.h), then one of the
// ways of bidirectional path tracing to make such a path, each as probable as the others (subpaths.h). Let
// p(X) be the density of X by all of them. The measure of the space is p(X) dX: large steps are uniform in
// it, the scalar contribution is I = f* / p, and the quotient of transitions has p in it,
//   T(Y -> X) p(Y) / (T(X -> Y) p(X)).
// A path of p = 0 is none of the chain's: no technique of bidirectional path tracing makes it.
//
// Other steps: a mutation is chosen with the probability
//   pi_j(X) = share_j suitability_j(X) / sum of all shares and suitabilities
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "worker/core/inline_vector.h"
#include "worker/mcmc/mutators/registry.h"
#include "worker/mcmc/mutators/subpaths.h"
#include "worker/mcmc/path_lengths.h"
#include "worker/mcmc/state_space.h"
#include "worker/transport/letters/path_letters.h"

namespace candela::mcmc {

struct MutatorShare {
  const MutatorEntry* entry = nullptr;
  double share = 0;  // > 0
};

class PathSpace final : public StateSpace {
 public:
  // letters: for layers by expressions; null: nobody asks for some.
  PathSpace(const MutatorContext& context, std::span<const MutatorShare> shares,
            const transport::PathLetters* letters = nullptr);
  PathSpace(const PathSpace&) = delete;  // mutators count rays in it
  PathSpace& operator=(const PathSpace&) = delete;

  void start(std::uint64_t key, SplatList& out) override;
  double propose(const Mutation& mutation, SplatList& out) override;
  void accept() override;
  void reject() override;
  std::string save() const override;
  Result<void> restore(std::string_view bytes, SplatList& out) override;

  // The seed of the path that start(key) makes: its sample is the key.
  transport::path::PathSeed seed(std::uint64_t key) const;
  // Nothing: there is no present state.
  const PathState* present() const { return present_ ? &present_->path : nullptr; }
  // log p. Nothing: it is 0, or cannot be held.
  std::optional<double> log_pdf_area(const PathState& path) const;
  std::vector<chains::MutationCounts> take_counts() override;
  // By mutation, in the order of the shares.
  const std::vector<chains::MutationCounts>& counts() const { return counts_; }

 private:
  struct State {
    PathState path;
    double log_density = 0;                 // log p
    InlineVector<double, 8> suitabilities;  // times shares, by mutation
    double suitability_sum = 0;
  };
  struct Technique {
    std::size_t vertices = 0, s = 0;
  };

  Technique choose(rng::Stream& stream) const;
  std::optional<State> independent(std::uint64_t key) const;
  // near: as of path_state().
  std::optional<State> state(transport::path::Path path, const PathState* near = nullptr) const;
  double propose_mutation(std::uint64_t key);
  double quotient(const State& from, const PathMutator& mutator, rng::Stream& draws, MutationFailure& why);
  void put(const State& state, SplatList& out) const;

  std::uint64_t rays_ = 0;                // of all that was done so far
  transport::path::FoundSurfaces found_;  // of the path that is being made
  const MutatorContext context_;
  const transport::PathLetters* const letters_;
  transport::path::Rules rules_;
  PathLengths lengths_;
  std::vector<double> log_prob_lengths_;  // of the shortest ones
  Subpaths subpaths_;
  std::vector<double> shares_;
  std::vector<std::unique_ptr<PathMutator>> mutators_;
  std::optional<State> present_, proposal_;
  // There is no present state: it was this path, which has no light with the bandwidth of this space.
  transport::path::Path lost_;
  std::size_t mutator_ = 0;  // of the proposal; their number: a large step
  std::vector<chains::MutationCounts> counts_;
};

}  // namespace candela::mcmc
