// Closure's dispatch over the kinds of bsdf. The kinds are inline, so one switch is all that a call costs.
// Diffuse surfaces, the most frequent and the cheapest, come before the switch, in functions of their own:
// beside the others they would pay for those's registers and stack.
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
  if (kind == BsdfKind::diffuse) return diffuse::eval_pdf(diffuse, wo, wi, pdf);
  return eval_pdf_by_kind(wo, wi, mode, pdf);
}

Spectrum Closure::eval_pdf_by_kind(Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) const {
  switch (kind) {
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
    case BsdfKind::diffuse:
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
  const bool valid = kind == BsdfKind::diffuse ? diffuse::sample(diffuse, wo, u, out)
                                               : sample_by_kind(wo, u_lobe, u, mode, out);
  if (valid && flipped) out.wi.z = -out.wi.z;
  return valid;
}

bool Closure::sample_by_kind(Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) const {
  switch (kind) {
    case BsdfKind::diffuse:
      break;
    case BsdfKind::dielectric:
      return dielectric::sample(dielectric, wo, u_lobe, mode, out);
    case BsdfKind::conductor:
      return conductor::sample(conductor, wo, out);
    case BsdfKind::roughconductor:
      return roughconductor::sample(rough_conductor, wo, u, out);
    case BsdfKind::roughdielectric:
      return roughdielectric::sample(rough_dielectric, wo, u_lobe, u, mode, out);
    case BsdfKind::thindielectric:
      return thindielectric::sample(dielectric, wo, u_lobe, out);
    case BsdfKind::plastic:
      return plastic::sample(plastic, wo, u_lobe, u, out);
    case BsdfKind::roughplastic:
      return roughplastic::sample(rough_plastic, wo, u_lobe, u, out);
    case BsdfKind::null:
      return null::sample(wo, out);
    case BsdfKind::phong:
      return phong::sample(phong, wo, u_lobe, u, out);
    case BsdfKind::ward:
      return ward::sample(ward, wo, u_lobe, u, out);
    case BsdfKind::principled:
      return principled::sample(principled, wo, u_lobe, u, mode, out);
    case BsdfKind::blend:
      return blend::sample(blend, wo, u_lobe, u, mode, out);
    case BsdfKind::perturbed:
      return perturbed::sample(perturbed, wo, u_lobe, u, mode, out);
  }
  return false;
}

}  // namespace candela::scene
