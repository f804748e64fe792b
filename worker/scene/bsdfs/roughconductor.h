// A rough metal: the microfacet model of Walter et al. 2007 with Smith's separable masking and complex
// Fresnel reflectance; one-sided.
//
// f |cos theta_i| = F D(h) G1(wo) G1(wi) / (4 cos theta_o); density of wi: that of the facet normal h over 4
// dot(wo, h).
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/conductor.h"
#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

struct RoughConductorClosure {
  Spectrum reflectance, eta, k;
  float alpha_u, alpha_v;
  bool ggx;  // else Beckmann
  bool sample_visible;

  ClosureTraits traits() const { return {}; }
};
Spectrum eval_pdf(const RoughConductorClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
Spectrum eval_diffuse(const RoughConductorClosure& p, Vec3 wo, Vec3 wi, TransportMode mode,
                      float glossy_below);
bool sample(const RoughConductorClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
            BsdfSample& out);

struct RoughConductorSurface {
  using ClosureType = RoughConductorClosure;
  static constexpr std::string_view kPlugins[] = {"roughconductor"};

  ConductorSurface metal;
  FloatTexture alpha_u, alpha_v;
  bool ggx = false;
  bool sample_visible = true;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
