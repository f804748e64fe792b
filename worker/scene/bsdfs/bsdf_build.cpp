// From description objects to Bsdfs, and from Bsdfs at a hit to Closures.
#include "worker/scene/bsdfs/bsdf_build.h"

#include <algorithm>
#include <type_traits>
#include <utility>

#include "worker/scene/bsdfs/surface_support.h"

namespace candela::scene {
namespace {

constexpr int kMaxNesting = 8;

// The children of a composite, which needs `least` to `most` of them.
Result<std::vector<description::ObjectPtr>> parts(const description::Object& object, std::size_t least,
                                                  std::size_t most) {
  auto children = object.children_of("bsdf");
  if (children.size() < least || children.size() > most) {
    const std::string wanted =
        least == most ? std::to_string(least) : std::to_string(least) + " or " + std::to_string(most);
    return located(object.plugin + " holds " + wanted + " bsdfs; here are " + std::to_string(children.size()),
                   object, "");
  }
  return children;
}

// A weight between 0 and 1.
Result<FloatTexture> fraction(const description::Object& object, TextureStore& textures,
                              std::string_view name, float otherwise) {
  CANDELA_ASSIGN(FloatTexture value, textures.number(object, name, otherwise));
  if (value.is_constant() && !(value.constant >= 0 && value.constant <= 1)) {
    return located(std::string(name) + " lies between 0 and 1, not at " + shown(value.constant), object,
                   name);
  }
  return value;
}

float clamped(float v) {
  return std::clamp(v, 0.0f, 1.0f);
}

}  // namespace

Result<Bsdf> Bsdf::build(const description::Object& object, TextureStore& textures,
                         RoughTransmittances& coats) {
  CANDELA_ASSIGN(Bsdf bsdf, build_at_depth(object, textures, coats, 0));
  if (bsdf.arena_parts() > ClosureArena::kParts) {
    return located("the bsdf is made of too many parts; up to " + std::to_string(ClosureArena::kParts) +
                       " are supported",
                   object, "");
  }
  return bsdf;
}

Result<Bsdf> Bsdf::build(const description::Object& object, TextureStore& textures) {
  RoughTransmittances coats;
  return build(object, textures, coats);
}

Result<Bsdf> Bsdf::build_at_depth(const description::Object& object, TextureStore& textures,
                                  RoughTransmittances& coats, int depth) {
  if (depth > kMaxNesting) return located("bsdfs are nested more than 8 deep", object, "");
  Bsdf bsdf;
  bsdf.plugin_ = object.plugin;
  const auto plain = [&](auto surface) -> Result<Bsdf> {
    if constexpr (std::is_same_v<decltype(surface), RoughPlasticSurface>) {
      CANDELA_TRY(surface.build(object, textures, coats));
    } else {
      CANDELA_TRY(surface.build(object, textures));
    }
    bsdf.surface_ = std::move(surface);
    return std::move(bsdf);
  };
  const std::string& plugin = object.plugin;
  if (plugin == "diffuse") return plain(DiffuseSurface());
  if (plugin == "dielectric") return plain(DielectricSurface());
  if (plugin == "conductor") return plain(ConductorSurface());
  if (plugin == "roughconductor") return plain(RoughConductorSurface());
  if (plugin == "null") return plain(NullSurface());
  if (plugin == "phong") return plain(PhongSurface());
  if (plugin == "ward") return plain(WardSurface());
  if (plugin == "principled") return plain(PrincipledSurface());
  if (plugin == "roughdielectric") return plain(RoughDielectricSurface());
  if (plugin == "thindielectric") return plain(ThinDielectricSurface());
  if (plugin == "plastic") return plain(PlasticSurface());
  if (plugin == "roughplastic") return plain(RoughPlasticSurface());
  if (plugin == "twosided") {
    CANDELA_TRY(bsdf.build_two_sided(object, textures, coats, depth));
    return bsdf;
  }
  if (plugin == "blendbsdf") {
    CANDELA_TRY(bsdf.build_blend(object, textures, coats, depth));
    return bsdf;
  }
  if (plugin == "mask") {
    CANDELA_TRY(bsdf.build_mask(object, textures, coats, depth));
    return bsdf;
  }
  if (plugin == "normalmap" || plugin == "bumpmap") {
    CANDELA_TRY(bsdf.build_perturbed(object, textures, coats, depth));
    return bsdf;
  }
  return located("the bsdf plugin '" + plugin + "' is not supported", object, "");
}

Result<std::unique_ptr<Bsdf>> Bsdf::build_part(const description::Object& object, TextureStore& textures,
                                               RoughTransmittances& coats, int depth) {
  CANDELA_ASSIGN(Bsdf part, build_at_depth(object, textures, coats, depth + 1));
  return std::make_unique<Bsdf>(std::move(part));
}

Result<void> Bsdf::build_two_sided(const description::Object& object, TextureStore& textures,
                                   RoughTransmittances& coats, int depth) {
  CANDELA_ASSIGN(const auto children, parts(object, 1, 2));
  TwoSided sides;
  for (const auto& child : children) {
    if (child->plugin == "twosided") return located("twosided holds one-sided bsdfs", *child, "");
    CANDELA_ASSIGN(std::unique_ptr<Bsdf> side, build_part(*child, textures, coats, depth));
    const BsdfFacts facts = side->facts();
    if (facts.two_sided) return located("twosided holds one-sided bsdfs", *child, "");
    if (facts.transmissive || facts.straight) {
      return located("twosided holds bsdfs that let no light through; " + child->plugin + " does", *child, "")
          .with_mend("use the " + child->plugin + " alone: it has two sides already");
    }
    (sides.front == nullptr ? sides.front : sides.back) = std::move(side);
  }
  surface_ = std::move(sides);
  return {};
}

Result<void> Bsdf::build_blend(const description::Object& object, TextureStore& textures,
                               RoughTransmittances& coats, int depth) {
  CANDELA_ASSIGN(const auto children, parts(object, 2, 2));
  Blend blend;
  CANDELA_ASSIGN(blend.first, build_part(*children[0], textures, coats, depth));
  CANDELA_ASSIGN(blend.second, build_part(*children[1], textures, coats, depth));
  CANDELA_ASSIGN(blend.weight, fraction(object, textures, "weight", 0.5f));
  surface_ = std::move(blend);
  return {};
}

Result<void> Bsdf::build_mask(const description::Object& object, TextureStore& textures,
                              RoughTransmittances& coats, int depth) {
  CANDELA_ASSIGN(const auto children, parts(object, 1, 1));
  Mask mask;
  CANDELA_ASSIGN(mask.nested, build_part(*children[0], textures, coats, depth));
  CANDELA_ASSIGN(mask.opacity, fraction(object, textures, "opacity", 0.5f));
  surface_ = std::move(mask);
  return {};
}

Result<void> Bsdf::build_perturbed(const description::Object& object, TextureStore& textures,
                                   RoughTransmittances& coats, int depth) {
  CANDELA_ASSIGN(const auto children, parts(object, 1, 1));
  Perturbed perturbed;
  CANDELA_ASSIGN(perturbed.nested, build_part(*children[0], textures, coats, depth));
  if (perturbed.nested->facts().perturbs)
    return located("bump and normal maps inside of one another are not supported", *children[0], "");
  CANDELA_TRY(perturbed.map.build(object, textures));
  surface_ = std::move(perturbed);
  return {};
}

Bsdf Bsdf::default_diffuse() {
  Bsdf bsdf;
  DiffuseSurface surface;
  surface.reflectance.constant = Spectrum(0.5f);
  bsdf.surface_ = surface;
  return bsdf;
}

void Bsdf::prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const {
  std::visit(
      [&](const auto& surface) {
        using S = std::decay_t<decltype(surface)>;
        if constexpr (std::is_same_v<S, TwoSided>) {
          const bool below = wo.z < 0;
          surface.of(below).prepare(hit, below ? Vec3{wo.x, wo.y, -wo.z} : wo, arena, out);
          out.flipped = below;
        } else if constexpr (std::is_same_v<S, Blend>) {
          Closure& first = arena.make();
          Closure& second = arena.make();
          surface.first->prepare(hit, wo, arena, first);
          surface.second->prepare(hit, wo, arena, second);
          out.kind = BsdfKind::blend;
          out.blend = {&first, &second, clamped(surface.weight.eval(hit.uv))};
          out.black = (first.black || out.blend.weight == 1) && (second.black || out.blend.weight == 0);
        } else if constexpr (std::is_same_v<S, Mask>) {
          Closure& first = arena.make();
          Closure& second = arena.make();
          first.kind = BsdfKind::null;
          surface.nested->prepare(hit, wo, arena, second);
          out.kind = BsdfKind::blend;
          out.blend = {&first, &second, clamped(surface.opacity.eval(hit.uv))};
          out.black = second.black && out.blend.weight == 1;
        } else if constexpr (std::is_same_v<S, Perturbed>) {
          Closure& nested = arena.make();
          surface.nested->prepare(hit, wo, arena, nested);  // seen from the same side in both frames
          out.kind = BsdfKind::perturbed;
          out.black = nested.black;
          surface.map.prepare(hit, out.perturbed);
          out.perturbed.nested = &nested;
        } else {
          surface.prepare(hit.uv, wo.z < 0, out);
        }
      },
      surface_);
}

BsdfFacts Bsdf::facts() const {
  return std::visit(
      [](const auto& surface) -> BsdfFacts {
        using S = std::decay_t<decltype(surface)>;
        if constexpr (std::is_same_v<S, TwoSided>) {
          BsdfFacts facts = surface.front->facts();
          if (surface.back != nullptr) facts.join(surface.back->facts());
          facts.two_sided = true;
          return facts;
        } else if constexpr (std::is_same_v<S, Blend>) {
          BsdfFacts facts = surface.first->facts();
          BsdfFacts second = surface.second->facts();
          // The lobes of a part that nowhere counts are none.
          if (surface.weight.is_constant() && surface.weight.constant == 0) second.forget_lobes();
          if (surface.weight.is_constant() && surface.weight.constant == 1) facts.forget_lobes();
          facts.join(second);
          return facts;
        } else if constexpr (std::is_same_v<S, Mask>) {
          BsdfFacts facts = surface.nested->facts();
          if (surface.opacity.is_constant() && surface.opacity.constant == 0) facts.forget_lobes();
          if (!surface.opacity.is_constant() || surface.opacity.constant < 1)
            facts.join(NullSurface().facts());
          return facts;
        } else if constexpr (std::is_same_v<S, Perturbed>) {
          BsdfFacts facts = surface.nested->facts();
          facts.perturbs = true;
          facts.reads_partials |= surface.map.bump;
          return facts;
        } else {
          BsdfFacts facts = surface.facts();
          // A surface that scatters nothing has no lobes.
          if (facts.black()) facts.delta = facts.smooth = false;
          return facts;
        }
      },
      surface_);
}

void Bsdf::collect_plugins(std::vector<std::string>& names) const {
  std::visit(
      [&](const auto& surface) {
        using S = std::decay_t<decltype(surface)>;
        if constexpr (std::is_same_v<S, TwoSided>) {
          surface.front->collect_plugins(names);
          if (surface.back != nullptr) surface.back->collect_plugins(names);
        } else if constexpr (std::is_same_v<S, Blend>) {
          surface.first->collect_plugins(names);
          surface.second->collect_plugins(names);
        } else if constexpr (std::is_same_v<S, Mask> || std::is_same_v<S, Perturbed>) {
          surface.nested->collect_plugins(names);
        }
      },
      surface_);
  if (plugin_ != "twosided" && std::find(names.begin(), names.end(), plugin_) == names.end())
    names.push_back(plugin_);
}

std::uint32_t Bsdf::arena_parts() const {
  return std::visit(
      [](const auto& surface) -> std::uint32_t {
        using S = std::decay_t<decltype(surface)>;
        if constexpr (std::is_same_v<S, TwoSided>) {
          return std::max(surface.front->arena_parts(),
                          surface.back != nullptr ? surface.back->arena_parts() : 0);
        } else if constexpr (std::is_same_v<S, Blend>) {
          return 2 + surface.first->arena_parts() + surface.second->arena_parts();
        } else if constexpr (std::is_same_v<S, Mask>) {
          return 2 + surface.nested->arena_parts();
        } else if constexpr (std::is_same_v<S, Perturbed>) {
          return 1 + surface.nested->arena_parts();
        } else {
          return 0;
        }
      },
      surface_);
}

}  // namespace candela::scene
