// The modified Phong model of Lafortune and Willems, as Mitsuba 0.6 has it: a diffuse part and a lobe
// cos^n around the mirror direction, normalized to reflect its color at normal incidence; one-sided.
//
// f |cos theta_i| = (diffuse / pi + specular (n + 2) / (2 pi) cos^n alpha) cos theta_i
// [Lafortune and Willems 1994]
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"
#include "worker/scene/bsdfs/two_colors.h"

namespace candela::scene {

struct PhongClosure {
  Spectrum diffuse, specular;
  float exponent;
  float prob_specular;  // of sampling the lobe

  ClosureTraits traits() const { return {.reads_lobe = true}; }
};
Spectrum eval_pdf(const PhongClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
Spectrum eval_diffuse(const PhongClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below);
bool sample(const PhongClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);

struct PhongSurface {
  using ClosureType = PhongClosure;
  static constexpr std::string_view kPlugins[] = {"phong"};

  TwoColors colors;
  FloatTexture exponent;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
