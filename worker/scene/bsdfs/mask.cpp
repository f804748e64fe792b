#include "worker/scene/bsdfs/mask.h"

#include <algorithm>

#include "worker/scene/bsdfs/bsdf_build.h"

namespace candela::scene {

Result<void> MaskSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_ASSIGN(const auto children, nested_bsdfs(object, 1, 1));
  CANDELA_ASSIGN(nested, Bsdf::build_part(*children[0], context));
  CANDELA_ASSIGN(opacity, read_fraction(object, context.textures, "opacity", 0.5f));
  return {};
}

void MaskSurface::prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const {
  Closure& nothing = arena.make();
  Closure& covered = arena.make();
  nothing.set(NullClosure{});
  nested->prepare(hit, wo, arena, covered);
  const float share = std::clamp(opacity.eval(hit), 0.0f, 1.0f);
  out.set(BlendClosure{&nothing, &covered, share});
  out.black = covered.black && share == 1;
}

BsdfFacts MaskSurface::facts() const {
  BsdfFacts facts = nested->facts();
  if (opacity.is_constant() && opacity.constant == 0) facts.forget_lobes();
  if (!opacity.is_constant() || opacity.constant < 1) facts.join(NullSurface().facts());
  return facts;
}

std::uint32_t MaskSurface::arena_parts() const {
  return 2 + nested->arena_parts();
}

}  // namespace candela::scene
