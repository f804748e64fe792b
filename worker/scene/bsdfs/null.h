// No surface at all: light passes straight on. Bounds media.
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

struct NullClosure {
  ClosureTraits traits() const { return {.purely_delta = true, .has_delta = true}; }
};
bool sample(const NullClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);
Spectrum passthrough(const NullClosure& p, Vec3 wo);

struct NullSurface {
  using ClosureType = NullClosure;
  static constexpr std::string_view kPlugins[] = {"null"};

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
