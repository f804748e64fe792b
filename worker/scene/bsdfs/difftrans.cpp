#include "worker/scene/bsdfs/difftrans.h"

#include <algorithm>
#include <cmath>

#include "worker/core/warp.h"
#include "worker/scene/bsdfs/kinds.h"

namespace candela::scene {
namespace {

constexpr float kRounding = 1e-5f;  // of reflectances that add up to 1

}  // namespace

Spectrum eval_pdf(const DiffuseTransmitterClosure& p, Vec3 wo, Vec3 wi, TransportMode /*mode*/, float& pdf) {
  pdf = 0;
  const float side = wo.z * wi.z;
  if (side == 0) return {};
  const float cosine = std::abs(wi.z) * math::kInvPi;
  pdf = cosine * (side < 0 ? p.prob_through : 1 - p.prob_through);
  return (side < 0 ? p.transmittance : p.reflectance) * cosine;
}

bool sample(const DiffuseTransmitterClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode /*mode*/,
            BsdfSample& out) {
  if (wo.z == 0) return false;
  const bool through = u_lobe < p.prob_through;
  const float prob = through ? p.prob_through : 1 - p.prob_through;
  out.wi = warp::cosine_hemisphere(u);
  out.pdf_solid_angle = out.wi.z * math::kInvPi * prob;
  if ((wo.z > 0) == through) out.wi.z = -out.wi.z;
  out.weight = (through ? p.transmittance : p.reflectance) * (1 / prob);
  out.transmitted = through;
  return true;
}

Result<void> DiffuseTransmitterSurface::build(const description::Object& object,
                                              const BuildContext& context) {
  CANDELA_ASSIGN(transmittance, read_reflectance(object, context.textures, "transmittance", 0.5f));
  CANDELA_ASSIGN(reflectance, read_reflectance(object, context.textures, "reflectance", 0));
  const float sum = (transmittance.maximum() + reflectance.maximum()).max_component();
  if (transmittance.is_constant() && reflectance.is_constant() && sum > 1 + kRounding)
    return located("reflectance and transmittance add up to " + shown(sum) + " in a channel, more than 1",
                   object, "reflectance");
  return {};
}

void DiffuseTransmitterSurface::prepare(const SurfacePoint& at, bool /*below*/, Closure& out) const {
  DiffuseTransmitterClosure p = {transmittance.eval(at), reflectance.eval(at), 1};
  p.transmittance = {std::min(p.transmittance.r, 1 - p.reflectance.r),
                     std::min(p.transmittance.g, 1 - p.reflectance.g),
                     std::min(p.transmittance.b, 1 - p.reflectance.b)};
  const float through = p.transmittance.max_component(), back = p.reflectance.max_component();
  if (back > 0) p.prob_through = through / (through + back);
  out.set(p);
  out.black = !(through > 0) && !(back > 0);
}

BsdfFacts DiffuseTransmitterSurface::facts() const {
  const Spectrum sum = transmittance.maximum() + reflectance.maximum();
  return {.smooth = true, .transmissive = true, .max_albedo = std::min(1.0f, sum.max_component())};
}

}  // namespace candela::scene
