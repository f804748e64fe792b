// A diffuse base under a smooth dielectric coat, one-sided: a delta reflection off the coat, and a diffuse
// part of what gets in, scatters at the base and gets out again, after any number of reflections inside:
//   f |cos theta_i| = (1 - F(wo)) (1 - F(wi)) / eta^2  rho / (1 - rho F_in)  |cos theta_i| / pi
// where F_in is the mean reflectance of the coat for diffuse light from inside; not nonlinear: the base is
// taken to be of such a color that rho is what is left, rho / (1 - F_in).
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/coated_base.h"
#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

struct PlasticClosure {
  Spectrum diffuse;   // of the base, seen through the coat: see plastic.h
  Spectrum specular;  // color of the coat's reflection
  float eta;
  float specular_share;  // steers sampling to the coat

  ClosureTraits traits() const { return {.has_delta = true, .reads_lobe = true, .even = true}; }
};
Spectrum eval_pdf(const PlasticClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
bool sample(const PlasticClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);

struct PlasticSurface {
  using ClosureType = PlasticClosure;
  static constexpr std::string_view kPlugins[] = {"plastic"};

  CoatedBase base;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
