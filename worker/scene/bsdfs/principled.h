// Disney's principled material as Mitsuba 3 has it, after [Burley 2012] and [Burley 2015]: a diffuse part
// with retro-reflection, flattened towards a subsurface look, and sheen; a GGX lobe whose Fresnel term goes
// from dielectric over tinted to metallic; refraction through that same GGX surface; and a clearcoat lobe.
// From below there are the GGX lobe's reflection and refraction alone, and nothing without transmission.
//
// An artists' model: it is neither bounded by 1 in energy (the lobes are added) nor, for a clearcoat, a
// microfacet model (its 1 / (4 cos cos) is missing). What Mitsuba computes is kept.
//
// Sampling: the normal h of the GGX surface visible from wo, then reflection or refraction by Fresnel's
// reflectance there; or a normal of the clearcoat; or a cosine. Directions are evaluated mirrored to wo.z >
// 0.
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

// Mitsuba's parameters, combined.
struct PrincipledClosure {
  Spectrum base;
  float alpha_u, alpha_v, eta;
  float diffuse;            // weight of the diffuse part, (1 - metallic) (1 - spec_trans)
  float transmission;       // weight of refraction, (1 - metallic) spec_trans
  float f0_base, f0_white;  // at normal incidence Schlick's terms reflect base * f0_base + f0_white
  float f90, f_dielectric;  // at grazing incidence they reflect f90; weight of the dielectric Fresnel term
  float sheen_base, sheen_white;  // sheen is base * sheen_base + sheen_white
  float roughness, flatness;
  float coat, coat_alpha, coat_norm;
  float rate_diffuse, rate_coat, rate_specular;  // of sampling these, to be divided by their sum

  ClosureTraits traits() const { return {.reads_lobe = true, .through = transmission > 0}; }
};
Spectrum eval_pdf(const PrincipledClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
Spectrum eval_diffuse(const PrincipledClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below);
bool sample(const PrincipledClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);

struct PrincipledSurface {
  using ClosureType = PrincipledClosure;
  static constexpr std::string_view kPlugins[] = {"principled"};

  ColorTexture base_color;
  FloatTexture roughness, anisotropic, metallic, spec_trans, spec_tint, sheen, sheen_tint, flatness,
      clearcoat, clearcoat_gloss;
  float eta = 1.5f;  // below over above
  float rate_diffuse = 1, rate_coat = 1, rate_specular = 1;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
