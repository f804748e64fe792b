// Closure's dispatch over the kinds of bsdf. The kinds are inline, so one switch is all that a call costs.
#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/conductor.h"
#include "worker/scene/bsdfs/dielectric.h"
#include "worker/scene/bsdfs/diffuse.h"
#include "worker/scene/bsdfs/roughconductor.h"

namespace candela::scene {

Spectrum Closure::eval_pdf(Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) const {
  static_cast<void>(mode);  // only refraction asks for it, and the refraction there is has delta lobes
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
    case BsdfKind::dielectric:
    case BsdfKind::conductor:
      break;
  }
  return {};
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
  }
  if (valid && flipped) out.wi.z = -out.wi.z;
  return valid;
}

}  // namespace candela::scene
