// From description objects to Bsdfs, and from Bsdfs at a hit to Closures.
#include "worker/scene/bsdfs/bsdf_build.h"

#include <algorithm>
#include <iterator>
#include <type_traits>
#include <utility>

namespace candela::scene {
namespace {

constexpr int kMaxNesting = 8;

template <class S>
concept Composite = requires(const S& surface) {
  surface.arena_parts();
};

// Builds the surface, from row kRow of the list on, that has the object's plugin among its names.
template <std::size_t kRow = 0>
Result<BsdfSurface> build_surface(const description::Object& object, const BuildContext& context) {
  if constexpr (kRow == kBsdfKinds) {
    return located("the bsdf plugin '" + object.plugin + "' is not supported", object, "");
  } else {
    using S = std::variant_alternative_t<kRow, BsdfSurface>;
    const auto& names = S::kPlugins;
    if (std::find(std::begin(names), std::end(names), object.plugin) == std::end(names))
      return build_surface<kRow + 1>(object, context);
    S surface;
    CANDELA_TRY(surface.build(object, context));
    return BsdfSurface(std::move(surface));
  }
}

std::string too_many_parts() {
  return "the bsdf is made of too many parts; up to " + std::to_string(ClosureArena::kParts) +
         " are supported";
}

}  // namespace

Result<Bsdf> Bsdf::build(const description::Object& object, TextureStore& textures,
                         RoughTransmittances& coats) {
  CANDELA_ASSIGN(Bsdf bsdf, build_in(object, {.textures = textures, .coats = coats}));
  if (bsdf.arena_parts() > ClosureArena::kParts) return located(too_many_parts(), object, "");
  return bsdf;
}

Result<Bsdf> Bsdf::build(const description::Object& object, TextureStore& textures) {
  RoughTransmittances coats;
  return build(object, textures, coats);
}

Result<Bsdf> Bsdf::build_in(const description::Object& object, const BuildContext& context) {
  if (context.depth > kMaxNesting) return located("bsdfs are nested more than 8 deep", object, "");
  Bsdf bsdf;
  bsdf.plugin_ = object.plugin;
  CANDELA_ASSIGN(bsdf.surface_, build_surface(object, context));
  return bsdf;
}

Result<std::unique_ptr<Bsdf>> Bsdf::build_part(const description::Object& object,
                                               const BuildContext& composite) {
  BuildContext context = composite;
  ++context.depth;
  CANDELA_ASSIGN(Bsdf part, build_in(object, context));
  return std::make_unique<Bsdf>(std::move(part));
}

Bsdf Bsdf::default_diffuse() {
  Bsdf bsdf;
  DiffuseSurface surface;
  surface.reflectance.constant = Spectrum(0.5f);
  bsdf.surface_ = surface;
  return bsdf;
}

Result<Bsdf> Bsdf::with_strict_normals(Bsdf bsdf) {
  StrictNormalsSurface surface;
  Bsdf strict;
  strict.plugin_ = bsdf.plugin_;  // it is listed as its part
  surface.nested = std::make_unique<Bsdf>(std::move(bsdf));
  strict.surface_ = std::move(surface);
  if (strict.arena_parts() > ClosureArena::kParts)
    return input_error(too_many_parts() + ", of which strict_normals is one");
  return strict;
}

Result<Bsdf> Bsdf::with_edits(const std::vector<Bsdf>& bsdfs, std::uint32_t nested, SurfaceEdits edits) {
  EditedSurface surface;
  surface.bsdfs = &bsdfs;
  surface.nested = nested;
  surface.edits = std::make_unique<SurfaceEdits>(std::move(edits));
  Bsdf edited;
  edited.plugin_ = bsdfs[nested].plugin_;  // it is listed as its part
  edited.surface_ = std::move(surface);
  if (edited.arena_parts() > ClosureArena::kParts)
    return input_error(too_many_parts() + ", of which the edit is one");
  return edited;
}

void Bsdf::prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const {
  std::visit(
      [&](const auto& surface) {
        if constexpr (Composite<std::decay_t<decltype(surface)>>)
          surface.prepare(hit, wo, arena, out);
        else
          surface.prepare(hit, wo.z < 0, out);
      },
      surface_);
}

BsdfFacts Bsdf::facts() const {
  return std::visit(
      [](const auto& surface) {
        BsdfFacts facts = surface.facts();
        // A plain surface that scatters nothing has no lobes.
        if (!Composite<std::decay_t<decltype(surface)>> && facts.black()) facts.delta = facts.smooth = false;
        return facts;
      },
      surface_);
}

void Bsdf::collect_plugins(std::vector<std::string>& names) const {
  std::visit(
      [&](const auto& surface) {
        if constexpr (Composite<std::decay_t<decltype(surface)>>)
          surface.for_each_part([&](const Bsdf& part) { part.collect_plugins(names); });
      },
      surface_);
  if (plugin_ != "twosided" && std::find(names.begin(), names.end(), plugin_) == names.end())
    names.push_back(plugin_);
}

std::uint32_t Bsdf::arena_parts() const {
  return std::visit(
      [](const auto& surface) -> std::uint32_t {
        if constexpr (Composite<std::decay_t<decltype(surface)>>)
          return surface.arena_parts();
        else
          return 0;
      },
      surface_);
}

}  // namespace candela::scene
