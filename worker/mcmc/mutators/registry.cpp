#include "worker/mcmc/mutators/registry.h"

#include <algorithm>
#include <array>

#include "worker/mcmc/mutators/bidirectional.h"
#include "worker/mcmc/mutators/caustic.h"
#include "worker/mcmc/mutators/half_vector.h"
#include "worker/mcmc/mutators/lens.h"
#include "worker/mcmc/mutators/manifold.h"

namespace candela::mcmc {
namespace {

std::unique_ptr<PathMutator> make_bidirectional(const MutatorContext& context) {
  return std::make_unique<BidirectionalMutator>(context);
}
std::unique_ptr<PathMutator> make_lens(const MutatorContext& context) {
  return std::make_unique<LensMutator>(context, LensRules{false, film_step(context)});
}
std::unique_ptr<PathMutator> make_caustic(const MutatorContext& context) {
  return std::make_unique<CausticMutator>(context, film_step(context));
}
std::unique_ptr<PathMutator> make_multichain(const MutatorContext& context) {
  return std::make_unique<LensMutator>(context, LensRules{true, film_step(context)});
}
// [half-vector note, section 9] has 2 % of the film's shorter side.
std::unique_ptr<PathMutator> make_manifold(const MutatorContext& context) {
  return std::make_unique<ManifoldMutator>(context, 0.02 * std::min(context.film_width, context.film_height));
}
std::unique_ptr<PathMutator> make_half_vector(const MutatorContext& context) {
  return std::make_unique<HalfVectorMutator>(context.scene, HalfVectorRules{});
}

constexpr std::array kMutators{
    MutatorEntry{"bidirectional", 1,
                 "vertices are taken out of the path, and others put there by walks from both sides",
                 make_bidirectional},
    MutatorEntry{"lens", 0, "the film position moves, with the first chain of specular vertices", make_lens},
    MutatorEntry{"caustic", 0, "light turns before the last chain of specular vertices", make_caustic},
    MutatorEntry{"multichain", 0, "the film position moves, with several chains of specular vertices",
                 make_multichain},
    MutatorEntry{"manifold", 0, "a vertex moves, and specular ones walk to where they have to be",
                 make_manifold},
    MutatorEntry{"half_vector", 0, "half vectors of the whole path, by a walk", make_half_vector},
};

}  // namespace

std::span<const MutatorEntry> mutators() {
  return kMutators;
}

}  // namespace candela::mcmc
