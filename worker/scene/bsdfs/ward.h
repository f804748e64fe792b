// Ward's anisotropic reflection as Mitsuba 0.6 has it, over a diffuse part; one-sided. With D Beckmann's
// density of the half vector h, the lobe is
//
// ward       D h.z^4 / (4 sqrt(cos theta_i cos theta_o))  [Ward 1992]
// ward-duer  D h.z^4 / (4 cos theta_i cos theta_o)        [Duer 2006]
// balanced   D / (4 dot(wo, h)^2)                         [Geisler and Duer 2010]
//
// The first loses light at grazing angles and the second makes some; the third keeps below 1. All are
// sampled by h with density D h.z.
#pragma once

#include <cstdint>
#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"
#include "worker/scene/bsdfs/two_colors.h"

namespace candela::scene {

enum class WardVariant : std::uint8_t { ward, ward_duer, balanced };

struct WardClosure {
  Spectrum diffuse, specular;
  float alpha_u, alpha_v;
  float prob_specular;
  WardVariant variant;

  ClosureTraits traits() const { return {.reads_lobe = true}; }
};
Spectrum eval_pdf(const WardClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
Spectrum eval_diffuse(const WardClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below);
bool sample(const WardClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);

struct WardSurface {
  using ClosureType = WardClosure;
  static constexpr std::string_view kPlugins[] = {"ward"};

  TwoColors colors;
  FloatTexture alpha_u, alpha_v;
  WardVariant variant = WardVariant::balanced;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
