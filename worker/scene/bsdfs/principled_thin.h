// Disney's principled material for thin sheets as Mitsuba 3 has it, after [Burley 2015, section 5.3]: a part
// that reflects and passes light through GGX lobes without bending it, and a diffuse part that reflects (with
// retro-reflection, flattened towards a subsurface look, and sheen) and passes light. Both sides are alike.
//
// An artists' model, as `principled` is. What Mitsuba computes is kept.
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

struct PrincipledThinClosure {
  Spectrum base, sheen;
  float alpha_u, alpha_v;      // of reflection
  float through_u, through_v;  // of transmission
  float roughness, flatness, eta;
  float specular;                 // weight of the lobes that do not bend light; the diffuse part has the rest
  float diffuse_through;          // the diffuse part's fraction that passes
  float tint, f0_base, f0_white;  // tinted reflection: base * f0_base + f0_white at normal incidence
  // Probabilities of sampling the lobes, with the rest to 1 for the fourth.
  float prob_reflect, prob_through, prob_diffuse;

  ClosureTraits traits() const {
    return {.reads_lobe = true, .through = specular > 0 || diffuse_through > 0};
  }
};
Spectrum eval_pdf(const PrincipledThinClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
Spectrum eval_diffuse(const PrincipledThinClosure& p, Vec3 wo, Vec3 wi, TransportMode mode,
                      float glossy_below);
bool sample(const PrincipledThinClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
            BsdfSample& out);

struct PrincipledThinSurface {
  using ClosureType = PrincipledThinClosure;
  static constexpr std::string_view kPlugins[] = {"principledthin"};

  ColorTexture base_color;
  FloatTexture roughness, anisotropic, spec_trans, spec_tint, sheen, sheen_tint, flatness, diff_trans, eta;
  float rate_diffuse = 1, rate_diffuse_through = 1, rate_specular = 1, rate_specular_through = 1;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
