// A smooth boundary between two dielectrics: delta reflection and refraction, chosen by Fresnel's reflectance
// times the lobes' colors. Refraction scales radiance by (n_o / n_i)^2, importance not [Veach 1997, ch. 5].
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

struct DielectricClosure {
  Spectrum reflectance, transmittance;  // specular_reflectance, specular_transmittance
  float eta;                            // int_ior / ext_ior; the normal points to the outside

  ClosureTraits traits() const { return {.purely_delta = true, .has_delta = true, .reads_lobe = true}; }
};
bool sample(const DielectricClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);

struct DielectricSurface {
  using ClosureType = DielectricClosure;
  static constexpr std::string_view kPlugins[] = {"dielectric"};

  ColorTexture reflectance, transmittance;
  float eta = 1;  // int_ior / ext_ior

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
