#include "worker/scene/bsdfs/difftrans.h"

#include <cmath>

#include "worker/core/warp.h"
#include "worker/scene/bsdfs/kinds.h"

namespace candela::scene {

Spectrum eval_pdf(const DiffuseTransmitterClosure& p, Vec3 wo, Vec3 wi, TransportMode /*mode*/, float& pdf) {
  pdf = 0;
  if (!(wo.z * wi.z < 0)) return {};
  pdf = std::abs(wi.z) * math::kInvPi;
  return p.transmittance * pdf;
}

bool sample(const DiffuseTransmitterClosure& p, Vec3 wo, float /*u_lobe*/, Vec2 u, TransportMode /*mode*/,
            BsdfSample& out) {
  if (wo.z == 0) return false;
  out.wi = warp::cosine_hemisphere(u);
  out.pdf_solid_angle = out.wi.z * math::kInvPi;
  if (wo.z > 0) out.wi.z = -out.wi.z;
  out.weight = p.transmittance;
  out.transmitted = true;
  return true;
}

Result<void> DiffuseTransmitterSurface::build(const description::Object& object,
                                              const BuildContext& context) {
  CANDELA_ASSIGN(transmittance, read_reflectance(object, context.textures, "transmittance", 0.5f));
  return {};
}

void DiffuseTransmitterSurface::prepare(const SurfacePoint& at, bool /*below*/, Closure& out) const {
  const DiffuseTransmitterClosure p = {transmittance.eval(at)};
  out.set(p);
  out.black = p.transmittance.is_black();
}

BsdfFacts DiffuseTransmitterSurface::facts() const {
  return {.smooth = true, .transmissive = true, .max_albedo = transmittance.maximum().max_component()};
}

}  // namespace candela::scene
