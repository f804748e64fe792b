// A smooth dielectric layer that may absorb, on another bsdf: Mitsuba 0.6's `coating`. Light is reflected off
// the layer (a delta lobe), or refracted into it, scattered by the bsdf below, and refracted out. What the
// layer reflects back down inside is lost, as in 0.6. With F the layer's reflectance, w' the refracted
// directions and c' their cosines:
//   f(wo, wi) = (1 - F(wo)) (1 - F(wi)) / eta^2 exp(-sigma_a thickness (1 / c'_o + 1 / c'_i)) f_below(wo',
//   wi')
// [Weidlich and Wilkie 2007]
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/coat_surface.h"
#include "worker/scene/hit.h"

namespace candela::scene {

struct CoatingClosure : CoatClosure {
  ClosureTraits traits() const;
};
Spectrum eval_pdf(const CoatingClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
Spectrum eval_diffuse(const CoatingClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below);
bool sample(const CoatingClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);

struct CoatingSurface : CoatSurface {
  using ClosureType = CoatingClosure;
  static constexpr std::string_view kPlugins[] = {"coating"};

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
