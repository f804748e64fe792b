// Two bsdfs mixed by a weight. sample() chooses one of them, by the weight, and weighs what it gives by both.
// The choice is the same from both sides, also where a part is black on one of them: a walk that comes back
// through the surface must find the probabilities announced.
#pragma once

#include "worker/scene/bsdf.h"

namespace candela::scene::blend {

inline Spectrum eval_pdf(const BlendParameters& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
  float pdf_first = 0;
  float pdf_second = 0;
  const Spectrum first = p.first->eval_pdf(wo, wi, mode, pdf_first);
  const Spectrum second = p.second->eval_pdf(wo, wi, mode, pdf_second);
  pdf = (1 - p.weight) * pdf_first + p.weight * pdf_second;
  return first * (1 - p.weight) + second * p.weight;
}

inline bool sample(const BlendParameters& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
                   BsdfSample& out) {
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
  if (!(pdf > kLeastDensity)) return false;
  out.pdf_solid_angle = pdf;
  out.weight = value * (1 / pdf);
  return true;
}

inline Spectrum straight(const BlendParameters& p, Vec3 wo) {
  return p.first->straight(wo) * (1 - p.weight) + p.second->straight(wo) * p.weight;
}

}  // namespace candela::scene::blend
