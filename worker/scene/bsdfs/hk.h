// Light scattered once in a thin layer with a flat front and back, after Hanrahan and Krueger, as Mitsuba
// 0.6's `hk`; and what passes the layer unscattered. With the optical thickness tau of the layer, the phase
// function p and the absolute cosines c_o, c_i:
//   reflected    f = albedo p (1 - exp(-tau (1 / c_i + 1 / c_o))) / (c_i + c_o)
//   transmitted  f = albedo p (exp(-tau / c_i) - exp(-tau / c_o)) / (c_i - c_o)
//   straight on  exp(-tau / c_o)
// [Hanrahan and Krueger 1993, Sec. 4.2]. The density of scattered light is that of the phase function, so
// that a sample's weight stays below 1.
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"
#include "worker/scene/media/phase.h"

namespace candela::scene {

struct LayerClosure {
  Spectrum albedo, tau;
  Phase phase;

  ClosureTraits traits() const { return {.has_delta = true, .reads_lobe = true, .through = true}; }
};
Spectrum eval_pdf(const LayerClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
bool sample(const LayerClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);
Spectrum passthrough(const LayerClosure& p, Vec3 wo);

struct LayerSurface {
  using ClosureType = LayerClosure;
  static constexpr std::string_view kPlugins[] = {"hk"};

  bool by_albedo = false;      // the two colors are sigma_t and albedo, else sigma_s and sigma_a
  ColorTexture first, second;  // per unit of length, but for the albedo
  float thickness = 1;
  Phase phase;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
