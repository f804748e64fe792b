// A closure chooses among its lobes by u_lobe: each lobe has a range of u_lobe as long as its probability,
// and a part of a composite has a part of the composite's range. So the ranges of a whole tree of closures
// follow from those of its leaves, and sample() itself says what each delta lobe does.
#include "worker/scene/bsdfs/delta_lobes.h"

#include <algorithm>
#include <cmath>

#include "worker/scene/bsdfs/kinds.h"
#include "worker/scene/bsdfs/layer.h"
#include "worker/scene/bsdfs/rough_transmittance.h"

namespace candela::scene {
namespace {

constexpr float kLast = 0x1.fffffep-1f;

// A new kind that has other closures as parts, or more than two delta lobes, needs a case in delta_choices().
static_assert(kBsdfKinds == 26, "say here how the new kind divides u_lobe among its lobes");

// The lobes of a leaf, which has one at each end of its range at most.
void choices_of_leaf(const Closure& leaf, Vec3 wo, TransportMode mode, LobeRange range, LobeChoices& out) {
  for (const bool last : {false, true}) {
    BsdfSample sample;
    if (!leaf.sample(wo, last ? kLast : 0.0f, {0.5f, 0.5f}, mode, sample) || !sample.delta) continue;
    const double half = 0.5 * static_cast<double>(sample.prob);
    const LobeRange middle = range.part(last ? 1 - half : half, 1);
    if (out.empty() || std::abs(out.back() - middle.begin) > 1e-9) out.push_back(middle.begin);
  }
}

void choices_of_blend(const BlendClosure& p, Vec3 wo, TransportMode mode, LobeRange range, LobeChoices& out) {
  const auto q = static_cast<double>(p.weight);
  if (q > 0) delta_choices(*p.second, wo, mode, range.part(0, q), out);
  if (q < 1) delta_choices(*p.first, wo, mode, range.part(q, 1), out);
}

// prob: of the layer's own reflection, a delta lobe if the layer is smooth.
void choices_of_coat(const CoatClosure& p, double prob, bool smooth, Vec3 wo, TransportMode mode,
                     LobeRange range, LobeChoices& out) {
  if (smooth && prob > 0) out.push_back(range.part(0.5 * prob, 1).begin);
  const Refracted o = refract_in(p.eta, wo);
  if (prob < 1 && enters(o)) delta_choices(*p.below, o.inside, mode, range.part(prob, 1), out);
}

}  // namespace

void delta_choices(const Closure& closure, Vec3 wo, TransportMode mode, LobeRange range, LobeChoices& out) {
  if (closure.black || !closure.has_delta_lobes() || closure.is<PathEditedClosure>()) return;
  const Vec3 above = closure.flipped ? Vec3{wo.x, wo.y, -wo.z} : wo;
  if (closure.is<BlendClosure>()) {
    choices_of_blend(closure.get<BlendClosure>(), above, mode, range, out);
  } else if (closure.is<CoatingClosure>()) {
    const auto& p = closure.get<CoatingClosure>();
    const float prob = prob_reflection(p.share, refract_in(p.eta, above).reflectance);
    choices_of_coat(p, static_cast<double>(prob), true, above, mode, range, out);
  } else if (closure.is<RoughCoatingClosure>()) {
    const auto& p = closure.get<RoughCoatingClosure>();
    const float prob = prob_reflection(p.share, 1 - p.coat->transmittance(std::abs(above.z)));
    choices_of_coat(p, static_cast<double>(prob), false, above, mode, range, out);
  } else if (closure.is<StrictNormalsClosure>()) {
    delta_choices(*closure.get<StrictNormalsClosure>().nested, above, mode, range, out);
  } else if (closure.is<PerturbedClosure>()) {
    delta_choices(closure.get<PerturbedClosure>(), above, mode, range, out);
  } else if (closure.is<EditedClosure>()) {
    delta_choices(closure.get<EditedClosure>(), above, mode, range, out);
  } else {
    choices_of_leaf(closure, wo, mode, range, out);
  }
}

std::vector<DeltaLobe> delta_lobes(const Closure& closure, Vec3 wo, TransportMode mode) {
  LobeChoices choices;
  delta_choices(closure, wo, mode, {}, choices);
  std::vector<DeltaLobe> lobes;
  for (const double u : choices) {
    BsdfSample sample;
    if (!closure.sample(wo, std::min(static_cast<float>(u), kLast), {0.5f, 0.5f}, mode, sample)) continue;
    if (!sample.delta) continue;  // less likely than the last bit of u_lobe
    lobes.push_back({sample.wi, sample.weight * sample.prob, sample.prob, sample.prob_reverse, sample.eta,
                     sample.transmitted, sample.passthrough});
  }
  return lobes;
}

}  // namespace candela::scene
