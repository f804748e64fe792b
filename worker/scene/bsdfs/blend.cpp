#include "worker/scene/bsdfs/blend.h"

#include <algorithm>

#include "worker/scene/bsdfs/bsdf_build.h"

namespace candela::scene {

ClosureTraits BlendClosure::traits() const {
  const auto no_smooth_lobe = [](const Closure& part) { return part.black || part.purely_delta(); };
  return {.purely_delta = no_smooth_lobe(*first) && no_smooth_lobe(*second),
          .has_delta = true,  // perhaps
          .reads_lobe = true,
          .through = first->scatters_through() || second->scatters_through(),
          .even = (first->black || first->even()) && (second->black || second->even())};
}

Spectrum eval_pdf(const BlendClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
  float pdf_first = 0;
  float pdf_second = 0;
  const Spectrum first = p.first->eval_pdf(wo, wi, mode, pdf_first);
  const Spectrum second = p.second->eval_pdf(wo, wi, mode, pdf_second);
  pdf = (1 - p.weight) * pdf_first + p.weight * pdf_second;
  return first * (1 - p.weight) + second * p.weight;
}

Spectrum eval_diffuse(const BlendClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below) {
  return p.first->eval_diffuse(wo, wi, mode, glossy_below) * (1 - p.weight) +
         p.second->eval_diffuse(wo, wi, mode, glossy_below) * p.weight;
}

bool sample(const BlendClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) {
  const float q = p.weight;
  const bool second = u_lobe < q;
  const float prob = second ? q : 1 - q;
  const float rest = second ? u_lobe / q : (u_lobe - q) / (1 - q);
  // The rest is below 1 but for rounding.
  if (!(second ? p.second : p.first)->sample(wo, std::min(rest, 0x1.fffffep-1f), u, mode, out)) return false;
  if (out.delta) {
    out.prob *= prob;
    out.prob_reverse *= prob;
    return true;
  }
  float pdf = 0;
  const Spectrum value = eval_pdf(p, wo, out.wi, mode, pdf);
  if (!(pdf > kMinDensity)) return false;
  out.pdf_solid_angle = pdf;
  out.weight = value * (1 / pdf);
  return true;
}

Spectrum passthrough(const BlendClosure& p, Vec3 wo) {
  return p.first->passthrough(wo) * (1 - p.weight) + p.second->passthrough(wo) * p.weight;
}

Result<void> BlendSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_ASSIGN(const auto children, nested_bsdfs(object, 2, 2));
  CANDELA_ASSIGN(first, Bsdf::build_part(*children[0], context));
  CANDELA_ASSIGN(second, Bsdf::build_part(*children[1], context));
  CANDELA_ASSIGN(weight, read_fraction(object, context.textures, "weight", 0.5f));
  return {};
}

void BlendSurface::prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const {
  Closure& a = arena.make();
  Closure& b = arena.make();
  first->prepare(hit, wo, arena, a);
  second->prepare(hit, wo, arena, b);
  const float share = std::clamp(weight.eval(hit), 0.0f, 1.0f);
  out.set(BlendClosure{&a, &b, share});
  out.black = (a.black || share == 1) && (b.black || share == 0);
}

BsdfFacts BlendSurface::facts() const {
  BsdfFacts facts = first->facts();
  BsdfFacts other = second->facts();
  // The lobes of a part that nowhere counts are none.
  if (weight.is_constant() && weight.constant == 0) other.forget_lobes();
  if (weight.is_constant() && weight.constant == 1) facts.forget_lobes();
  facts.join(other);
  return facts;
}

std::uint32_t BlendSurface::arena_parts() const {
  return 2 + first->arena_parts() + second->arena_parts();
}

}  // namespace candela::scene
