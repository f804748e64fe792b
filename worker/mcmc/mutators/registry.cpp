#include "worker/mcmc/mutators/registry.h"

#include <array>

#include "worker/mcmc/mutators/bidirectional.h"

namespace candela::mcmc {
namespace {

std::unique_ptr<PathMutator> make_bidirectional(const MutatorContext& context) {
  return std::make_unique<BidirectionalMutator>(context);
}

constexpr std::array kMutators{
    MutatorEntry{"bidirectional", 1,
                 "vertices are taken out of the path, and others put there by walks from both sides",
                 make_bidirectional},
};

}  // namespace

std::span<const MutatorEntry> mutators() {
  return kMutators;
}

}  // namespace candela::mcmc
