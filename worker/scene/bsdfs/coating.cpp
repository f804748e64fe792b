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

Spectrum eval_diffuse(const CoatingClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below) {
  if (!(wo.z * wi.z > 0)) return {};
  const Refracted o = refract_in(p.eta, wo), i = refract_in(p.eta, wi);
  if (!enters(o) || !enters(i)) return {};
  const float compression = std::abs(wi.z / i.inside.z) / (p.eta * p.eta);
  return p.below->eval_diffuse(o.inside, i.inside, mode, glossy_below) * transmitted(p, o, i) * compression;
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
  return build_coat("coating", object, context);
}

void CoatingSurface::prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const {
  CoatingClosure p = {};
  prepare_coat(hit, wo, arena, p);
  out.set(p);
  out.black = is_black(p, wo);
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

}  // namespace candela::scene
