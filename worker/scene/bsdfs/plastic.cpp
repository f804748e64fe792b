#include "worker/scene/bsdfs/plastic.h"

#include <algorithm>

#include "worker/core/warp.h"
#include "worker/scene/bsdfs/fresnel.h"
#include "worker/scene/bsdfs/kinds.h"
#include "worker/scene/bsdfs/rough_transmittance.h"

namespace candela::scene {
namespace {

float coat(const PlasticClosure& p, Vec3 w) {
  float cos_t = 0;
  return fresnel_dielectric(std::min(1.0f, w.z), std::min(1.0f, w.x * w.x + w.y * w.y), p.eta, cos_t);
}

// The probability of the coat's reflection, by the mean reflectances of both parts, as in Mitsuba. False:
// nothing is left to choose.
bool prob_of_coat(const PlasticClosure& p, float fresnel, float& prob) {
  const float r = fresnel * p.specular_share;
  const float t = (1 - fresnel) * (1 - p.specular_share);
  if (!(r + t > 0)) return false;
  prob = r / (r + t);
  return true;
}

}  // namespace

Spectrum eval_pdf(const PlasticClosure& p, Vec3 wo, Vec3 wi, TransportMode /*mode*/, float& pdf) {
  pdf = 0;
  if (wo.z <= 0 || wi.z <= 0) return {};
  const float fresnel = coat(p, wo);
  float prob = 0;
  if (!prob_of_coat(p, fresnel, prob)) return {};
  const float cosine = wi.z * math::kInvPi;
  pdf = (1 - prob) * cosine;
  return p.diffuse * ((1 - fresnel) * (1 - coat(p, wi)) * cosine);
}

bool sample(const PlasticClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode /*mode*/, BsdfSample& out) {
  if (wo.z <= 0) return false;
  const float fresnel = coat(p, wo);
  float prob = 0;
  if (!prob_of_coat(p, fresnel, prob)) return false;
  if (u_lobe < prob) {
    out.wi = {-wo.x, -wo.y, wo.z};
    out.delta = true;
    out.prob = out.prob_reverse = prob;
    out.weight = p.specular * (fresnel / prob);
    return true;
  }
  if (!(prob < 1)) return false;
  out.wi = warp::cosine_hemisphere(u);
  out.pdf_solid_angle = (1 - prob) * (out.wi.z * math::kInvPi);
  out.weight = p.diffuse * ((1 - fresnel) * (1 - coat(p, out.wi)) / (1 - prob));
  return true;
}

Result<void> PlasticSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_TRY(base.build(object, context));
  base.internal_reflectance = fresnel_diffuse_reflectance(1 / static_cast<double>(base.eta));
  return {};
}

void PlasticSurface::prepare(const SurfacePoint& at, bool below, Closure& out) const {
  PlasticClosure p = {};
  p.eta = base.eta;
  const bool black = below || !base.prepare(at, p.diffuse, p.specular, p.specular_share);
  out.set(p);
  out.black = black;
}

BsdfFacts PlasticSurface::facts() const {
  const bool shines = base.eta != 1 && !base.specular.maximum().is_black();
  return {.delta = shines,
          .smooth = !base.diffuse.maximum().is_black(),
          .max_albedo = base.max_albedo(),
          .min_roughness = shines ? 0.0f : 1.0f};
}

}  // namespace candela::scene
