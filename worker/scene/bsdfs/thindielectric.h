// A pane so thin that light leaves it where it came in: delta reflection, and transmission straight on. With
// R of one boundary, all orders of reflection inside add up to R' = R + T^2 R + T^2 R^3 + ... = 2 R / (1 + R)
// and T' = (1 - R) / (1 + R).
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/dielectric.h"
#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

struct ThinDielectricClosure {
  Spectrum reflectance, transmittance;  // specular_reflectance, specular_transmittance
  float eta;                            // int_ior / ext_ior

  ClosureTraits traits() const { return {.purely_delta = true, .has_delta = true, .reads_lobe = true}; }
};
bool sample(const ThinDielectricClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
            BsdfSample& out);
Spectrum passthrough(const ThinDielectricClosure& p, Vec3 wo);

struct ThinDielectricSurface {
  using ClosureType = ThinDielectricClosure;
  static constexpr std::string_view kPlugins[] = {"thindielectric"};

  DielectricSurface boundary;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
