// A rough boundary between two dielectrics: the microfacet model of Walter et al. 2007 with Smith's separable
// masking. A facet normal h is chosen first, then reflection or refraction in it by Fresnel's reflectance
// times the lobes' colors.
//
// With cos_o = wo.h, cos_t = |wi.h| of refraction, eta the far side's index over wo's side's, and D G in h:
//   reflection  f |cos theta_i| = F D G / (4 cos theta_o)  [Walter 2007, Eq. 20]
//   refraction  f |cos theta_i| = (1 - F) D G cos_o cos_t eta^2 / (cos theta_o (cos_o - eta cos_t)^2)
//               for importance [Walter 2007, Eq. 21], 1/eta^2 of that for radiance [Veach 1997, ch. 5]
// and the density of wi is that of h times dh/dwi = 1 / (4 cos_o) or eta^2 cos_t / (cos_o - eta cos_t)^2.
// Both are reciprocal: f(wo, wi) / eta_o^2 = f(wi, wo) / eta_i^2.
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/dielectric.h"
#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

struct RoughDielectricClosure {
  Spectrum reflectance, transmittance;
  float eta;  // as in DielectricClosure
  float alpha_u, alpha_v;
  bool ggx;
  bool sample_visible;

  ClosureTraits traits() const { return {.reads_lobe = true, .through = !transmittance.is_black()}; }
};
Spectrum eval_pdf(const RoughDielectricClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
Spectrum eval_diffuse(const RoughDielectricClosure& p, Vec3 wo, Vec3 wi, TransportMode mode,
                      float glossy_below);
bool sample(const RoughDielectricClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
            BsdfSample& out);

// If the indices match within kMatchedIndex there is no boundary: light passes straight on.
struct RoughDielectricSurface {
  using ClosureType = RoughDielectricClosure;
  static constexpr std::string_view kPlugins[] = {"roughdielectric"};

  DielectricSurface boundary;
  FloatTexture alpha_u, alpha_v;
  bool ggx = false;
  bool sample_visible = true;
  // Below this difference from 1, facets deflect light by less than float directions resolve.
  static constexpr float kMatchedIndex = 1e-5f;
  bool matched() const;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
