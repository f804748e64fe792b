#include "worker/scene/bsdfs/diffuse.h"

#include "worker/scene/bsdfs/kinds.h"

namespace candela::scene {

Result<void> DiffuseSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_ASSIGN(reflectance, read_reflectance(object, context.textures, "reflectance", 0.5f));
  return {};
}

void DiffuseSurface::prepare(const SurfacePoint& at, bool below, Closure& out) const {
  const DiffuseClosure p = {below ? Spectrum() : reflectance.eval(at)};
  out.set(p);
  out.black = p.reflectance.is_black();
}

BsdfFacts DiffuseSurface::facts() const {
  return {.smooth = true, .max_albedo = reflectance.maximum().max_component()};
}

}  // namespace candela::scene
