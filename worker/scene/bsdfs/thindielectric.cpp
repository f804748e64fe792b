#include "worker/scene/bsdfs/thindielectric.h"

#include <algorithm>
#include <cmath>

#include "worker/scene/bsdfs/fresnel.h"
#include "worker/scene/bsdfs/kinds.h"

namespace candela::scene {
namespace {

// R of one boundary; wo from either side.
float boundary(const ThinDielectricClosure& p, Vec3 wo) {
  float cos_t = 0;
  return fresnel_dielectric(std::min(1.0f, std::abs(wo.z)), std::min(1.0f, wo.x * wo.x + wo.y * wo.y), p.eta,
                            cos_t);
}

}  // namespace

Spectrum passthrough(const ThinDielectricClosure& p, Vec3 wo) {
  const float r = boundary(p, wo);
  return p.transmittance * ((1 - r) / (1 + r));
}

bool sample(const ThinDielectricClosure& p, Vec3 wo, float u_lobe, Vec2 /*u*/, TransportMode /*mode*/,
            BsdfSample& out) {
  const float one = boundary(p, wo);
  const float reflected = 2 * one / (1 + one);
  const float passing = (1 - one) / (1 + one);
  const float r = reflected * p.reflectance.max_component();
  const float t = passing * p.transmittance.max_component();
  if (!(r + t > 0)) return false;
  const float prob_reflect = r / (r + t);
  out.delta = true;
  if (u_lobe < prob_reflect) {
    if (wo.z == 0) return false;
    out.wi = {-wo.x, -wo.y, wo.z};
    out.prob = out.prob_reverse = prob_reflect;
    out.weight = p.reflectance * (reflected / prob_reflect);
    return true;
  }
  out.wi = -wo;
  out.transmitted = true;
  out.passthrough = true;
  out.prob = out.prob_reverse = 1 - prob_reflect;
  out.weight = p.transmittance * (passing / (1 - prob_reflect));
  return out.prob > 0;
}

Result<void> ThinDielectricSurface::build(const description::Object& object, const BuildContext& context) {
  return boundary.build(object, context);
}

void ThinDielectricSurface::prepare(const SurfacePoint& at, bool /*below*/, Closure& out) const {
  const ThinDielectricClosure p = {boundary.reflectance.eval(at), boundary.transmittance.eval(at),
                                   boundary.eta};
  out.set(p);
  out.black = p.reflectance.is_black() && p.transmittance.is_black();
}

BsdfFacts ThinDielectricSurface::facts() const {
  BsdfFacts facts = boundary.facts();
  facts.passthrough = facts.transmissive;
  facts.transmissive = false;
  // An index of 1 reflects nothing.
  facts.delta = boundary.eta != 1 && !boundary.reflectance.maximum().is_black();
  if (!facts.delta) facts.min_roughness = 1;
  return facts;
}

}  // namespace candela::scene
