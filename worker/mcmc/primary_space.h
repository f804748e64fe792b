// The state space of an estimator over its random numbers: Kelemen's mutations of them.
#pragma once

#include <memory>
#include <utility>

#include "worker/mcmc/primary_state.h"
#include "worker/mcmc/state_space.h"

namespace candela::mcmc {

// An estimator as a function of the numbers it draws.
class PrimaryTarget {
 public:
  virtual ~PrimaryTarget() = default;
  // Appends to an empty list. The same numbers give the same bits.
  virtual void evaluate(PrimaryState& numbers, SplatList& out) = 0;
};

class PrimarySpace final : public StateSpace {
 public:
  PrimarySpace(std::unique_ptr<PrimaryTarget> target, StepSizes sizes)
      : owned_(std::move(target)), target_(*owned_), numbers_(sizes) {}
  // The target must outlive it.
  PrimarySpace(PrimaryTarget& target, StepSizes sizes) : target_(target), numbers_(sizes) {}

  void start(std::uint64_t key, SplatList& out) override {
    numbers_.start(key);
    evaluate(out);
  }
  double propose(const Mutation& mutation, SplatList& out) override {
    numbers_.propose(mutation.key, mutation.large);
    evaluate(out);
    return 1;  // both kinds of steps are symmetric
  }
  void accept() override { numbers_.accept(); }
  void reject() override { numbers_.reject(); }
  std::string save() const override { return numbers_.save(); }
  Result<void> restore(std::string_view bytes, SplatList& out) override {
    CANDELA_TRY(numbers_.restore(bytes));
    evaluate(out);
    return {};
  }

 private:
  void evaluate(SplatList& out) {
    out.clear();
    target_.evaluate(numbers_, out);
  }

  std::unique_ptr<PrimaryTarget> owned_;  // null: somebody else's
  PrimaryTarget& target_;
  PrimaryState numbers_;
};

}  // namespace candela::mcmc
