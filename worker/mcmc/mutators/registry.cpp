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

// [half-vector note, section 9]: 2 % of the film's shorter side, in pixels.
double image_step(const MutatorContext& context, const StepSize& size) {
  return 0.02 * std::min(context.film_width, context.film_height) * size.image;
}

std::unique_ptr<PathMutator> make_bidirectional(const MutatorContext& context, const StepSize& /*size*/) {
  return std::make_unique<BidirectionalMutator>(context);
}
template <bool kMultichain>
std::unique_ptr<PathMutator> make_lens(const MutatorContext& context, const StepSize& size) {
  return std::make_unique<LensMutator>(context, LensRules{kMultichain, film_step(context, size.image)});
}
std::unique_ptr<PathMutator> make_caustic(const MutatorContext& context, const StepSize& size) {
  return std::make_unique<CausticMutator>(context, film_step(context, size.image));
}
std::unique_ptr<PathMutator> make_manifold(const MutatorContext& context, const StepSize& size) {
  return std::make_unique<ManifoldMutator>(context, image_step(context, size));
}
std::unique_ptr<PathMutator> make_half_vector(const MutatorContext& context, const StepSize& size) {
  HalfVectorRules rules;
  rules.step.gamma *= size.roughness;
  rules.step.image_step *= size.image;
  return std::make_unique<HalfVectorMutator>(context.scene, rules, context.rays);
}

// For segments between diffuse vertices, as wide as the film allows.
template <bool kOneStep>
std::unique_ptr<PathMutator> make_segments(const MutatorContext& context, const StepSize& size) {
  HalfVectorRules rules;
  rules.one_step = kOneStep;
  rules.segments = true;
  rules.step.gamma *= size.roughness;
  rules.step.image_step = image_step(context, size);
  return std::make_unique<HalfVectorMutator>(context.scene, rules, context.rays);
}

constexpr MutatorEntry kBidirectional{
    "bidirectional", 1, "vertices are taken out of the path, and others put there by walks from both sides",
    make_bidirectional};
constexpr MutatorEntry kLens{"lens", 0, "the film position moves, with the first chain of specular vertices",
                             make_lens<false>, true};
constexpr MutatorEntry kCaustic{"caustic", 0, "light turns before the last chain of specular vertices",
                                make_caustic, true};
constexpr MutatorEntry kMultichain{"multichain", 0,
                                   "the film position moves, with several chains of specular vertices",
                                   make_lens<true>, true};
constexpr MutatorEntry kManifold{
    "manifold", 0, "a vertex moves, and specular ones walk to where they have to be", make_manifold, true};
constexpr MutatorEntry kHalfVector{"half_vector",    0,    "half vectors of the whole path, by a walk",
                                   make_half_vector, true, true};
constexpr std::array kMutators{kBidirectional, kLens, kCaustic, kMultichain, kManifold, kHalfVector};

constexpr MutatorEntry kSegmentWalk{
    "half_vector",        0,    "half vectors between two diffuse vertices or ends, by a walk",
    make_segments<false>, true, true};
constexpr MutatorEntry kSegmentStep{
    "one_step",          0,    "half vectors between two diffuse vertices or ends, by one step",
    make_segments<true>, true, true};

constexpr MutatorEntry with_share(MutatorEntry entry, double share) {
  entry.share = share;
  return entry;
}
// [Veach 1997, Sec. 11.4]. Perturbations are cheap, and move light further than most bidirectional mutations,
// few of which are accepted. A path that suits lens does not suit multichain.
constexpr std::array kVeach{with_share(kBidirectional, 0.15), with_share(kLens, 0.425),
                            with_share(kCaustic, 0.425), with_share(kMultichain, 0.425)};
// Manifold exploration [Jakob 2012].
constexpr std::array kManifolds{with_share(kBidirectional, 0.5), with_share(kManifold, 0.5)};
// Half vectors, by one step and by a walk [half-vector note, sections 12 and 13].
constexpr std::array kHalfVectors{with_share(kBidirectional, 0.25), with_share(kLens, 0.125),
                                  with_share(kMultichain, 0.125), with_share(kSegmentWalk, 0.25),
                                  with_share(kSegmentStep, 0.25)};
constexpr std::array kPresets{MutatorPreset{"mlt", kVeach}, MutatorPreset{"memlt", kManifolds},
                              MutatorPreset{"hslt", kHalfVectors}};

}  // namespace

std::span<const MutatorEntry> mutators() {
  return kMutators;
}

std::span<const MutatorPreset> mutator_presets() {
  return kPresets;
}

}  // namespace candela::mcmc
