// A rough dielectric layer that may absorb, on another bsdf: Mitsuba 0.6's `roughcoating`. The layer reflects
// as a microfacet surface does. Light that gets in is refracted as by a smooth layer, and dimmed by the
// tabulated transmittance T of the rough one. What the layer reflects back down inside is lost, as in 0.6.
// With w' the refracted directions and c' their cosines:
//   f(wo, wi) = F D G / (4 cos_o cos_i) + T(wo) T(wi) / eta^2 exp(-sigma_a thickness (1 / c'_o + 1 / c'_i))
//               f_below(wo', wi')
// [Weidlich and Wilkie 2007], with the layer's reflection after [Walter et al. 2007, Eq. 20].
#pragma once

#include <memory>
#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/coat_surface.h"
#include "worker/scene/bsdfs/rough_transmittance.h"
#include "worker/scene/hit.h"

namespace candela::scene {

struct RoughCoatingClosure : CoatClosure {
  const RoughTransmittance* coat;
  float alpha;
  bool ggx;
  bool sample_visible;

  ClosureTraits traits() const;
};
Spectrum eval_pdf(const RoughCoatingClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
Spectrum eval_diffuse(const RoughCoatingClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below);
bool sample(const RoughCoatingClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);

struct RoughCoatingSurface : CoatSurface {
  using ClosureType = RoughCoatingClosure;
  static constexpr std::string_view kPlugins[] = {"roughcoating"};

  std::shared_ptr<const RoughTransmittance> coat;
  float alpha = 0.1f;
  bool ggx = false;
  bool sample_visible = true;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
