#include "common/description/pbrt/materials.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "common/description/check.h"
#include "common/description/conductors.h"
#include "common/description/media_presets.h"
#include "common/description/pbrt/media.h"
#include "common/description/text.h"

namespace candela::description::pbrt {
namespace {

constexpr std::array<std::string_view, 12> material_types = {
    "coatedconductor",     "coateddiffuse", "conductor", "dielectric", "diffuse",
    "diffusetransmission", "hair",          "interface", "measured",   "mix",
    "subsurface",          "thindielectric"};

constexpr int max_mix_depth = 64;
constexpr std::uint64_t max_mixed = 10'000;

// pbrt takes what is smoother for a mirror.
constexpr double smooth_alpha = 1e-3;

ObjectPtr twosided(const ObjectPtr& bsdf) {
  const std::shared_ptr<Object> both = make("bsdf", "twosided", bsdf->where);
  add(*both, "", bsdf);
  return both;
}

// pbrt turns the shading frame, whatever the viewer sees, and does nothing else.
void set_plain_turn(Object& map) {
  set_flag(map, "flip_invalid_normals", false);
  set_flag(map, "use_shadowing_function", false);
}

}  // namespace

Materials::Materials(Context& context, Textures& textures, const Location& scene)
    : context_(context), textures_(textures) {
  numbered_.push_back({"diffuse", {}, ColorSpace::srgb, scene, false, std::nullopt});
}

Result<void> Materials::define(const std::string& name, ParameterList parameters, ColorSpace space,
                               const Location& where) {
  CANDELA_ASSIGN(const std::string type, parameters.text("type", ""));
  if (type.empty())
    return error_at(where, fmt::format("the material {} has no type", text::quote(name)))
        .with_mend("write \"string type\" \"diffuse\"");
  CANDELA_TRY(check_type(type, where));
  constexpr std::size_t node_bytes = 64;
  CANDELA_TRY(
      context_.budget().charge(sizeof(Definition) + node_bytes + heap_bytes(name), where, "materials"));
  const auto [entry, added] =
      named_.try_emplace(name, Definition{type, std::move(parameters), space, where, false, std::nullopt});
  if (added) return {};
  const Location& first = entry->second.where;
  return error_at(where, fmt::format("the material {} is defined since {}:{}", text::quote(name), first.file,
                                     first.line));
}

Result<std::size_t> Materials::add(const std::string& type, ParameterList parameters, ColorSpace space,
                                   const Location& where) {
  CANDELA_TRY(check_type(type, where));
  CANDELA_TRY(make_room(numbered_, context_.budget(), where, "materials"));
  numbered_.push_back({type, std::move(parameters), space, where, false, std::nullopt});
  return numbered_.size() - 1;
}

// Also of materials that nothing uses.
Result<void> Materials::check_type(const std::string& type, const Location& where) {
  const bool known = std::find(material_types.begin(), material_types.end(), type) != material_types.end();
  if (known || type.empty() || type == "none" || context_.reading().lenient) return {};
  return Context::unknown(where, "material", type, material_types);
}

Result<Surface> Materials::surface(const MaterialName& name) {
  Definition* definition = name.name.empty() ? &numbered_[name.index] : nullptr;
  if (definition == nullptr) {
    const auto found = named_.find(name.name);
    if (found == named_.end()) {
      std::vector<std::string_view> known;
      for (const auto& [other, unused] : named_) known.push_back(other);
      return Context::unknown(name.where, "named material", name.name, known);
    }
    definition = &found->second;
  }
  if (definition->surface) return *definition->surface;
  if (definition->open) return error_at(definition->where, "the material holds itself");
  if (depth_ >= max_mix_depth)
    return error_at(definition->where,
                    fmt::format("materials are nested deeper than {} levels", max_mix_depth));
  definition->open = true;
  ++depth_;
  CANDELA_ASSIGN(Surface surface, read(*definition));
  if (!name.name.empty() && surface.bsdf) {
    const std::shared_ptr<Object> named = std::make_shared<Object>(*surface.bsdf);
    named->id = name.name;
    CANDELA_TRY(context_.budget().charge(memory_of(*named), definition->where, "materials"));
    surface.bsdf = named;
  }
  --depth_;
  definition->open = false;
  CANDELA_TRY(context_.refuse_unused(definition->parameters, fmt::format("material '{}'", definition->type)));
  definition->surface = surface;
  return surface;
}

Result<Surface> Materials::read(Definition& definition) {
  const std::string& type = definition.type;
  if (type == "diffuse") return diffuse(definition);
  if (type == "coateddiffuse") return coated_diffuse(definition);
  if (type == "conductor") return conductor(definition);
  if (type == "coatedconductor") return coated_conductor(definition);
  if (type == "dielectric") return dielectric(definition);
  if (type == "thindielectric") return thin_dielectric(definition);
  if (type == "diffusetransmission") return diffuse_transmission(definition);
  if (type == "mix") return mix(definition);
  if (type == "subsurface") return subsurface(definition);
  if (type == "interface" || type.empty() || type == "none") {
    CANDELA_ASSIGN(ObjectPtr null, context_.finish(make("bsdf", "null", definition.where)));
    return Surface{std::move(null)};
  }
  if (type == "hair") return hair(definition);
  if (type == "measured") return measured(definition);
  return stand_in(definition, Context::unknown(definition.where, "material", type, material_types));
}

// Only --lenient comes here.
Result<Surface> Materials::stand_in(Definition& definition, const Error& error) {
  CANDELA_TRY(context_.refuse(error, "it is read as 'diffuse'"));
  std::shared_ptr<Object> bsdf = make("bsdf", "diffuse", definition.where);
  for (const std::string_view name : {"reflectance", "color", "Kd"}) {
    CANDELA_ASSIGN(const std::optional<Value> value,
                   textures_.optional_color(definition.parameters, name, definition.space));
    if (!value) continue;
    set_color(*bsdf, "reflectance", *value);
    break;
  }
  definition.parameters = {};
  CANDELA_ASSIGN(ObjectPtr finished, context_.finish(std::move(bsdf)));
  return opaque(definition, std::move(finished));
}

Result<ObjectPtr> Materials::with_maps(Definition& definition, ObjectPtr bsdf) {
  CANDELA_ASSIGN(const std::optional<Value> displacement,
                 textures_.displacement(definition.parameters, "displacement"));
  CANDELA_ASSIGN(const std::string normals, definition.parameters.text("normalmap", ""));
  if (displacement && !displacement->is_constant()) {
    const std::shared_ptr<Object> map = make("bsdf", "bumpmap", definition.where);
    pbrt::add(*map, "texture", displacement->texture);
    if (displacement->negated) set(*map, "scale", -1.0);
    set_plain_turn(*map);
    pbrt::add(*map, "", std::move(bsdf));
    return context_.finish(map);
  }
  if (normals.empty()) return bsdf;
  CANDELA_ASSIGN(ObjectPtr picture, textures_.picture(definition.where, normals, true));
  const std::shared_ptr<Object> map = make("bsdf", "normalmap", definition.where);
  pbrt::add(*map, "normalmap", std::move(picture));
  set_plain_turn(*map);
  pbrt::add(*map, "", std::move(bsdf));
  return context_.finish(map);
}

Result<Surface> Materials::opaque(Definition& definition, ObjectPtr bsdf) {
  CANDELA_ASSIGN(ObjectPtr mapped, with_maps(definition, twosided(bsdf)));
  return Surface{std::move(mapped)};
}

Result<Materials::Roughness> Materials::roughness(Definition& definition, const std::string& prefix) {
  ParameterList& parameters = definition.parameters;
  CANDELA_ASSIGN(const bool remap, parameters.flag("remaproughness", true));
  CANDELA_ASSIGN(Value both, textures_.number(parameters, prefix + "roughness", 0));
  if (remap) {
    CANDELA_ASSIGN(both, textures_.root(both));
  }
  Roughness roughness{both, both, false};
  for (const auto& [name, value] :
       {std::pair("uroughness", &roughness.u), std::pair("vroughness", &roughness.v)}) {
    CANDELA_ASSIGN(std::optional<Value> given, textures_.optional_number(parameters, prefix + name));
    if (!given) continue;
    *value = std::move(*given);
    if (remap) {
      CANDELA_ASSIGN(*value, textures_.root(*value));
    }
  }
  roughness.smooth = roughness.u.is_constant() && roughness.v.is_constant() &&
                     std::max(roughness.u.number(), roughness.v.number()) < smooth_alpha;
  return roughness;
}

namespace {

Value at_least_smooth(Value value) {
  for (double& component : value.constant) component = std::max(component, smooth_alpha);
  return value;
}

bool is_same(const Value& a, const Value& b) {
  return a.texture == b.texture && a.constant == b.constant;
}

}  // namespace

void Materials::set_microfacets(Object& bsdf, const Roughness& rough) {
  set(bsdf, "distribution", std::string("ggx"));
  if (is_same(rough.u, rough.v)) {
    set_number(bsdf, "alpha", at_least_smooth(rough.u));
  } else {
    set_number(bsdf, "alpha_u", at_least_smooth(rough.u));
    set_number(bsdf, "alpha_v", at_least_smooth(rough.v));
  }
}

Result<Surface> Materials::diffuse(Definition& definition) {
  std::shared_ptr<Object> bsdf = make("bsdf", "diffuse", definition.where);
  CANDELA_ASSIGN(const Value reflectance, textures_.reflectance(definition.parameters, "reflectance",
                                                                {0.5, 0.5, 0.5}, definition.space));
  set_color(*bsdf, "reflectance", reflectance);
  CANDELA_ASSIGN(ObjectPtr finished, context_.finish(std::move(bsdf)));
  return opaque(definition, std::move(finished));
}

// A diffuse base under a coat, whose inner reflections are counted.
Result<ObjectPtr> Materials::coat(Definition& definition, const Value& reflectance, const Roughness& rough,
                                  double otherwise) {
  std::shared_ptr<Object> bsdf = make("bsdf", rough.smooth ? "plastic" : "roughplastic", definition.where);
  set_color(*bsdf, "diffuse_reflectance", reflectance);
  CANDELA_ASSIGN(const double eta, index_of(context_, definition.parameters, "eta", otherwise));
  set(*bsdf, "int_ior", eta);
  set(*bsdf, "ext_ior", 1.0);
  set_flag(*bsdf, "nonlinear", true);
  if (!rough.smooth) {
    set(*bsdf, "distribution", std::string("ggx"));
    Value alpha = rough.u;
    if (!is_same(rough.u, rough.v)) {
      context_.differs(definition.where,
                       fmt::format("material '{}' has the mean of its two roughnesses", definition.type));
      CANDELA_ASSIGN(alpha, textures_.mean(rough.u, rough.v));
    }
    set_number(*bsdf, "alpha", at_least_smooth(alpha));
  }
  return context_.finish(std::move(bsdf));
}

Result<Surface> Materials::coated_diffuse(Definition& definition) {
  ParameterList& parameters = definition.parameters;
  CANDELA_ASSIGN(const Value reflectance,
                 textures_.reflectance(parameters, "reflectance", {0.5, 0.5, 0.5}, definition.space));
  CANDELA_ASSIGN(const Roughness rough, roughness(definition, ""));
  CANDELA_ASSIGN(ObjectPtr bsdf, coat(definition, reflectance, rough));
  std::string more;
  if (parameters.has("albedo") || parameters.has("g")) more = ", and nothing scatters in the coat";
  parameters.ignore({"thickness", "albedo", "g", "maxdepth", "nsamples"});
  context_.differs(
      definition.where,
      fmt::format("material 'coateddiffuse' is '{}', which counts the light between coat and base "
                  "as a mean over directions; pbrt walks through the layers and loses light in them, "
                  "so that this is 3 to 37 % brighter{}",
                  bsdf->plugin, more));
  return opaque(definition, std::move(bsdf));
}

Result<Materials::Metal> Materials::metal(Definition& definition, const std::string& prefix) {
  ParameterList& parameters = definition.parameters;
  const ConductorIndex copper = *named_conductor("Cu");
  Metal metal;
  CANDELA_ASSIGN(const std::optional<Value> reflectance,
                 textures_.optional_color(parameters, prefix + "reflectance", definition.space));
  if (!reflectance) {
    CANDELA_ASSIGN(metal.eta, textures_.color(parameters, prefix + "eta", copper.eta, definition.space,
                                              SpectrumUse::unbounded));
    CANDELA_ASSIGN(metal.k, textures_.color(parameters, prefix + "k", copper.k, definition.space,
                                            SpectrumUse::unbounded));
    return metal;
  }
  if (!reflectance->is_constant()) {
    CANDELA_ASSIGN(metal.reflectance, textures_.at_most_one(*reflectance));
    context_.differs(definition.where,
                     "a metal whose reflectance is a texture reflects the same at all angles");
    return metal;
  }
  // The index of refraction 1 and the extinction that reflect this much at normal incidence.
  metal.eta = {{1, 1, 1}, nullptr, definition.where};
  for (std::size_t i = 0; i < 3; ++i) {
    const double r = std::clamp(reflectance->constant[i], 0.0, 0.9999);
    metal.k.constant[i] = 2 * std::sqrt(r) / std::sqrt(1 - r);
  }
  return metal;
}

// `outside`: the index of refraction of what the metal lies under.
Result<ObjectPtr> Materials::metal_bsdf(const Definition& definition, const Metal& metal,
                                        const Roughness& rough, double outside) {
  std::shared_ptr<Object> bsdf =
      make("bsdf", rough.smooth ? "conductor" : "roughconductor", definition.where);
  if (metal.reflectance) {
    set_color(*bsdf, "specular_reflectance", *metal.reflectance);
  } else {
    const double by = 1 / outside;
    CANDELA_ASSIGN(const Value eta, textures_.scaled(metal.eta, {by, by, by}));
    CANDELA_ASSIGN(const Value k, textures_.scaled(metal.k, {by, by, by}));
    set_color(*bsdf, "eta", eta);
    set_color(*bsdf, "k", k);
  }
  if (!rough.smooth) set_microfacets(*bsdf, rough);
  return context_.finish(std::move(bsdf));
}

Result<Surface> Materials::conductor(Definition& definition) {
  CANDELA_ASSIGN(const Metal m, metal(definition, ""));
  CANDELA_ASSIGN(const Roughness rough, roughness(definition, ""));
  CANDELA_ASSIGN(ObjectPtr bsdf, metal_bsdf(definition, m, rough, 1));
  return opaque(definition, std::move(bsdf));
}

Result<Surface> Materials::coated_conductor(Definition& definition) {
  ParameterList& parameters = definition.parameters;
  CANDELA_ASSIGN(const double eta, index_of(context_, parameters, "interface.eta", 1.5));
  if (!(eta > 0)) return error_at(definition.where, "parameter 'interface.eta' must be above 0");
  CANDELA_ASSIGN(const Metal m, metal(definition, parameters.has("reflectance") ? "" : "conductor."));
  CANDELA_ASSIGN(const Roughness rough, roughness(definition, "conductor."));
  CANDELA_ASSIGN(const Roughness layer, roughness(definition, "interface."));
  CANDELA_ASSIGN(ObjectPtr base, metal_bsdf(definition, m, rough, eta));
  parameters.ignore({"thickness", "albedo", "g", "maxdepth", "nsamples"});
  const std::shared_ptr<Object> coating = make("bsdf", "coating", definition.where);
  set(*coating, "int_ior", eta);
  set(*coating, "ext_ior", 1.0);
  pbrt::add(*coating, "", std::move(base));
  context_.differs(
      definition.where,
      fmt::format("material 'coatedconductor' is 'coating': light that its layer reflects back down "
                  "is lost, and nothing scatters in the layer{}",
                  layer.smooth ? "" : ", which is smooth"));
  CANDELA_ASSIGN(ObjectPtr bsdf, context_.finish(coating));
  return opaque(definition, std::move(bsdf));
}

Result<ObjectPtr> Materials::glass(Definition& definition) {
  CANDELA_ASSIGN(const double eta, index_of(context_, definition.parameters, "eta", 1.5));
  CANDELA_ASSIGN(const Roughness rough, roughness(definition, ""));
  std::shared_ptr<Object> bsdf =
      make("bsdf", rough.smooth ? "dielectric" : "roughdielectric", definition.where);
  set(*bsdf, "int_ior", eta);
  set(*bsdf, "ext_ior", 1.0);
  if (!rough.smooth) set_microfacets(*bsdf, rough);
  return context_.finish(std::move(bsdf));
}

Result<Surface> Materials::dielectric(Definition& definition) {
  CANDELA_ASSIGN(ObjectPtr bsdf, glass(definition));
  CANDELA_ASSIGN(ObjectPtr mapped, with_maps(definition, std::move(bsdf)));
  return Surface{std::move(mapped)};
}

Result<Surface> Materials::thin_dielectric(Definition& definition) {
  std::shared_ptr<Object> bsdf = make("bsdf", "thindielectric", definition.where);
  CANDELA_ASSIGN(const double eta, index_of(context_, definition.parameters, "eta", 1.5));
  set(*bsdf, "int_ior", eta);
  set(*bsdf, "ext_ior", 1.0);
  CANDELA_ASSIGN(ObjectPtr finished, context_.finish(std::move(bsdf)));
  CANDELA_ASSIGN(ObjectPtr mapped, with_maps(definition, std::move(finished)));
  return Surface{std::move(mapped)};
}

Result<Surface> Materials::diffuse_transmission(Definition& definition) {
  ParameterList& parameters = definition.parameters;
  constexpr Vec3 quarter = {0.25, 0.25, 0.25};
  CANDELA_ASSIGN(Value reflectance, textures_.color(parameters, "reflectance", quarter, definition.space));
  CANDELA_ASSIGN(Value transmittance,
                 textures_.color(parameters, "transmittance", quarter, definition.space));
  CANDELA_ASSIGN(const double scale, parameters.number("scale", 1));
  for (Value* part : {&reflectance, &transmittance}) {
    CANDELA_ASSIGN(*part, textures_.scaled(*part, {scale, scale, scale}));
    CANDELA_ASSIGN(*part, textures_.at_most_one(*part));
  }
  const bool constant = reflectance.is_constant() && transmittance.is_constant();
  double sum = 0;
  for (std::size_t i = 0; i < 3; ++i)
    sum = std::max(sum, reflectance.constant[i] + transmittance.constant[i]);
  if (constant && sum > 1 + 1e-6) {
    CANDELA_TRY(context_.refuse(
        error_at(
            definition.where,
            fmt::format("reflectance and transmittance of material 'diffusetransmission' add up to {:.6g} "
                        "in a channel, more than 1",
                        sum)),
        "both are scaled down"));
    for (Value* part : {&reflectance, &transmittance}) {
      CANDELA_ASSIGN(*part, textures_.scaled(*part, {1 / sum, 1 / sum, 1 / sum}));
    }
  }
  if (!constant)
    context_.differs(
        definition.where,
        "where reflectance and transmittance add up to more than 1 in a channel, less is transmitted");
  const std::shared_ptr<Object> bsdf = make("bsdf", "difftrans", definition.where);
  set_color(*bsdf, "reflectance", reflectance);
  set_color(*bsdf, "transmittance", transmittance);
  CANDELA_ASSIGN(ObjectPtr finished, context_.finish(bsdf));
  CANDELA_ASSIGN(ObjectPtr mapped, with_maps(definition, std::move(finished)));
  return Surface{std::move(mapped)};
}

namespace {

// The root of what hair absorbs times this is minus the logarithm of its color [Chiang et al. 2016].
double hair_root_factor(double beta_n) {
  const double b = std::clamp(beta_n, 0.0, 1.0), b2 = b * b;
  return 5.969 - 0.215 * b + 2.532 * b2 - 10.73 * b2 * b + 5.574 * b2 * b2 + 0.245 * b2 * b2 * b;
}

}  // namespace

Result<Surface> Materials::mix(Definition& definition) {
  const Parameter* names = definition.parameters.take("materials", {"string"});
  if (names == nullptr || names->strings.size() != 2)
    return error_at(definition.where, "material 'mix' needs the names of two materials")
        .with_mend("write \"string materials\" [ \"first\" \"second\" ]");
  CANDELA_ASSIGN(const Value amount, textures_.number(definition.parameters, "amount", 0.5));
  const std::shared_ptr<Object> blend = make("bsdf", "blendbsdf", definition.where);
  set_number(*blend, "weight", amount);
  std::uint64_t materials = 1;
  for (const std::string& name : names->strings) {
    CANDELA_ASSIGN(Surface part, surface({name, 0, names->where}));
    materials += part.materials;
    if (materials > max_mixed)
      return error_at(definition.where, fmt::format("the mix is made of more than {} materials", max_mixed))
          .with_mend("name mixes in other mixes only once");
    if (part.interior)
      context_.differs(names->where, fmt::format("nothing scatters within {} in a mix", text::quote(name)));
    pbrt::add(*blend, "", std::move(part.bsdf));
  }
  CANDELA_ASSIGN(ObjectPtr finished, context_.finish(blend));
  return Surface{std::move(finished), nullptr, materials};
}

Result<Surface> Materials::subsurface(Definition& definition) {
  ParameterList& parameters = definition.parameters;
  if (parameters.has("reflectance")) {
    CANDELA_ASSIGN(const Value reflectance,
                   textures_.reflectance(parameters, "reflectance", {0.5, 0.5, 0.5}, definition.space));
    CANDELA_ASSIGN(const Roughness rough, roughness(definition, ""));
    CANDELA_ASSIGN(ObjectPtr bsdf, coat(definition, reflectance, rough));
    parameters.ignore({"mfp", "g", "scale", "sigma_a", "sigma_s", "name"});
    context_.differs(
        definition.where,
        fmt::format("material 'subsurface' of a given reflectance is '{}': light leaves where it "
                    "entered",
                    bsdf->plugin));
    return opaque(definition, std::move(bsdf));
  }
  CANDELA_ASSIGN(ObjectPtr bsdf, glass(definition));
  CANDELA_ASSIGN(ObjectPtr interior,
                 scattering_medium(context_, parameters, "name", definition.space, definition.where));
  parameters.ignore({"mfp"});
  context_.differs(
      definition.where,
      "material 'subsurface' is glass filled with a medium, where pbrt has a profile of diffusion");
  CANDELA_ASSIGN(ObjectPtr mapped, with_maps(definition, std::move(bsdf)));
  return Surface{std::move(mapped), std::move(interior)};
}

// A fiber's color by its pigments or its absorption, as the coat of a rough plastic.
Result<Surface> Materials::hair(Definition& definition) {
  ParameterList& parameters = definition.parameters;
  CANDELA_ASSIGN(const Value beta_m, textures_.number(parameters, "beta_m", 0.3));
  CANDELA_ASSIGN(const Value beta_n, textures_.number(parameters, "beta_n", 0.3));
  std::optional<Value> color;
  for (const std::string_view name : {"reflectance", "color"}) {
    if (color) continue;
    CANDELA_ASSIGN(color, textures_.optional_color(parameters, name, definition.space));
  }
  if (!color) {
    CANDELA_ASSIGN(const Vec3 absorption, hair_absorption(definition));
    const double factor = hair_root_factor(beta_n.is_constant() ? beta_n.number() : 0.3);
    color = Value{{}, nullptr, definition.where};
    for (std::size_t i = 0; i < 3; ++i)
      color->constant[i] = std::exp(-std::sqrt(std::max(absorption[i], 0.0)) * factor);
  }
  parameters.ignore({"alpha", "eumelanin", "pheomelanin", "sigma_a"});
  CANDELA_ASSIGN(const Value reflectance, textures_.at_most_one(*color));
  const double smoothness = beta_m.is_constant() ? std::clamp(beta_m.number(), 0.0, 1.0) : 0.3;
  const Value alpha{{smoothness, smoothness, smoothness}, nullptr, definition.where};
  CANDELA_ASSIGN(ObjectPtr bsdf,
                 coat(definition, reflectance, {alpha, alpha, smoothness < smooth_alpha}, 1.55));
  context_.differs(definition.where,
                   fmt::format("material 'hair' is '{}' of the hair's color: no light goes through, and "
                               "highlights have no color",
                               bsdf->plugin));
  return opaque(definition, std::move(bsdf));
}

Result<Vec3> Materials::hair_absorption(Definition& definition) {
  ParameterList& parameters = definition.parameters;
  if (const Parameter* given = parameters.take("sigma_a", {"rgb", "spectrum"})) {
    CANDELA_ASSIGN(const Rgb rgb, color_of(context_, *given, SpectrumUse::unbounded, definition.space));
    return rgb.value;
  }
  if (parameters.take("sigma_a", {"texture"}) != nullptr)
    context_.differs(definition.where, "a texture as 'sigma_a' of material 'hair' is passed over");
  const auto concentration = [&](const Value& value, std::string_view name, double otherwise) {
    if (value.is_constant()) return value.number();
    context_.differs(definition.where,
                     fmt::format("a texture as '{}' of material 'hair' is the constant {}", name, otherwise));
    return otherwise;
  };
  // Absorption of the pigments per unit of concentration [Chiang et al. 2016].
  constexpr Vec3 eumelanin = {0.419, 0.697, 1.37}, pheomelanin = {0.187, 0.4, 1.05};
  const bool has_pigments = parameters.has("eumelanin") || parameters.has("pheomelanin");
  CANDELA_ASSIGN(const Value dark, textures_.number(parameters, "eumelanin", has_pigments ? 0 : 1.3));
  CANDELA_ASSIGN(const Value red, textures_.number(parameters, "pheomelanin", 0));
  const double darkness = concentration(dark, "eumelanin", 1.3),
               redness = concentration(red, "pheomelanin", 0);
  Vec3 absorption{};
  for (std::size_t i = 0; i < 3; ++i) absorption[i] = darkness * eumelanin[i] + redness * pheomelanin[i];
  return absorption;
}

// Its file holds a table of reflectances in two directions at each wavelength.
Result<Surface> Materials::measured(Definition& definition) {
  CANDELA_ASSIGN(const std::string file, definition.parameters.text("filename", ""));
  if (!file.empty()) {
    CANDELA_ASSIGN([[maybe_unused]] const std::string key, context_.find_file(definition.where, file));
  }
  context_.differs(definition.where, "material 'measured' is 'diffuse' of a reflectance of 0.5");
  return diffuse(definition);
}

}  // namespace candela::description::pbrt
