// Lambertian reflection, one-sided. Density: cosine.
#pragma once

#include <string_view>

#include "worker/core/warp.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

struct DiffuseClosure {
  Spectrum reflectance;

  ClosureTraits traits() const { return {.even = true}; }
};

inline Spectrum eval_pdf(const DiffuseClosure& p, Vec3 wo, Vec3 wi, TransportMode /*mode*/, float& pdf) {
  if (wo.z <= 0 || wi.z <= 0) {
    pdf = 0;
    return {};
  }
  pdf = wi.z * math::kInvPi;
  return p.reflectance * pdf;
}

inline bool sample(const DiffuseClosure& p, Vec3 wo, float /*u_lobe*/, Vec2 u, TransportMode /*mode*/,
                   BsdfSample& out) {
  if (wo.z <= 0) return false;
  out.wi = warp::cosine_hemisphere(u);
  out.pdf_solid_angle = out.wi.z * math::kInvPi;
  out.weight = p.reflectance;
  return true;
}

struct DiffuseSurface {
  using ClosureType = DiffuseClosure;
  static constexpr std::string_view kPlugins[] = {"diffuse"};

  ColorTexture reflectance;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
