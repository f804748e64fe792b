// Two bsdfs mixed by a weight. sample() chooses one of them, by the weight, and weighs what it gives by both.
// The choice is the same from both sides, also where a part is black on one of them: a walk that comes back
// through the surface must find the probabilities announced.
#pragma once

#include <memory>
#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"
#include "worker/scene/hit.h"

namespace candela::scene {

class Bsdf;

// (1 - weight) of `first`, weight of `second`. A mask is a blend of nothing and its bsdf by opacity.
struct BlendClosure {
  const Closure* first;
  const Closure* second;
  float weight;

  ClosureTraits traits() const;
};
Spectrum eval_pdf(const BlendClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
Spectrum eval_diffuse(const BlendClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below);
bool sample(const BlendClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);
Spectrum passthrough(const BlendClosure& p, Vec3 wo);

struct BlendSurface {
  using ClosureType = BlendClosure;
  static constexpr std::string_view kPlugins[] = {"blendbsdf"};

  std::unique_ptr<Bsdf> first, second;
  FloatTexture weight;  // of the second

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const;
  BsdfFacts facts() const;
  std::uint32_t arena_parts() const;
  template <class Visitor>
  void for_each_part(const Visitor& visit) const {
    visit(*first);
    visit(*second);
  }
};

}  // namespace candela::scene
