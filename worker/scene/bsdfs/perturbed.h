// A bsdf in a turned shading frame, as bump and normal maps leave it. Directions that lie on different sides
// of the two frames' planes exchange nothing, so that no light leaks through the surface; as Mitsuba has it.
//
// Flipping. Seen from behind the turned normal n there would be nothing to see: where the viewer's direction
// and n disagree about the side, n is mirrored to (-n.x, -n.y, n.z) [Schuessler et al. 2017]. The viewer
// alone decides: he is at wo in radiance mode, at wi in importance mode, so that both modes speak of the same
// f. A walk from the light does not know the viewer yet and samples from both frames, evenly, where the light
// reaches both.
//
// Shadowing. Light that grazes the true surface is attenuated by a masking function whose roughness follows
// from n's slope, so that bumps do not end in hard edges [Estevez et al. 2019]. It depends on the light's
// direction alone; f is not reciprocal.
//
// Adjoint. The nested bsdf's cosine is that of the turned normal, so that in this frame
//   f(wo, wi) = g(wo', wi') |wi'.z / wi.z|
// with g the nested f. Importance mode gives f with its arguments exchanged; its albedo has no bound, as with
// all shading normals [Veach 1997, section 5.3].
#pragma once

#include <algorithm>
#include <cmath>

#include "worker/scene/bsdf.h"

namespace candela::scene::perturbed {

inline Vec3 mirrored(Vec3 v) {
  return {v.x, v.y, -v.z};
}

// The frame, or the one around the mirrored normal: with M the mirroring in z, s' = M s, t' = M t, n' = -M n.
inline Vec3 to_turned(const PerturbedParameters& p, Vec3 v, bool mirror) {
  if (!mirror) return p.frame.to_local(v);
  const Vec3 w = p.frame.to_local(mirrored(v));
  return {w.x, w.y, -w.z};
}
inline Vec3 from_turned(const PerturbedParameters& p, Vec3 v, bool mirror) {
  if (!mirror) return p.frame.to_world(v);
  return mirrored(p.frame.to_world({v.x, v.y, -v.z}));
}

inline bool mirrors(const PerturbedParameters& p, Vec3 viewer) {
  return p.flips && !(viewer.z * dot(viewer, p.frame.n) > 0);
}
// The direction lies on the same side of both planes.
inline bool agrees(const PerturbedParameters& p, Vec3 v, bool mirror) {
  return v.z * to_turned(p, v, mirror).z > 0;
}

inline float shadowing(const PerturbedParameters& p, Vec3 light) {
  if (p.shadow_alpha2 == 0) return 1;
  const float z = std::abs(light.z);
  const float across2 = light.x * light.x + light.y * light.y;
  return 2 * z / (z + std::sqrt(z * z + p.shadow_alpha2 * across2));
}

// What turns the nested bsdf's adjoint into this one's. Both directions agree. Kept finite along the surface.
inline float adjoint(Vec3 wo, Vec3 turned_wo, Vec3 wi, Vec3 turned_wi) {
  return std::abs(turned_wo.z * wi.z) /
         (std::max(std::abs(wo.z), 1e-6f) * std::max(std::abs(turned_wi.z), 1e-6f));
}

// The nested bsdf in one of the two frames.
inline Spectrum within(const PerturbedParameters& p, bool mirror, Vec3 wo, Vec3 wi, TransportMode mode,
                       float& pdf) {
  pdf = 0;
  const Vec3 turned_wo = to_turned(p, wo, mirror);
  const Vec3 turned_wi = to_turned(p, wi, mirror);
  if (!(turned_wo.z * wo.z > 0 && turned_wi.z * wi.z > 0)) return {};
  const Spectrum value = p.nested->eval_pdf(turned_wo, turned_wi, mode, pdf);
  return mode == TransportMode::radiance ? value : value * adjoint(wo, turned_wo, wi, turned_wi);
}

inline Spectrum eval_pdf(const PerturbedParameters& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
  if (mode == TransportMode::radiance) return within(p, mirrors(p, wo), wo, wi, mode, pdf) * shadowing(p, wi);
  const bool mirror = mirrors(p, wi);
  const Spectrum value = within(p, mirror, wo, wi, mode, pdf) * shadowing(p, wo);
  if (p.flips && agrees(p, wo, !mirror)) {
    float other = 0;
    static_cast<void>(within(p, !mirror, wo, wi, mode, other));
    pdf = agrees(p, wo, mirror) ? 0.5f * (pdf + other) : other;
  }
  return value;
}

inline bool sample(const PerturbedParameters& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
                   BsdfSample& out) {
  const bool to_eye = mode == TransportMode::radiance;
  const bool both = !to_eye && p.flips && agrees(p, wo, false) && agrees(p, wo, true);
  bool mirror = to_eye ? mirrors(p, wo) : p.flips && agrees(p, wo, true);
  if (both) {
    mirror = u_lobe < 0.5f;
    u_lobe = mirror ? 2 * u_lobe : 2 * u_lobe - 1;
  }
  if (!agrees(p, wo, mirror)) return false;
  if (!p.nested->sample(to_turned(p, wo, mirror), u_lobe, u, mode, out)) return false;
  if (out.straight) {
    out.wi = -wo;
    const bool tossed = p.flips && agrees(p, wo, false) && agrees(p, wo, true);  // by walks from the light
    if (to_eye) {
      if (tossed) out.prob_reverse *= 0.5f;
      return true;
    }
    if (mirror != mirrors(p, wo))
      return false;  // the viewer, who looks along the light, sees the other frame
    if (tossed) {
      out.weight *= 2;
      out.prob *= 0.5f;
    }
    return true;
  }
  out.wi = normalize(from_turned(p, out.wi, mirror));
  if (!agrees(p, out.wi, mirror)) return false;
  if (to_eye) {
    out.weight *= shadowing(p, out.wi);
    if (out.delta && p.flips && agrees(p, out.wi, false) && agrees(p, out.wi, true)) out.prob_reverse *= 0.5f;
    return true;
  }
  if (out.delta) {
    if (mirrors(p, out.wi) != mirror) return false;  // the viewer there sees the other frame
    out.weight *= shadowing(p, wo) * (both ? 2.0f : 1.0f) *
                  adjoint(wo, to_turned(p, wo, mirror), out.wi, to_turned(p, out.wi, mirror));
    if (both) out.prob *= 0.5f;
    return true;
  }
  const Spectrum value = eval_pdf(p, wo, out.wi, mode, out.pdf_solid_angle);
  if (!(out.pdf_solid_angle > kLeastDensity)) return false;
  out.weight = value * (1 / out.pdf_solid_angle);
  return true;
}

inline Spectrum straight(const PerturbedParameters& p, Vec3 wo) {
  const bool mirror = mirrors(p, wo);
  return agrees(p, wo, mirror) ? p.nested->straight(to_turned(p, wo, mirror)) : Spectrum();
}

}  // namespace candela::scene::perturbed
