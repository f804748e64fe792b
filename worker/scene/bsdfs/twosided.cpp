#include "worker/scene/bsdfs/twosided.h"

#include <algorithm>
#include <utility>

#include "worker/scene/bsdfs/bsdf_build.h"

namespace candela::scene {

Result<void> TwoSidedSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_ASSIGN(const auto children, nested_bsdfs(object, 1, 2));
  for (const auto& child : children) {
    if (child->plugin == "twosided") return located("twosided holds one-sided bsdfs", *child, "");
    CANDELA_ASSIGN(std::unique_ptr<Bsdf> side, Bsdf::build_part(*child, context));
    const BsdfFacts facts = side->facts();
    if (facts.two_sided) return located("twosided holds one-sided bsdfs", *child, "");
    if (facts.transmissive || facts.passthrough) {
      return located("twosided holds bsdfs that let no light through; " + child->plugin + " does", *child, "")
          .with_mend("use the " + child->plugin + " alone: it has two sides already");
    }
    (front == nullptr ? front : back) = std::move(side);
  }
  return {};
}

void TwoSidedSurface::prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const {
  const bool below = wo.z < 0;
  const Bsdf& side = below && back != nullptr ? *back : *front;
  side.prepare(hit, below ? Vec3{wo.x, wo.y, -wo.z} : wo, arena, out);
  out.flipped = below;
}

BsdfFacts TwoSidedSurface::facts() const {
  BsdfFacts facts = front->facts();
  if (back != nullptr) facts.join(back->facts());
  facts.two_sided = true;
  return facts;
}

std::uint32_t TwoSidedSurface::arena_parts() const {
  return std::max(front->arena_parts(), back != nullptr ? back->arena_parts() : 0);
}

}  // namespace candela::scene
