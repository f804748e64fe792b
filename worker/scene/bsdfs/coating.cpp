#include "worker/scene/bsdfs/coating.h"

#include <algorithm>
#include <cmath>

#include "worker/scene/bsdfs/bsdf_build.h"
#include "worker/scene/bsdfs/layer.h"

namespace candela::scene {
namespace {

Spectrum transmitted(const CoatingClosure& p, const Refracted& o, const Refracted& i) {
  return absorbed((1 - o.reflectance) * (1 - i.reflectance), p.absorption, o, i);
}

}  // namespace

ClosureTraits CoatingClosure::traits() const {
  return {.purely_delta = below->black || below->purely_delta(), .has_delta = true, .reads_lobe = true};
}

Spectrum eval_pdf(const CoatingClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
  pdf = 0;
  if (!(wo.z * wi.z > 0)) return {};
  const Refracted o = refract_in(p.eta, wo), i = refract_in(p.eta, wi);
  if (!enters(o) || !enters(i)) return {};
  float pdf_below = 0;
  const Spectrum value = p.below->eval_pdf(o.inside, i.inside, mode, pdf_below);
  // Solid angle inside per solid angle outside.
  const float compression = std::abs(wi.z / i.inside.z) / (p.eta * p.eta);
  pdf = (1 - prob_reflection(p.share, o.reflectance)) * pdf_below * compression;
  return value * transmitted(p, o, i) * compression;
}

bool sample(const CoatingClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) {
  if (wo.z == 0) return false;
  const Refracted o = refract_in(p.eta, wo);
  const float prob = prob_reflection(p.share, o.reflectance);
  if (u_lobe < prob) {
    out.wi = {-wo.x, -wo.y, wo.z};
    out.delta = true;
    out.prob = out.prob_reverse = prob;
    out.weight = p.specular * (o.reflectance / prob);
    return true;
  }
  if (!(prob < 1) || !enters(o)) return false;
  const float rest = std::min((u_lobe - prob) / (1 - prob), 0x1.fffffep-1f);
  if (!p.below->sample(o.inside, rest, u, mode, out)) return false;
  Vec3 wi;
  if (!refract_out(p.eta, out.wi, wi) || !(wo.z * wi.z > 0)) return false;
  if (!out.delta) {
    out.wi = wi;
    const Spectrum value = eval_pdf(p, wo, wi, mode, out.pdf_solid_angle);
    if (!(out.pdf_solid_angle > kMinDensity)) return false;
    out.weight = value * (1 / out.pdf_solid_angle);
    return true;
  }
  const Refracted i = refract_in(p.eta, wi);
  if (!enters(i)) return false;
  out.wi = wi;
  out.weight *= transmitted(p, o, i) * (1 / (1 - prob));
  out.prob *= 1 - prob;
  out.prob_reverse *= 1 - prob_reflection(p.share, i.reflectance);
  return true;
}

Result<void> CoatingSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_ASSIGN(const auto children, nested_bsdfs(object, 1, 1));
  CANDELA_ASSIGN(base, Bsdf::build_part(*children[0], context));
  const BsdfFacts below = base->facts();
  if (below.transmissive || below.straight) {
    return located("coating holds a bsdf that lets no light through; " + children[0]->plugin + " does",
                   *children[0], "");
  }
  CANDELA_ASSIGN(specular, read_reflectance(object, context.textures, "specular_reflectance", 1));
  CANDELA_ASSIGN(sigma_a, context.textures.color(object, "sigma_a", Spectrum()));
  CANDELA_ASSIGN(eta, read_relative_eta(object, 1.5046, 1.000277));  // bk7 in air
  thickness = static_cast<float>(object.get_number("thickness", 1));
  if (!(thickness >= 0) || !std::isfinite(thickness))
    return located("the thickness is finite and not negative", object, "thickness");
  return {};
}

void CoatingSurface::prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const {
  CoatingClosure p = {};
  Closure& below = arena.make();
  p.below = &below;
  p.eta = eta;
  p.specular = specular.eval(hit.uv);
  p.absorption = sigma_a.eval(hit.uv) * thickness;
  p.share = layer_share(p.specular, p.absorption);
  const Refracted o = refract_in(p.eta, wo);
  if (enters(o)) base->prepare(hit, o.inside, arena, below);
  out.set(p);
  // The layer has as many sides as what is below it.
  out.black = (wo.z < 0 && !base->facts().two_sided) || (p.specular.is_black() && below.black);
}

BsdfFacts CoatingSurface::facts() const {
  BsdfFacts facts = base->facts();
  const Spectrum mirror = specular.maximum();
  if (eta == 1 || mirror.is_black()) return facts;
  facts.delta = true;
  facts.min_roughness = 0;
  facts.max_albedo = std::max(facts.max_albedo, mirror.max_component());
  return facts;
}

std::uint32_t CoatingSurface::arena_parts() const {
  return 1 + base->arena_parts();
}

}  // namespace candela::scene
