#include "worker/mcmc/mutators/registry.h"

#include <array>

#include "worker/mcmc/mutators/bidirectional.h"
#include "worker/mcmc/mutators/half_vector.h"

namespace candela::mcmc {
namespace {

std::unique_ptr<PathMutator> make_bidirectional(const MutatorContext& context) {
  return std::make_unique<BidirectionalMutator>(context);
}
std::unique_ptr<PathMutator> make_half_vector(const MutatorContext& context) {
  return std::make_unique<HalfVectorMutator>(context.scene, HalfVectorRules{});
}

constexpr std::array kMutators{
    MutatorEntry{"bidirectional", 1,
                 "vertices are taken out of the path, and others put there by walks from both sides",
                 make_bidirectional},
    MutatorEntry{"half_vector", 0, "half vectors of the whole path, by a walk", make_half_vector},
};

}  // namespace

std::span<const MutatorEntry> mutators() {
  return kMutators;
}

}  // namespace candela::mcmc
