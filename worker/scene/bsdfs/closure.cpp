// Closure's dispatch over the kinds of bsdf. The kinds are inline, so one switch is all that a call costs.
#include <algorithm>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/blend.h"
#include "worker/scene/bsdfs/conductor.h"
#include "worker/scene/bsdfs/dielectric.h"
#include "worker/scene/bsdfs/diffuse.h"
#include "worker/scene/bsdfs/null.h"
#include "worker/scene/bsdfs/perturbed.h"
#include "worker/scene/bsdfs/phong.h"
#include "worker/scene/bsdfs/plastic.h"
#include "worker/scene/bsdfs/principled.h"
#include "worker/scene/bsdfs/roughconductor.h"
#include "worker/scene/bsdfs/roughdielectric.h"
#include "worker/scene/bsdfs/roughplastic.h"
#include "worker/scene/bsdfs/thindielectric.h"
#include "worker/scene/bsdfs/ward.h"

namespace candela::scene {

Spectrum Closure::eval_pdf(Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) const {
  pdf = 0;
  if (black) return {};
  if (flipped) {
    wo.z = -wo.z;
    wi.z = -wi.z;
  }
  switch (kind) {
    case BsdfKind::diffuse:
      return diffuse::eval_pdf(diffuse, wo, wi, pdf);
    case BsdfKind::roughconductor:
      return roughconductor::eval_pdf(rough_conductor, wo, wi, pdf);
    case BsdfKind::phong:
      return phong::eval_pdf(phong, wo, wi, pdf);
    case BsdfKind::ward:
      return ward::eval_pdf(ward, wo, wi, pdf);
    case BsdfKind::principled:
      return principled::eval_pdf(principled, wo, wi, mode, pdf);
    case BsdfKind::roughdielectric:
      return roughdielectric::eval_pdf(rough_dielectric, wo, wi, mode, pdf);
    case BsdfKind::plastic:
      return plastic::eval_pdf(plastic, wo, wi, pdf);
    case BsdfKind::roughplastic:
      return roughplastic::eval_pdf(rough_plastic, wo, wi, pdf);
    case BsdfKind::blend:
      return blend::eval_pdf(blend, wo, wi, mode, pdf);
    case BsdfKind::perturbed:
      return perturbed::eval_pdf(perturbed, wo, wi, mode, pdf);
    case BsdfKind::dielectric:
    case BsdfKind::conductor:
    case BsdfKind::null:
    case BsdfKind::thindielectric:
      break;
  }
  return {};
}

Spectrum Closure::straight(Vec3 wo) const {
  if (black) return {};
  if (flipped) wo.z = -wo.z;
  switch (kind) {
    case BsdfKind::null:
      return Spectrum(1);
    case BsdfKind::thindielectric:
      return thindielectric::straight(dielectric, wo);
    case BsdfKind::blend:
      return blend::straight(blend, wo);
    case BsdfKind::perturbed:
      return perturbed::straight(perturbed, wo);
    case BsdfKind::diffuse:
    case BsdfKind::dielectric:
    case BsdfKind::conductor:
    case BsdfKind::roughconductor:
    case BsdfKind::phong:
    case BsdfKind::ward:
    case BsdfKind::principled:
    case BsdfKind::roughdielectric:
    case BsdfKind::plastic:
    case BsdfKind::roughplastic:
      break;
  }
  return {};
}

bool Closure::parts_purely_delta() const {
  if (kind == BsdfKind::perturbed) return perturbed.nested->purely_delta();
  const auto no_smooth_lobe = [](const Closure& part) { return part.black || part.purely_delta(); };
  return no_smooth_lobe(*blend.first) && no_smooth_lobe(*blend.second);
}

bool Closure::parts_scatter_through() const {
  if (black) return false;
  if (kind == BsdfKind::principled) return principled.transmission > 0;
  if (kind == BsdfKind::roughdielectric) return !rough_dielectric.transmittance.is_black();
  if (kind == BsdfKind::perturbed) return perturbed.nested->scatters_through();
  return blend.first->scatters_through() || blend.second->scatters_through();
}

Spectrum Closure::eval(Vec3 wo, Vec3 wi, TransportMode mode) const {
  float pdf = 0;
  return eval_pdf(wo, wi, mode, pdf);
}

float Closure::pdf_solid_angle(Vec3 wo, Vec3 wi, TransportMode mode) const {
  float pdf = 0;
  static_cast<void>(eval_pdf(wo, wi, mode, pdf));
  return pdf;
}

bool Closure::sample(Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) const {
  out = {};
  if (black) return false;
  if (flipped) wo.z = -wo.z;
  bool valid = false;
  switch (kind) {
    case BsdfKind::diffuse:
      valid = diffuse::sample(diffuse, wo, u, out);
      break;
    case BsdfKind::dielectric:
      valid = dielectric::sample(dielectric, wo, u_lobe, mode, out);
      break;
    case BsdfKind::conductor:
      valid = conductor::sample(conductor, wo, out);
      break;
    case BsdfKind::roughconductor:
      valid = roughconductor::sample(rough_conductor, wo, u, out);
      break;
    case BsdfKind::roughdielectric:
      valid = roughdielectric::sample(rough_dielectric, wo, u_lobe, u, mode, out);
      break;
    case BsdfKind::thindielectric:
      valid = thindielectric::sample(dielectric, wo, u_lobe, out);
      break;
    case BsdfKind::plastic:
      valid = plastic::sample(plastic, wo, u_lobe, u, out);
      break;
    case BsdfKind::roughplastic:
      valid = roughplastic::sample(rough_plastic, wo, u_lobe, u, out);
      break;
    case BsdfKind::null:
      valid = null::sample(wo, out);
      break;
    case BsdfKind::phong:
      valid = phong::sample(phong, wo, u_lobe, u, out);
      break;
    case BsdfKind::ward:
      valid = ward::sample(ward, wo, u_lobe, u, out);
      break;
    case BsdfKind::principled:
      valid = principled::sample(principled, wo, u_lobe, u, mode, out);
      break;
    case BsdfKind::blend:
      valid = blend::sample(blend, wo, u_lobe, u, mode, out);
      break;
    case BsdfKind::perturbed:
      valid = perturbed::sample(perturbed, wo, u_lobe, u, mode, out);
      break;
  }
  if (valid && flipped) out.wi.z = -out.wi.z;
  return valid;
}

}  // namespace candela::scene
