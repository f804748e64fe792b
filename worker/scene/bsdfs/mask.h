// A bsdf that lets light pass straight on where its opacity is below 1: a blend of nothing and the bsdf.
#pragma once

#include <memory>
#include <string_view>

#include "worker/scene/bsdfs/blend.h"
#include "worker/scene/bsdfs/surface.h"
#include "worker/scene/hit.h"

namespace candela::scene {

struct MaskSurface {
  using ClosureType = BlendClosure;
  static constexpr std::string_view kPlugins[] = {"mask"};

  std::unique_ptr<Bsdf> nested;
  FloatTexture opacity;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const;
  BsdfFacts facts() const;
  std::uint32_t arena_parts() const;
  template <class Visitor>
  void for_each_part(const Visitor& visit) const {
    visit(*nested);
  }
};

}  // namespace candela::scene
