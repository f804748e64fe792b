// One-sided bsdfs seen from both sides of a surface. It has no closure of its own: the closure of the side
// that is seen is prepared, mirrored in z if that is the back.
#pragma once

#include <memory>
#include <string_view>

#include "worker/scene/bsdfs/surface.h"
#include "worker/scene/hit.h"

namespace candela::scene {

class Bsdf;

struct TwoSidedSurface {
  using ClosureType = void;
  static constexpr std::string_view kPlugins[] = {"twosided"};

  std::unique_ptr<Bsdf> front;
  std::unique_ptr<Bsdf> back;  // null: the same as the front

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const;
  BsdfFacts facts() const;
  std::uint32_t arena_parts() const;
  template <class Visitor>
  void for_each_part(const Visitor& visit) const {
    visit(*front);
    if (back != nullptr) visit(*back);
  }
};

}  // namespace candela::scene
