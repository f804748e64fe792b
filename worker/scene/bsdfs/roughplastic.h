// A diffuse base under a rough dielectric coat, one-sided: the coat reflects as a microfacet surface does,
// and the diffuse part is plastic.h's with Fresnel's transmittance replaced by the rough coat's, tabulated.
//   f |cos theta_i| = F D G / (4 cos theta_o) + T(wo) T(wi) / eta^2  rho / (1 - rho R_in)  |cos theta_i| / pi
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/coat_tables.h"
#include "worker/scene/bsdfs/coated_base.h"
#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

struct RoughPlasticClosure {
  Spectrum diffuse, specular;
  float eta, alpha;
  float specular_share;
  bool ggx;
  bool sample_visible;
  CoatAt coat;

  ClosureTraits traits() const { return {.reads_lobe = true}; }
};
Spectrum eval_pdf(const RoughPlasticClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
Spectrum eval_diffuse(const RoughPlasticClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below);
bool sample(const RoughPlasticClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);

struct RoughPlasticSurface {
  using ClosureType = RoughPlasticClosure;
  static constexpr std::string_view kPlugins[] = {"roughplastic"};

  CoatedBase base;
  FloatTexture alpha;
  bool ggx = false;
  bool sample_visible = true;
  bool masked_light_stays = false;  // inside the coat: Mitsuba 0.6
  CoatTables coats;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
