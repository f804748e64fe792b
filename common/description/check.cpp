#include "common/description/check.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/description/film_window.h"
#include "common/description/text.h"
#include "common/description/transform.h"

namespace candela::description {
namespace {

bool accepts(const PropertyRule& rule, PropertyType type) {
  for (const PropertyType accepted : rule.types) {
    if (accepted == type) return true;
    if (accepted == PropertyType::number && type == PropertyType::integer) return true;
    if (accepted == PropertyType::rgb && (type == PropertyType::number || type == PropertyType::integer))
      return true;
    if (accepted == PropertyType::point && type == PropertyType::vector) return true;
    if (accepted == PropertyType::vector && type == PropertyType::point) return true;
  }
  return false;
}

std::string accepted_types(const PropertyRule& rule) {
  std::string result;
  for (const PropertyType type : rule.types)
    result += fmt::format("{}<{}>", result.empty() ? "" : " or ", name(type));
  if (rule.textured) result += result.empty() ? "a <texture>" : " or <texture>";
  return result;
}

std::string article(std::string_view noun) {
  constexpr std::string_view vowels = "aeiou";
  return fmt::format("{} {}", vowels.find(noun.front()) != std::string_view::npos ? "an" : "a", noun);
}

std::string names_of(const PluginRule& rule) {
  const std::vector<std::string_view> names = property_names(rule);
  return names.empty() ? "it has none" : fmt::format("it has {}", text::quoted_list(names));
}

// Any number the property holds, for bounds.
std::vector<double> numbers_of(const Property& property) {
  if (const auto* integer = std::get_if<std::int64_t>(&property.value))
    return {static_cast<double>(*integer)};
  if (const auto* number = std::get_if<double>(&property.value)) return {*number};
  if (const auto* rgb = std::get_if<Rgb>(&property.value)) return {rgb->value.begin(), rgb->value.end()};
  return {};
}

Result<void> check_bounds(const Property& property, const PropertyRule& rule) {
  for (const double value : numbers_of(property)) {
    if (rule.above_minimum ? !(value > rule.minimum) : !(value >= rule.minimum))
      return error_at(property.where, fmt::format("parameter '{}' is {}, but must be {} {}", rule.name, value,
                                                  rule.above_minimum ? "above" : "at least", rule.minimum));
    if (!(value <= rule.maximum))
      return error_at(property.where, fmt::format("parameter '{}' is {}, but must be at most {}", rule.name,
                                                  value, rule.maximum));
  }
  return {};
}

// The value a parameter is restricted to for now, compared as what it is.
bool is_only_value(const Property& property, std::string_view only) {
  if (const auto* flag = std::get_if<bool>(&property.value)) return text::to_boolean(only) == *flag;
  if (const auto* integer = std::get_if<std::int64_t>(&property.value))
    return text::to_number(only) == static_cast<double>(*integer);
  if (const auto* number = std::get_if<double>(&property.value)) return text::to_number(only) == *number;
  if (const auto* string = std::get_if<std::string>(&property.value)) return *string == only;
  return false;
}

bool is_index_of_refraction(const PropertyRule& rule) {
  return rule.name == "int_ior" || rule.name == "ext_ior";
}

// A color where a number or a texture is expected counts by its luminance, as a texture does there.
void take_luminance(Property& property, const PropertyRule& rule) {
  const auto* rgb = std::get_if<Rgb>(&property.value);
  if (rgb == nullptr || !rule.textured || accepts(rule, PropertyType::rgb) ||
      !accepts(rule, PropertyType::number))
    return;
  const auto& [r, g, b] = rgb->value;
  const double luminance = r == g && g == b ? r : 0.212671 * r + 0.715160 * g + 0.072169 * b;
  property.type = PropertyType::number;
  property.value = luminance;
}

Result<void> exclude(const Object& object, std::string_view a, std::string_view b) {
  const Property* first = object.find(a);
  const Property* second = object.find(b);
  if (first == nullptr || second == nullptr) return {};
  return error_at(second->where, fmt::format("{} has both '{}' and '{}'", describe(object), a, b))
      .with_mend("leave one of them out");
}

// The frame of a light that turns and places it must not change its cone or picture.
Result<void> check_light_frame(const Object& object) {
  const Property* to_world = object.find("to_world");
  const auto* matrix = to_world == nullptr ? nullptr : std::get_if<Mat4>(&to_world->value);
  if (matrix == nullptr || transform::is_similarity(*matrix)) return {};
  return error_at(object.where,
                  fmt::format("the to_world of a {} light must not shear, stretch or flatten", object.plugin))
      .with_field("to_world");
}

Result<void> check_gamma(const Object& object) {
  const Property* gamma = object.find("gamma");
  const double value = object.get_number("gamma", 0);
  if (gamma == nullptr || value == -1 || value >= 0) return {};
  return error_at(gamma->where, "gamma is above 0, or -1 for sRGB, or 0 for what the file means");
}

Result<void> check_combinations(const Object& object) {
  if (object.category == "emitter" && is_rigid_light(object)) CANDELA_TRY(check_light_frame(object));
  if (object.category == "texture" && object.plugin == "bitmap") CANDELA_TRY(check_gamma(object));
  if (object.plugin == "spot" && object.category == "emitter") {
    const double cutoff = object.get_number("cutoff_angle", 20);
    const Property* beam = object.find("beam_width");
    if (beam != nullptr && object.get_number("beam_width", 0) > cutoff)
      return error_at(beam->where, fmt::format("parameter 'beam_width' is beyond cutoff_angle, {}", cutoff));
  }
  if (object.plugin == "projector") {
    CANDELA_TRY(exclude(object, "fov", "focal_length"));
    CANDELA_TRY(check_focal_length(object));
  }
  if (object.plugin == "perspective") {
    CANDELA_TRY(exclude(object, "fov", "focal_length"));
    CANDELA_TRY(check_focal_length(object));
    const double near_clip = object.get_number("near_clip", 0.01);
    const double far_clip = object.get_number("far_clip", 10000);
    if (!(far_clip > near_clip))
      return error_at(object.where,
                      fmt::format("far_clip {} is not beyond near_clip {}", far_clip, near_clip));
  }
  if (object.category == "film") {
    const FilmWindow window = film_window(object);
    if (!window.fits())
      return error_at(
                 object.where,
                 fmt::format("the crop window, {} x {} pixels at {}, {}, is not within the film's {} x {}",
                             window.width, window.height, window.x, window.y, window.film_width,
                             window.film_height))
          .with_mend("make the window smaller, or leave the crop parameters out");
  }
  if (object.plugin == "principled") CANDELA_TRY(exclude(object, "eta", "specular"));
  if (object.plugin == "sunsky") CANDELA_TRY(exclude(object, "sun_radius_scale", "sun_aperture"));
  if (object.category == "emitter") {
    CANDELA_TRY(exclude(object, "to_world", "position"));
    CANDELA_TRY(exclude(object, "to_world", "direction"));
    const Property* direction = object.find("direction");
    if (direction != nullptr && std::get<Vec3>(direction->value) == Vec3{0, 0, 0})
      return error_at(direction->where, "parameter 'direction' has no length");
  }
  return {};
}

// A texture needs the name of a parameter that takes one.
Result<void> check_texture(const Object& object, const PluginRule& rule, const Child& child,
                           const Location& where) {
  const auto any = std::find_if(rule.properties.begin(), rule.properties.end(),
                                [](const PropertyRule& property) { return property.any_slot; });
  if (any != rule.properties.end() && (child.slot == any->name || find_rule(rule, child.slot) == nullptr)) {
    const auto other = [&](const Child& c) { return c.object->category == "texture" && &c != &child; };
    if (std::any_of(object.children.begin(), object.children.end(), other))
      return error_at(where, fmt::format("{} has more than one texture", describe(object)));
    return {};
  }
  if (child.slot.empty()) {
    std::vector<std::string_view> slots;
    for (const PropertyRule& property : rule.properties)
      if (property.textured) slots.push_back(property.name);
    if (slots.empty()) return error_at(where, fmt::format("{} takes no texture", describe(object)));
    return error_at(where, fmt::format("a texture of {} needs a name", describe(object)))
        .with_mend(fmt::format("it takes {}", text::quoted_list(slots)));
  }
  const PropertyRule* slot = find_rule(rule, child.slot);
  if (slot == nullptr) return unknown_parameter(object, rule, where, child.slot);
  if (!slot->textured)
    return error_at(where, fmt::format("a texture as parameter '{}' of {} is not supported", slot->name,
                                       describe(object)));
  const auto same = [&](const Child& other) { return other.slot == child.slot && &other != &child; };
  if (object.find(child.slot) != nullptr || std::any_of(object.children.begin(), object.children.end(), same))
    return error_at(where, fmt::format("parameter '{}' of {} is given twice", child.slot, describe(object)));
  return {};
}

Result<void> at_most_one(const Object& object, std::string_view category, std::span<const Location> where) {
  bool seen = false;
  for (std::size_t i = 0; i < object.children.size(); ++i) {
    if (object.children[i].object->category != category) continue;
    if (seen) return error_at(where[i], fmt::format("{} has more than one {}", describe(object), category));
    seen = true;
  }
  return {};
}

Result<void> check_twosided(const Object& object, std::span<const Location> where) {
  if (object.children.empty() || object.children.size() > 2)
    return error_at(object.where,
                    fmt::format("bsdf 'twosided' needs one or two bsdfs, not {}", object.children.size()));
  for (std::size_t i = 0; i < object.children.size(); ++i) {
    const std::string& inner = object.children[i].object->plugin;
    if (inner == "dielectric")
      return error_at(where[i], "bsdf 'dielectric' transmits light, so it cannot be inside 'twosided'")
          .with_mend("use it without 'twosided'");
    if (inner == "twosided") return error_at(where[i], "bsdf 'twosided' cannot be inside another 'twosided'");
  }
  return {};
}

// A bump or normal map somewhere in a bsdf.
const Object* find_map(const Object& object) {
  if (object.plugin == "bumpmap" || object.plugin == "normalmap") return &object;
  for (const ObjectPtr& child : object.children_of("bsdf"))
    if (const Object* found = find_map(*child)) return found;
  return nullptr;
}

// Bsdfs that hold a fixed number of others.
Result<void> check_composite(const Object& object) {
  const std::size_t wanted = object.plugin == "blendbsdf" ? 2 : 1;
  const std::vector<ObjectPtr> inner = object.children_of("bsdf");
  if (inner.size() != wanted)
    return error_at(object.where, fmt::format("{} needs {}, not {}", describe(object),
                                              wanted == 1 ? "one bsdf" : "two bsdfs", inner.size()));
  if (object.plugin != "bumpmap" && object.plugin != "normalmap") return {};
  if (const Object* map = find_map(*inner[0]))
    return error_at(map->where,
                    fmt::format("{} inside {} is not supported", describe(*map), describe(object)));
  return {};
}

// Roughness may be a property or a texture.
Result<void> check_roughness(const Object& object) {
  const auto given = [&](std::string_view name) {
    return object.find(name) != nullptr || object.find_child(name) != nullptr;
  };
  if (given("alpha_u") != given("alpha_v"))
    return error_at(object.where, "'alpha_u' and 'alpha_v' are only valid together");
  if (given("alpha") && given("alpha_u"))
    return error_at(object.where, fmt::format("{} has both 'alpha' and 'alpha_u'", describe(object)))
        .with_mend("leave one of them out");
  return {};
}

Result<void> check_blend_phase(const Object& object) {
  const std::size_t parts = object.children_of("phase").size();
  if (parts != 2)
    return error_at(object.where,
                    fmt::format("{} needs two phase functions, not {}", describe(object), parts));
  return {};
}

Result<void> check_volume_texture(const Object& object, std::span<const Location> where) {
  for (std::size_t i = 0; i < object.children.size(); ++i)
    if (object.children[i].slot != "volume")
      return error_at(where[i], fmt::format("{} has no volume {}", describe(object),
                                            text::quote(object.children[i].slot)))
          .with_mend("name it 'volume'");
  if (object.children.size() + (object.find("volume") != nullptr ? 1 : 0) > 1)
    return error_at(object.where, fmt::format("parameter 'volume' of {} is given twice", describe(object)));
  return {};
}

// Volumes stand in for parameters of their medium, one each.
Result<void> check_medium(const Object& object, std::span<const Location> where) {
  CANDELA_TRY(at_most_one(object, "phase", where));
  for (std::size_t i = 0; i < object.children.size(); ++i) {
    const Child& child = object.children[i];
    if (child.object->category != "volume") continue;
    if (child.slot != "albedo" && child.slot != "sigma_t")
      return error_at(where[i], fmt::format("{} has no volume {}", describe(object), text::quote(child.slot)))
          .with_mend("name it 'albedo' or 'sigma_t'");
    if (object.plugin == "homogeneous" && child.slot == "sigma_t" && child.object->plugin != "constvolume")
      return error_at(where[i], "the 'sigma_t' of a homogeneous medium cannot vary")
          .with_mend("use medium 'heterogeneous'");
    const auto same = [&](const Child& other) { return other.slot == child.slot && &other != &child; };
    if (object.find(child.slot) != nullptr ||
        std::any_of(object.children.begin(), object.children.end(), same))
      return error_at(where[i],
                      fmt::format("parameter '{}' of {} is given twice", child.slot, describe(object)));
  }
  return {};
}

// The two sides of a shape.
Result<void> check_interface(const Object& object, std::span<const Location> where) {
  for (std::size_t i = 0; i < object.children.size(); ++i) {
    const Child& child = object.children[i];
    if (child.object->category != "medium") continue;
    if (child.slot != "interior" && child.slot != "exterior")
      return error_at(where[i], fmt::format("a medium of {} needs a name", describe(object)))
          .with_mend("name it 'interior' or 'exterior'");
    const auto same = [&](const Child& other) {
      return &other != &child && other.slot == child.slot && other.object->category == "medium";
    };
    if (std::any_of(object.children.begin(), object.children.end(), same))
      return error_at(where[i], fmt::format("{} has more than one {} medium", describe(object), child.slot));
  }
  return {};
}

// The first texture at or below `object` that looks at more of a surface than (u, v).
const Object* find_place_texture(const Object& object) {
  if (object.plugin == "wireframe" || object.plugin == "mesh_attribute" || object.plugin == "volume")
    return &object;
  for (const ObjectPtr& child : object.children_of("texture"))
    if (const Object* found = find_place_texture(*child)) return found;
  return nullptr;
}

// Heights come from a file or from a texture, which is looked at before there is a surface.
Result<void> check_heightfield(const Object& object) {
  const std::vector<ObjectPtr> textures = object.children_of("texture");
  const bool has_file = object.find("filename") != nullptr;
  if (has_file && !textures.empty())
    return error_at(object.where, fmt::format("{} has both 'filename' and a texture", describe(object)))
        .with_mend("leave one of them out");
  if (!has_file && textures.empty())
    return error_at(object.where, fmt::format("{} has neither 'filename' nor a texture", describe(object)));
  for (const ObjectPtr& texture : textures)
    if (const Object* found = find_place_texture(*texture))
      return error_at(found->where, fmt::format("{} cannot give heights: it looks at the surface itself",
                                                describe(*found)));
  return {};
}

// A shapegroup's shapes neither glow nor hold others; an instance shows one shapegroup.
Result<void> check_instancing(const Object& object, std::span<const Location> where) {
  std::size_t groups = 0;
  for (std::size_t i = 0; i < object.children.size(); ++i) {
    const Object& child = *object.children[i].object;
    if (child.category != "shape") continue;
    if (object.plugin == "instance") {
      if (child.plugin != "shapegroup")
        return error_at(where[i], fmt::format("an instance is of a shapegroup, not of {}", describe(child)))
            .with_mend("put the shape into a shapegroup");
      if (++groups > 1) return error_at(where[i], "the instance has more than one shapegroup");
      continue;
    }
    if (child.plugin == "shapegroup" || child.plugin == "instance")
      return error_at(where[i], fmt::format("{} cannot be inside a shapegroup", describe(child)));
    const auto glows = [](const Child& c) { return c.object->category == "emitter"; };
    if (std::any_of(child.children.begin(), child.children.end(), glows))
      return error_at(where[i], "a shape inside a shapegroup cannot be an emitter")
          .with_mend("take it out of the shapegroup");
  }
  if (object.plugin == "instance" && groups == 0)
    return error_at(object.where, "the instance has no shapegroup")
        .with_mend("refer to one by <ref id=\"...\"/>");
  if (object.plugin == "shapegroup" && object.children.empty())
    return error_at(object.where, "the shapegroup has no shapes");
  return {};
}

Result<void> check_scene(const Object& object, std::span<const Location> where) {
  CANDELA_TRY(at_most_one(object, "integrator", where));
  bool environment = false;
  for (std::size_t i = 0; i < object.children.size(); ++i) {
    const Object& child = *object.children[i].object;
    if (child.category == "sensor" && child.plugin == "irradiancemeter" && child.children_of("shape").empty())
      return error_at(where[i], "sensor 'irradiancemeter' is in no shape")
          .with_mend("put it into the shape on which it measures");
    if (child.category != "emitter") continue;
    if (child.plugin != "constant" && child.plugin != "envmap") continue;
    if (environment) return error_at(where[i], "the scene has more than one environment emitter");
    environment = true;
  }
  return {};
}

}  // namespace

bool is_rigid_light(const Object& object) {
  return object.plugin == "spot" || object.plugin == "projector" || object.plugin == "goniometric";
}

Result<void> check_focal_length(const Object& object) {
  const Property* focal = object.find("focal_length");
  if (focal == nullptr || !std::holds_alternative<std::string>(focal->value)) return {};
  std::string_view value = std::get<std::string>(focal->value);
  if (value.ends_with("mm")) value.remove_suffix(2);
  const std::optional<double> length = text::to_number(value);
  if (!length || !(*length > 0))
    return error_at(focal->where,
                    fmt::format("{} is not a focal length", text::quote(std::get<std::string>(focal->value))))
        .with_mend("write millimeters, such as '50mm'");
  return {};
}

const PropertyRule* find_rule(const PluginRule& plugin, std::string_view name) {
  for (const PropertyRule& rule : plugin.properties)
    if (rule.name == name) return &rule;
  return nullptr;
}

Error unknown_parameter(const Object& object, const PluginRule& rule, const Location& where,
                        std::string_view name) {
  const std::vector<std::string_view> names = property_names(rule);
  const std::string_view nearest = nearest_name(name, names);
  return error_at(where, fmt::format("{} has no parameter {}", describe(object), text::quote(name)))
      .with_mend(nearest.empty() ? names_of(rule) : text::did_you_mean(nearest));
}

Result<void> check_property(Property& property, const PropertyRule& rule) {
  take_luminance(property, rule);
  if (!accepts(rule, property.type))
    return error_at(property.where, fmt::format("parameter '{}' is {}, but must be {}", rule.name,
                                                article(name(property.type)), accepted_types(rule)));
  if (!rule.only.empty() && !is_only_value(property, rule.only))
    return error_at(
        property.where,
        fmt::format("parameter '{}' is not supported yet with a value other than {}", rule.name, rule.only));
  if (auto* string = std::get_if<std::string>(&property.value)) {
    if (!rule.values.empty()) {
      const std::string folded = text::lower(*string);
      if (std::find(rule.values.begin(), rule.values.end(), folded) == rule.values.end()) {
        const std::string_view nearest = nearest_name(*string, rule.values);
        Error error = error_at(property.where, fmt::format("{} is not a value of parameter '{}'",
                                                           text::quote(*string), rule.name));
        return std::move(error).with_mend(nearest.empty()
                                              ? fmt::format("there is {}", text::quoted_list(rule.values))
                                              : text::did_you_mean(nearest));
      }
      *string = folded;
    } else if (is_index_of_refraction(rule)) {
      const std::optional<double> index = named_index_of_refraction(*string);
      if (!index) {
        const std::vector<std::string_view> known = index_of_refraction_names();
        const std::string_view nearest = nearest_name(*string, known);
        return error_at(property.where, fmt::format("{} is not a material with a known index of refraction",
                                                    text::quote(*string)))
            .with_mend(nearest.empty() ? fmt::format("there is {}", text::quoted_list(known))
                                       : text::did_you_mean(nearest));
      }
      property.type = PropertyType::number;
      property.value = *index;
    }
  }
  return check_bounds(property, rule);
}

bool is_for_unknown_parameter(const Object& object, const PluginRule& rule, const Child& child) {
  if (child.slot.empty()) return false;
  const auto& children = rule.child_categories;
  const bool as_child = std::find(children.begin(), children.end(), child.object->category) != children.end();
  if (object.category == "medium" && child.object->category == "volume")
    return child.slot != "albedo" && child.slot != "sigma_t";
  if (child.object->category != "texture" || as_child) return false;
  const auto any = [](const PropertyRule& property) { return property.any_slot; };
  return find_rule(rule, child.slot) == nullptr &&
         std::none_of(rule.properties.begin(), rule.properties.end(), any);
}

bool is_unfit_texture(const Object& object, const PluginRule& rule, const Child& child) {
  const auto& children = rule.child_categories;
  if (child.object->category != "texture" || child.slot.empty() ||
      std::find(children.begin(), children.end(), "texture") != children.end())
    return false;
  const PropertyRule* slot = find_rule(rule, child.slot);
  if (slot == nullptr) return false;
  return !slot->textured || object.find(child.slot) != nullptr || object.find_child(child.slot) != nullptr;
}

std::string describe(const Object& object) {
  if (object.category == "scene") return "the scene";
  return fmt::format("{} {}", object.category, text::quote(object.plugin));
}

Result<void> check_properties(Object& object, const PluginRule& rule) {
  for (Property& property : object.properties) {
    const PropertyRule* property_rule = find_rule(rule, property.name);
    if (property_rule == nullptr) return unknown_parameter(object, rule, property.where, property.name);
    CANDELA_TRY(check_property(property, *property_rule));
  }
  return check_combinations(object);
}

Result<void> check_children(const Object& object, const PluginRule& rule, std::span<const Location> where) {
  for (std::size_t i = 0; i < object.children.size(); ++i) {
    const Child& child = object.children[i];
    const std::string& category = child.object->category;
    const bool as_child = std::find(rule.child_categories.begin(), rule.child_categories.end(), category) !=
                          rule.child_categories.end();
    if (category == "texture" && !as_child) {
      CANDELA_TRY(check_texture(object, rule, child, where[i]));
    } else if (!as_child) {
      return error_at(where[i],
                      fmt::format("{} cannot be inside {}", describe(*child.object), describe(object)));
    }
  }
  for (const PropertyRule& property : rule.properties)
    if (property.required && !property.any_slot && object.find(property.name) == nullptr &&
        object.find_child(property.name) == nullptr)
      return error_at(object.where,
                      fmt::format("{} lacks the parameter '{}'", describe(object), property.name));

  for (const PropertyRule& property : rule.properties)
    if (property.required && property.any_slot &&
        std::none_of(object.children.begin(), object.children.end(),
                     [](const Child& c) { return c.object->category == "texture"; }))
      return error_at(object.where, fmt::format("{} lacks a texture", describe(object)));

  if (object.category == "scene") return check_scene(object, where);
  if (object.plugin == "twosided") return check_twosided(object, where);
  if (object.plugin == "roughconductor" || object.plugin == "roughdielectric") return check_roughness(object);
  if (object.category == "bsdf" && std::find(rule.child_categories.begin(), rule.child_categories.end(),
                                             "bsdf") != rule.child_categories.end())
    return check_composite(object);
  if (object.category == "texture" && object.plugin == "scale" && object.children.size() != 1)
    return error_at(object.where,
                    fmt::format("texture 'scale' holds one texture, not {}", object.children.size()));
  if (object.category == "texture" && object.plugin == "volume") return check_volume_texture(object, where);
  if (object.plugin == "blendphase") return check_blend_phase(object);
  if (object.category == "medium") return check_medium(object, where);
  if (object.category == "sensor" || object.category == "emitter")
    CANDELA_TRY(at_most_one(object, "medium", where));
  if (object.plugin == "distant" && object.category == "sensor") {
    CANDELA_TRY(at_most_one(object, "shape", where));
    if (object.find("target") != nullptr && !object.children_of("shape").empty())
      return error_at(object.where, "sensor 'distant' has two targets");
    CANDELA_TRY(exclude(object, "to_world", "direction"));
  }
  if (object.category == "shape") {
    if (object.plugin == "shapegroup" || object.plugin == "instance") return check_instancing(object, where);
    CANDELA_TRY(check_interface(object, where));
    if (object.plugin == "heightfield") CANDELA_TRY(check_heightfield(object));
    // Parts of an OBJ file have bsdfs by the names of their materials.
    if (object.plugin != "obj" || object.get_bool("collapse", true))
      CANDELA_TRY(at_most_one(object, "bsdf", where));
    CANDELA_TRY(at_most_one(object, "emitter", where));
    for (std::size_t i = 0; i < object.children.size(); ++i) {
      const Object& child = *object.children[i].object;
      if (child.category == "emitter" && child.plugin != "area")
        return error_at(where[i], fmt::format("{} cannot be inside a shape", describe(child)))
            .with_mend("move it out, or use emitter 'area'");
    }
  }
  CANDELA_TRY(at_most_one(object, "film", where));
  CANDELA_TRY(at_most_one(object, "sampler", where));
  return at_most_one(object, "rfilter", where);
}

}  // namespace candela::description
