// Oren and Nayar's model of a surface of Lambertian facets, as Mitsuba 0.6 has it; one-sided. Density:
// cosine.
//
// f |cos theta_i| = (rho L1 + rho^2 L2) / pi cos theta_i with
//   L1 = C1 + cos(phi) C2 tan(beta) + (1 - |cos(phi)|) C3 tan((alpha + beta) / 2)
//   L2 = 0.17 s^2 / (s^2 + 0.13) (1 - cos(phi) (2 beta / pi)^2)
// where alpha is the larger and beta the smaller angle to the normal, phi the angle between the azimuths, s
// the standard deviation of the slopes' angle, and C1 to C3 as in the paper [Oren and Nayar 1994, Eq. 30].
// use_fast_approx leaves C3 and L2 out.
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

struct RoughDiffuseClosure {
  Spectrum reflectance;
  float sigma2;  // s^2
  bool fast;     // use_fast_approx

  ClosureTraits traits() const { return {.even = true}; }
};
Spectrum eval_pdf(const RoughDiffuseClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
bool sample(const RoughDiffuseClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);

struct RoughDiffuseSurface {
  using ClosureType = RoughDiffuseClosure;
  static constexpr std::string_view kPlugins[] = {"roughdiffuse"};

  ColorTexture reflectance;
  FloatTexture alpha;
  bool fast = false;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
