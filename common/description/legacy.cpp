#include "common/description/legacy.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "common/description/conductors.h"
#include "common/description/media_presets.h"
#include "common/description/text.h"
#include "common/description/transform.h"
#include "common/description/vocabulary.h"

namespace candela::description::legacy {
namespace {

Property* find(Object& object, std::string_view name) {
  const auto found = std::find_if(object.properties.begin(), object.properties.end(),
                                  [&](const Property& property) { return property.name == name; });
  return found == object.properties.end() ? nullptr : &*found;
}

std::optional<Property> take(Object& object, std::string_view name) {
  Property* found = find(object, name);
  if (found == nullptr) return std::nullopt;
  Property property = std::move(*found);
  object.properties.erase(object.properties.begin() + (found - object.properties.data()));
  return property;
}

Error error_at(const Property& property, std::string message) {
  return input_error(std::move(message)).at(property.where.file, property.where.line);
}

bool has(const Slots& slots, std::string_view name) {
  return std::find(slots.begin(), slots.end(), name) != slots.end();
}

// Both have 'diffuseReflectance' as another name of 'reflectance'.
bool is_diffuse(const Object& object) {
  return object.category == "bsdf" && (object.plugin == "diffuse" || object.plugin == "roughdiffuse");
}

std::optional<double> number_of(const Property& property) {
  if (const auto* number = std::get_if<double>(&property.value)) return *number;
  if (const auto* integer = std::get_if<std::int64_t>(&property.value)) return static_cast<double>(*integer);
  return std::nullopt;
}

// 0.6 looks up at uv * scale + offset; today that is a transform.
Result<void> merge_uv_parameters(Object& object) {
  Vec3 offset = {0, 0, 0};
  Vec3 scale = {1, 1, 1};
  struct Target {
    std::string_view name;
    double& value;
  };
  double both = 1;  // uvscale, which uscale and vscale override
  const std::array<Target, 5> targets = {{{"uvscale", both},
                                          {"uoffset", offset[0]},
                                          {"voffset", offset[1]},
                                          {"uscale", scale[0]},
                                          {"vscale", scale[1]}}};
  std::optional<Location> first;
  for (const Target& target : targets) {
    const std::optional<Property> property = take(object, target.name);
    if (!property) continue;
    const std::optional<double> number = number_of(*property);
    if (!number) return error_at(*property, fmt::format("parameter '{}' must be a float", target.name));
    target.value = *number;
    if (target.name == "uvscale") scale[0] = scale[1] = both;
    if (!first) first = property->where;
  }
  if (!first) return {};
  if (const Property* other = find(object, "to_uv"))
    return error_at(*other, "'to_uv' and 'uoffset', 'voffset', 'uscale' or 'vscale' exclude each other");
  Property merged;
  merged.name = "to_uv";
  merged.type = PropertyType::transform;
  merged.value = transform::multiply(transform::translate(offset), transform::scale(scale));
  merged.where = *first;
  if (!transform::is_invertible(std::get<Mat4>(merged.value)))
    return error_at(merged, "'uscale' and 'vscale' must not be 0");
  object.properties.push_back(std::move(merged));
  return {};
}

Result<void> upgrade_bitmap(Object& object, std::vector<Note>& notes) {
  // Prefiltered lookups of 0.6: without ray differentials they are bilinear ones.
  if (Property* filter = find(object, "filter_type");
      filter != nullptr && filter->type == PropertyType::string) {
    const std::string value = text::lower(std::get<std::string>(filter->value));
    if (value == "ewa" || value == "trilinear") {
      notes.push_back(
          {filter->where, fmt::format("the texture filter {} is read as bilinear: nothing is blurred "
                                      "with distance, but averaged by the samples of a pixel",
                                      text::quote(value))});
      filter->value = std::string("bilinear");
    }
  }
  // 0.6 has two names for each border value, and the mode of both directions as the default of each.
  for (const std::string_view name : {"wrap_mode", "wrap_mode_u", "wrap_mode_v"}) {
    Property* mode = find(object, name);
    auto* value = mode == nullptr ? nullptr : std::get_if<std::string>(&mode->value);
    if (value == nullptr) continue;
    const std::string folded = text::lower(*value);
    *value = folded == "black" ? "zero" : folded == "white" ? "one" : folded;
  }
  // One mode given for both directions is today's single parameter.
  const auto text_of = [&](std::string_view name) {
    const Property* property = find(object, name);
    return property == nullptr ? nullptr : std::get_if<std::string>(&property->value);
  };
  const std::string* u = text_of("wrap_mode_u");
  const std::string* v = text_of("wrap_mode_v");
  if (find(object, "wrap_mode") == nullptr && u != nullptr && v != nullptr && *u == *v) {
    take(object, "wrap_mode_v");
    Property both = *take(object, "wrap_mode_u");
    both.name = "wrap_mode";
    object.properties.push_back(std::move(both));
  }
  return {};
}

// A number, or a name of one.
Result<double> index_of(const Property& property) {
  if (const auto* name = std::get_if<std::string>(&property.value)) {
    const std::optional<double> index = named_index_of_refraction(*name);
    if (index) return *index;
    return error_at(property,
                    fmt::format("{} is not a material with a known index of refraction", text::quote(*name)));
  }
  const std::optional<double> index = number_of(property);
  if (!index)
    return error_at(property, fmt::format("parameter '{}' must be a float or a string", property.name));
  if (!(*index > 0))
    return error_at(property,
                    fmt::format("parameter '{}' is {}, but must be above 0", property.name, *index));
  return *index;
}

// 0.6 takes eta and k each from the material (copper, if none is named) where they are not given, and divides
// both by ext_eta.
Result<void> upgrade_conductor(Object& object) {
  Rgb eta{{0, 0, 0}};
  Rgb k{{1, 1, 1}};
  const std::optional<Property> material = take(object, "material");
  std::string_view name = "Cu";
  if (material) {
    const auto* text = std::get_if<std::string>(&material->value);
    if (text == nullptr) return error_at(*material, "parameter 'material' must be a string");
    name = *text;
  }
  const bool mirror = text::lower(name) == "none";
  if (!mirror) {
    const std::optional<ConductorIndex> index = named_conductor(name);
    if (!index) return unknown_conductor(*material);
    eta.value = index->eta;
    k.value = index->k;
  }
  double outside = 1;
  const std::optional<Property> ext_eta = take(object, "ext_eta");
  if (ext_eta) {
    CANDELA_ASSIGN(outside, index_of(*ext_eta));
  }
  if (mirror && !ext_eta && find(object, "eta") == nullptr && find(object, "k") == nullptr) return {};
  for (const auto& [part, otherwise] : {std::pair("eta", eta), std::pair("k", k)}) {
    Property* given = find(object, part);
    if (given == nullptr) {
      object.properties.push_back(
          {part, PropertyType::rgb, otherwise, material ? material->where : object.where});
      given = &object.properties.back();
    }
    if (!ext_eta) continue;
    if (const std::optional<double> gray = number_of(*given)) given->value = Rgb{{*gray, *gray, *gray}};
    auto* rgb = std::get_if<Rgb>(&given->value);
    if (rgb == nullptr) return error_at(*given, fmt::format("parameter '{}' must be a spectrum", part));
    given->type = PropertyType::rgb;
    for (double& component : rgb->value) component /= outside;
  }
  return {};
}

// Microfacet distributions of 0.6 that Candela lacks. Their alpha is made to look like Beckmann's.
void upgrade_distribution(Object& object, std::vector<Note>& notes) {
  Property* distribution = find(object, "distribution");
  auto* value = distribution == nullptr ? nullptr : std::get_if<std::string>(&distribution->value);
  if (value == nullptr) return;
  const std::string folded = text::lower(*value);
  if (folded != "phong" && folded != "as") return;
  notes.push_back({distribution->where, fmt::format("the distribution '{}' is read as beckmann of the same "
                                                    "alpha: its highlights have another shape",
                                                    folded)});
  *value = "beckmann";
}

Result<Vec3> color_of(const Property& property) {
  if (const std::optional<double> gray = number_of(property)) return Vec3{*gray, *gray, *gray};
  if (const auto* rgb = std::get_if<Rgb>(&property.value)) return rgb->value;
  return error_at(property, fmt::format("parameter '{}' must be a spectrum", property.name));
}

Result<void> rename(Object& object, std::string_view from, std::string_view to) {
  Property* old = find(object, from);
  if (old == nullptr) return {};
  if (find(object, to) != nullptr)
    return error_at(*old, fmt::format("'{}' and '{}' exclude each other", from, to));
  old->name = std::string(to);
  return {};
}

struct Coefficients {
  Vec3 sigma_s{}, sigma_a{};
  Location where;
};

// The coefficients of a measured medium in 0.6: 100 times those per millimeter, whatever its manual says, and
// with two values of its own. It takes skin1 if nothing is given.
Result<Coefficients> preset_of(const Object& object, const std::optional<Property>& material) {
  constexpr double per_millimeter = 100;
  const Location where = material ? material->where : object.where;
  const std::string* name = material ? std::get_if<std::string>(&material->value) : nullptr;
  if (material && name == nullptr) return error_at(*material, "parameter 'material' must be a string");
  std::optional<MediumPreset> preset = named_medium(name == nullptr ? "skin1" : *name);
  if (!preset) {
    const std::vector<std::string_view> known = medium_names();
    const std::string_view nearest = nearest_name(*name, known);
    return input_error(fmt::format("{} is no medium with measured coefficients", text::quote(*name)))
        .at(where.file, where.line)
        .with_mend(nearest.empty() ? fmt::format("there is {}", text::quoted_list(known))
                                   : text::did_you_mean(nearest));
  }
  const std::string folded = text::lower(name == nullptr ? "skin1" : *name);
  if (folded == "chicken1") preset->sigma_a[0] = 0.0015;
  if (folded == "chicken2") preset->sigma_a[0] = 0.0018;
  Coefficients coefficients{preset->sigma_s, preset->sigma_a, where};
  for (std::size_t c = 0; c < 3; ++c) {
    coefficients.sigma_s[c] *= per_millimeter;
    coefficients.sigma_a[c] *= per_millimeter;
  }
  return coefficients;
}

void set_coefficients(Object& object, const Coefficients& given) {
  Rgb extinction;
  Rgb albedo;
  for (std::size_t c = 0; c < 3; ++c) {
    extinction.value[c] = given.sigma_a[c] + given.sigma_s[c];
    albedo.value[c] = extinction.value[c] > 0 ? given.sigma_s[c] / extinction.value[c] : 0;
  }
  object.properties.push_back({"sigma_t", PropertyType::rgb, extinction, given.where});
  object.properties.push_back({"albedo", PropertyType::rgb, albedo, given.where});
}

// The layer `hk` takes its coefficients as a medium does; they may be textures.
Result<void> upgrade_layer(Object& object, const Slots& slots) {
  const std::optional<Property> material = take(object, "material");
  for (const std::string_view name : {"sigma_s", "sigma_a", "sigma_t", "albedo"})
    if (find(object, name) != nullptr || has(slots, name)) return {};
  CANDELA_ASSIGN(Coefficients preset, preset_of(object, material));
  if (const std::optional<Property> scale = take(object, "scale")) {
    const std::optional<double> factor = number_of(*scale);
    if (!factor || !(*factor >= 0)) return error_at(*scale, "parameter 'scale' must be a float, at least 0");
    for (Vec3* coefficient : {&preset.sigma_s, &preset.sigma_a})
      for (double& component : *coefficient) component *= *factor;
  }
  set_coefficients(object, preset);
  return {};
}

// A medium's `g` is no phase function in 0.6: it reduces the scattering.
Result<void> reduce_scattering(Object& object, const std::optional<Property>& g) {
  if (!g) return {};
  CANDELA_ASSIGN(const Vec3 mean_cosine, color_of(*g));
  const std::optional<Property> extinction = take(object, "sigma_t");
  const std::optional<Property> albedo = take(object, "albedo");
  if (!extinction || !albedo) return error_at(*g, "'g' needs the coefficients of the medium");
  CANDELA_ASSIGN(const Vec3 sigma_t, color_of(*extinction));
  CANDELA_ASSIGN(const Vec3 part, color_of(*albedo));
  Coefficients reduced{{}, {}, g->where};
  for (std::size_t c = 0; c < 3; ++c) {
    if (!(std::abs(mean_cosine[c]) < 1)) return error_at(*g, "parameter 'g' must be within -1 and 1");
    reduced.sigma_s[c] = part[c] * sigma_t[c] * (1 - mean_cosine[c]);
    reduced.sigma_a[c] = (1 - part[c]) * sigma_t[c];
  }
  set_coefficients(object, reduced);
  return {};
}

// Scattering and absorption to extinction and albedo.
Result<void> upgrade_homogeneous(Object& object, const Slots& slots) {
  const std::optional<Property> absorption = take(object, "sigma_a");
  const std::optional<Property> scattering = take(object, "sigma_s");
  const std::optional<Property> material = take(object, "material");
  const std::optional<Property> g = take(object, "g");
  if (!absorption && !scattering) {
    const auto given = [&](std::string_view name) {
      return find(object, name) != nullptr || has(slots, name);
    };
    if (given("sigma_t") && given("albedo")) return reduce_scattering(object, g);
    // The material's, skin1's that is, stands in for one that is absent.
    CANDELA_ASSIGN(const Coefficients preset, preset_of(object, material));
    Object complete;
    set_coefficients(complete, preset);
    for (Property& property : complete.properties)
      if (!given(property.name)) object.properties.push_back(std::move(property));
    return reduce_scattering(object, g);
  }
  // 0.6 prefers the coefficients to a material.
  if (!absorption || !scattering)
    return error_at(absorption ? *absorption : *scattering, "'sigmaA' and 'sigmaS' are only valid together");
  for (const std::string_view other : {"sigma_t", "albedo"})
    if (const Property* property = find(object, other))
      return error_at(*property, fmt::format("'{}' and 'sigmaA', 'sigmaS' exclude each other", other));
  CANDELA_ASSIGN(const Vec3 a, color_of(*absorption));
  CANDELA_ASSIGN(const Vec3 s, color_of(*scattering));
  for (std::size_t c = 0; c < 3; ++c) {
    if (a[c] < 0)
      return error_at(*absorption, fmt::format("parameter 'sigmaA' is {}, but must be at least 0", a[c]));
    if (s[c] < 0)
      return error_at(*scattering, fmt::format("parameter 'sigmaS' is {}, but must be at least 0", s[c]));
  }
  set_coefficients(object, {s, a, absorption->where});
  return reduce_scattering(object, g);
}

Result<void> upgrade_medium(Object& object, const Slots& slots) {
  if (object.plugin == "homogeneous") CANDELA_TRY(upgrade_homogeneous(object, slots));
  CANDELA_TRY(rename(object, "density_multiplier", "scale"));
  // Sampling of free flights and integration of densities: noise and cost, not the mean.
  for (const std::string_view numerics : {"strategy", "method", "step_size", "sampling_weight"})
    take(object, numerics);
  return {};
}

// The grid fills the file's bounding box in 0.6, or that from `min` to `max` if it has both.
Result<void> upgrade_grid(Object& object, std::vector<Note>& notes) {
  const std::optional<Property> low = take(object, "min");
  const std::optional<Property> high = take(object, "max");
  if (low && high) {
    for (const Property& corner : {*low, *high})
      if (!std::holds_alternative<Vec3>(corner.value))
        return error_at(corner, fmt::format("parameter '{}' must be a point", corner.name));
    const Vec3 from = std::get<Vec3>(low->value), to = std::get<Vec3>(high->value);
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (!(to[axis] > from[axis]))
        return error_at(*high, "the box of volume 'gridvolume' is empty: 'max' is not above 'min'");
    const Mat4 box = transform::multiply(
        transform::translate(from), transform::scale({to[0] - from[0], to[1] - from[1], to[2] - from[2]}));
    const std::optional<Property> place = take(object, "to_world");
    if (place && !std::holds_alternative<Mat4>(place->value))
      return error_at(*place, "parameter 'to_world' must be a transform");
    const Mat4 to_world = place ? std::get<Mat4>(place->value) : transform::identity;
    object.properties.push_back(
        {"to_world", PropertyType::transform, transform::multiply(to_world, box), low->where});
    take(object, "use_grid_bbox");
    object.properties.push_back({"use_grid_bbox", PropertyType::boolean, false, low->where});
  }
  if (find(object, "use_grid_bbox") == nullptr)
    object.properties.push_back({"use_grid_bbox", PropertyType::boolean, true, object.where});
  take(object, "send_data");
  notes.push_back({object.where,
                   "volume 'gridvolume': 0.6 has a grid's values at the corners of its cells, here "
                   "they are at the centers, as in Mitsuba 3"});
  return {};
}

// 0.6's `scale` is the default of both scales of a sunsky, and the ground is darker than Mitsuba 3's.
Result<void> upgrade_daylight(Object& object) {
  if (find(object, "albedo") == nullptr)
    object.properties.push_back({"albedo", PropertyType::rgb, Rgb{{0.2, 0.2, 0.2}}, object.where});
  if (object.plugin != "sunsky") return {};
  const std::optional<Property> both = take(object, "scale");
  if (!both) return {};
  if (!number_of(*both)) return error_at(*both, "parameter 'scale' must be a float");
  for (const std::string_view part : {"sun_scale", "sky_scale"}) {
    if (find(object, part) != nullptr) continue;
    object.properties.push_back(*both);
    object.properties.back().name = std::string(part);
  }
  return {};
}

// The check takes a color in the place of a number by its luminance.
void note_colored_opacity(Object& object, std::vector<Note>& notes) {
  const Property* opacity = find(object, "opacity");
  const auto* rgb = opacity == nullptr ? nullptr : std::get_if<Rgb>(&opacity->value);
  if (rgb == nullptr || (rgb->value[0] == rgb->value[1] && rgb->value[1] == rgb->value[2])) return;
  notes.push_back({opacity->where, "a colored opacity counts by its luminance: what passes has no tint"});
}

// Steps of Mitsuba 3.7 beside 0.6's perturbation of the normal.
void keep_plain_bumps(Object& object) {
  for (const std::string_view name : {"flip_invalid_normals", "use_shadowing_function"}) {
    if (find(object, name) == nullptr)
      object.properties.push_back({std::string(name), PropertyType::boolean, false, object.where});
  }
}

}  // namespace

std::string plugin_name(std::string_view category, std::string_view name) {
  if (category == "bsdf" && name == "bump") return "bumpmap";
  if (category == "bsdf" && name == "mixturebsdf") return "blendbsdf";
  if (category == "phase" && name == "mixturephase") return "blendphase";
  if (category == "texture" && name == "vertexcolors") return "mesh_attribute";
  return std::string(name);
}

std::string slot_name(const Object& parent, std::string_view slot) {
  if (is_diffuse(parent) && slot == "diffuse_reflectance") return "reflectance";
  if (parent.category == "medium" && slot == "density") return "sigma_t";
  return std::string(slot);
}

bool is_heeded(const Object& object, std::string_view parameter) {
  return object.category == "medium" && parameter == "orientation";
}

void upgrade_film(Object& object, std::string_view plugin, std::vector<Note>& notes) {
  if (object.category != "film" || (plugin != "ldrfilm" && plugin != "mfilm")) return;
  for (const std::string_view dropped_name :
       {"tonemap_method", "gamma", "exposure", "key", "burn", "digits", "variable"})
    if (const std::optional<Property> dropped = take(object, dropped_name))
      notes.push_back(
          {dropped->where, fmt::format("parameter '{}' of film '{}' is dropped: images stay linear, and PNGs "
                                       "are encoded as sRGB without tone mapping",
                                       dropped_name, plugin)});
  if (plugin != "mfilm") return;
  // A matrix of numbers is one pixel unless the scene says more.
  for (const char* size : {"width", "height"})
    if (find(object, size) == nullptr)
      object.properties.push_back({size, PropertyType::integer, std::int64_t{1}, object.where});
}

Result<void> upgrade(Object& object, const Slots& slots, std::vector<Note>& notes) {
  if (is_diffuse(object)) {
    Property* old = find(object, "diffuse_reflectance");
    if (old != nullptr && find(object, "reflectance") == nullptr) old->name = "reflectance";
  }
  if (object.category == "bsdf" && (object.plugin == "conductor" || object.plugin == "roughconductor"))
    CANDELA_TRY(upgrade_conductor(object));
  if (object.category == "bsdf" && object.plugin == "hk") CANDELA_TRY(upgrade_layer(object, slots));
  if (object.category == "bsdf" && object.plugin.starts_with("rough")) upgrade_distribution(object, notes);
  if (object.category == "bsdf" && (object.plugin == "normalmap" || object.plugin == "bumpmap"))
    keep_plain_bumps(object);
  if (object.category == "bsdf" && object.plugin == "roughplastic" && find(object, "masked_light") == nullptr)
    object.properties.push_back({"masked_light", PropertyType::string, std::string("stays"), object.where});
  if (object.category == "texture" && object.plugin == "mesh_attribute" && find(object, "name") == nullptr)
    object.properties.push_back({"name", PropertyType::string, std::string("vertex_color"), object.where});
  // Colors of vertices are sRGB in 0.6, those in floats too.
  if (object.category == "shape" && object.plugin == "ply" && find(object, "srgb") == nullptr)
    object.properties.push_back({"srgb", PropertyType::boolean, true, object.where});
  if (object.category == "texture") CANDELA_TRY(merge_uv_parameters(object));
  if (object.category == "texture" && object.plugin == "bitmap") CANDELA_TRY(upgrade_bitmap(object, notes));
  if (object.category == "bsdf" && object.plugin == "mask") note_colored_opacity(object, notes);
  if (object.category == "medium") CANDELA_TRY(upgrade_medium(object, slots));
  if (object.category == "volume" && object.plugin == "gridvolume") CANDELA_TRY(upgrade_grid(object, notes));
  if (object.category == "emitter" && (object.plugin == "sky" || object.plugin == "sunsky"))
    CANDELA_TRY(upgrade_daylight(object));
  // Parameters whose capitals are their names.
  if (object.category == "rfilter" && object.plugin == "mitchell")
    for (Property& property : object.properties)
      if (property.name == "b" || property.name == "c") property.name = property.name == "b" ? "B" : "C";
  return {};
}

}  // namespace candela::description::legacy
