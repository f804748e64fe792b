// A smooth metal: mirror reflection with complex Fresnel reflectance. One delta lobe, one-sided.
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

struct ConductorClosure {
  Spectrum reflectance, eta, k;  // relative to the outside medium

  ClosureTraits traits() const { return {.purely_delta = true, .has_delta = true}; }
};
bool sample(const ConductorClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);

struct ConductorSurface {
  using ClosureType = ConductorClosure;
  static constexpr std::string_view kPlugins[] = {"conductor"};

  ColorTexture reflectance, eta, k;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
