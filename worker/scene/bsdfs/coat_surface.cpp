#include "worker/scene/bsdfs/coat_surface.h"

#include <cmath>
#include <string>

#include "worker/scene/bsdfs/bsdf_build.h"
#include "worker/scene/bsdfs/layer.h"

namespace candela::scene {

Result<void> CoatSurface::build_coat(std::string_view plugin, const description::Object& object,
                                     const BuildContext& context) {
  CANDELA_ASSIGN(const auto children, nested_bsdfs(object, 1, 1));
  CANDELA_ASSIGN(base, Bsdf::build_part(*children[0], context));
  const BsdfFacts below = base->facts();
  if (below.transmissive || below.passthrough) {
    return located(
        std::string(plugin) + " holds a bsdf that lets no light through; " + children[0]->plugin + " does",
        *children[0], "");
  }
  CANDELA_ASSIGN(specular, read_reflectance(object, context.textures, "specular_reflectance", 1));
  CANDELA_ASSIGN(sigma_a, context.textures.color(object, "sigma_a", Spectrum()));
  CANDELA_ASSIGN(eta, read_relative_eta(object, 1.5046, 1.000277));  // bk7 in air
  thickness = static_cast<float>(object.get_number("thickness", 1));
  if (!(thickness >= 0) || !std::isfinite(thickness))
    return located("the thickness is finite and not negative", object, "thickness");
  return {};
}

void CoatSurface::prepare_coat(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, CoatClosure& out) const {
  Closure& below = arena.make();
  out.below = &below;
  out.eta = eta;
  out.specular = specular.eval(hit);
  out.absorption = sigma_a.eval(hit) * thickness;
  out.share = layer_share(out.specular, out.absorption);
  const Refracted o = refract_in(eta, wo);
  if (enters(o)) base->prepare(hit, o.inside, arena, below);
}

bool CoatSurface::is_black(const CoatClosure& layer, Vec3 wo) const {
  return (wo.z < 0 && !base->facts().two_sided) || (layer.specular.is_black() && layer.below->black);
}

std::uint32_t CoatSurface::arena_parts() const {
  return 1 + base->arena_parts();
}

}  // namespace candela::scene
