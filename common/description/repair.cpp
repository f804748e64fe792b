#include "common/description/repair.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "common/description/check.h"
#include "common/description/conductors.h"
#include "common/description/film_window.h"
#include "common/description/resolve.h"
#include "common/description/text.h"
#include "common/description/transform.h"

namespace candela::description::repair {
namespace {

bool takes(const PropertyRule& rule, PropertyType type) {
  return std::find(rule.types.begin(), rule.types.end(), type) != rule.types.end();
}

// Numbers above a bound that is excluded begin here.
double lowest(const PropertyRule& rule) {
  return rule.above_minimum ? rule.minimum + 1e-6 * std::max(1.0, std::abs(rule.minimum)) : rule.minimum;
}

double clamped(double value, const PropertyRule& rule) {
  return std::clamp(value, lowest(rule), std::max(lowest(rule), rule.maximum));
}

// A color keeps its hue: 0.6 scales reflectances above 1 in the same way.
Rgb clamped(Rgb color, const PropertyRule& rule) {
  double most = 0;
  for (double& component : color.value) {
    component = std::max(component, lowest(rule));
    most = std::max(most, component);
  }
  if (most > rule.maximum && rule.maximum > 0)
    for (double& component : color.value)
      component = std::max(component * (rule.maximum / most), lowest(rule));
  return color;
}

std::optional<double> as_number(const Property& property) {
  if (const auto* number = std::get_if<double>(&property.value)) return *number;
  if (const auto* integer = std::get_if<std::int64_t>(&property.value)) return static_cast<double>(*integer);
  if (const auto* string = std::get_if<std::string>(&property.value)) return text::to_number(*string);
  if (const auto* rgb = std::get_if<Rgb>(&property.value))
    return 0.212671 * rgb->value[0] + 0.715160 * rgb->value[1] + 0.072169 * rgb->value[2];
  return std::nullopt;
}

// The property with the nearest value of a type that the rule has.
std::optional<Property> nearest(Property property, const PropertyRule& rule) {
  constexpr double exact = 9007199254740992;  // beyond it a double holds no odd integers
  if (auto* color = std::get_if<Rgb>(&property.value); color != nullptr && takes(rule, PropertyType::rgb)) {
    *color = clamped(*color, rule);
    return property;
  }
  const std::optional<double> number = as_number(property);
  if (!number) return std::nullopt;
  if (takes(rule, PropertyType::number) || takes(rule, PropertyType::rgb)) {
    property.type = PropertyType::number;
    property.value = clamped(*number, rule);
  } else if (takes(rule, PropertyType::integer)) {
    const double whole = std::round(clamped(*number, rule));
    if (!(std::abs(whole) <= exact)) return std::nullopt;
    property.type = PropertyType::integer;
    property.value = static_cast<std::int64_t>(whole);
  } else {
    return std::nullopt;
  }
  return property;
}

std::string shown(const Property& property) {
  if (const auto* integer = std::get_if<std::int64_t>(&property.value)) return fmt::format("{}", *integer);
  if (const auto* number = std::get_if<double>(&property.value)) return fmt::format("{}", *number);
  const Vec3& color = std::get<Rgb>(property.value).value;
  return fmt::format("{:.4g}, {:.4g}, {:.4g}", color[0], color[1], color[2]);
}

// Removes a crop window that is not within the film, which is rendered whole then.
void drop_crop(Object& film, std::vector<Note>& passed_over) {
  constexpr std::array<std::string_view, 4> crop = {"crop_offset_x", "crop_offset_y", "crop_width",
                                                    "crop_height"};
  const auto is_crop = [&](const Property& property) {
    return std::find(crop.begin(), crop.end(), property.name) != crop.end();
  };
  const auto first = std::find_if(film.properties.begin(), film.properties.end(), is_crop);
  if (first == film.properties.end()) return;
  Object sizes;  // without properties of other types, which are dropped one by one later
  for (const Property& property : film.properties)
    if (std::holds_alternative<std::int64_t>(property.value)) sizes.properties.push_back(property);
  if (film_window(sizes).fits()) return;
  passed_over.push_back({first->where, fmt::format("{}: the crop window is not within the film: the whole "
                                                   "film is rendered",
                                                   describe(film))});
  std::erase_if(film.properties, is_crop);
}

// A spot is dark beyond its cutoff, however wide its beam is.
void narrow_beam(Object& spot, std::vector<Note>& passed_over) {
  const auto value = [&](std::string_view name, double otherwise) {
    const Property* property = spot.find(name);
    return property == nullptr ? otherwise : as_number(*property).value_or(otherwise);
  };
  const double cutoff = value("cutoff_angle", 20);
  if (!(value("beam_width", 0) > cutoff)) return;
  for (Property& property : spot.properties) {
    if (property.name != "beam_width") continue;
    passed_over.push_back(
        {property.where, fmt::format("parameter 'beam_width' is beyond cutoff_angle, {}: {} is "
                                     "taken",
                                     cutoff, cutoff)});
    property.type = PropertyType::number;
    property.value = cutoff;
  }
}

// Gives the property the nearest value that the rule accepts. False: it accepts the value as it is, or none
// is near.
bool clamp_to(const PropertyRule& rule, Property& property, std::vector<Note>& passed_over) {
  const Result<void> fits = check_property(property, rule);
  if (fits.ok()) return false;
  std::optional<Property> mended = nearest(property, rule);
  if (!mended || !check_property(*mended, rule).ok()) return false;
  passed_over.push_back(
      {property.where, fmt::format("{}: {} is taken", fits.error().message, shown(*mended))});
  property = std::move(*mended);
  return true;
}

// Negative weights of a mixture become 0.
void raise_weights(Property& property, std::vector<Note>& passed_over) {
  auto* words = property.name == "weights" ? std::get_if<std::string>(&property.value) : nullptr;
  if (words == nullptr) return;
  std::string raised;
  bool any = false;
  for (const std::string_view word : text::tokens(*words)) {
    const std::optional<double> weight = text::to_number(word);
    const bool negative = weight && *weight < 0;
    raised += fmt::format("{}{}", raised.empty() ? "" : ", ", negative ? "0" : word);
    any = any || negative;
  }
  if (!any) return;
  passed_over.push_back(
      {property.where, fmt::format("a weight in {} is negative: 0 is taken", text::quote(*words))});
  *words = std::move(raised);
}

// Between -1, sRGB, and 0, as the file means, a gamma means nothing.
void round_gamma(Object& bitmap, std::vector<Note>& passed_over) {
  for (Property& property : bitmap.properties) {
    const std::optional<double> gamma = property.name == "gamma" ? as_number(property) : std::nullopt;
    if (!gamma || !(*gamma > -1 && *gamma < 0)) continue;
    const double nearest = *gamma < -0.5 ? -1 : 0;
    passed_over.push_back(
        {property.where, fmt::format("a gamma of {} means nothing: {} is taken", *gamma, nearest)});
    property.type = PropertyType::number;
    property.value = nearest;
  }
}

// Clipping planes of which the far one is not beyond the near one are dropped; so is a bad focal length.
void open_camera(Object& camera, std::vector<Note>& passed_over) {
  const auto drop = [&](std::string_view name, std::string_view why) {
    std::erase_if(camera.properties, [&](const Property& property) {
      if (property.name != name) return false;
      passed_over.push_back(
          {property.where, fmt::format("parameter '{}' {}: the default is taken", name, why)});
      return true;
    });
  };
  const auto value = [&](std::string_view name, double otherwise) {
    const Property* property = camera.find(name);
    return property == nullptr ? otherwise : as_number(*property).value_or(otherwise);
  };
  if (!(value("far_clip", 10000) > value("near_clip", 0.01))) drop("far_clip", "is not beyond near_clip");
  if (!(value("far_clip", 10000) > value("near_clip", 0.01))) drop("near_clip", "is beyond far_clip");
  if (!check_focal_length(camera).ok()) drop("focal_length", "is no focal length");
}

// A light that to_world shears or stretches keeps its place, its axis and, as far as it can, its turn about
// that.
void straighten(Object& light, std::vector<Note>& passed_over) {
  for (Property& property : light.properties) {
    auto* matrix = property.name == "to_world" ? std::get_if<Mat4>(&property.value) : nullptr;
    if (matrix == nullptr || transform::is_similarity(*matrix)) continue;
    const std::optional<Mat4> rigid = transform::without_shear(*matrix);
    if (!rigid) continue;
    passed_over.push_back(
        {property.where,
         fmt::format("the to_world of {} shears or stretches it: its axis counts", describe(light))});
    *matrix = *rigid;
  }
}

}  // namespace

Element srgb(Element element, std::vector<Note>& passed_over) {
  if (element.name != "srgb") return element;
  for (auto& [attribute, value] : element.attributes) {
    if (attribute != "value") continue;
    std::string clamped;
    bool any = false;
    for (const std::string_view word : text::tokens(value)) {
      const std::optional<double> number = text::to_number(word);
      const bool outside = number && !(*number >= 0 && *number <= 1);
      clamped += fmt::format("{}{}", clamped.empty() ? "" : " ", outside ? (*number > 1 ? "1" : "0") : word);
      any = any || outside;
    }
    if (!any) continue;
    passed_over.push_back({element.where, fmt::format("<srgb> values are between 0 and 1: {} is taken for {}",
                                                      clamped, text::quote(value))});
    value = std::move(clamped);
  }
  return element;
}

void old_numbers(Object& object, std::vector<Note>& passed_over) {
  struct Bounds {
    std::string_view name;
    double minimum, maximum;
  };
  constexpr double far = std::numeric_limits<double>::infinity();
  constexpr std::array<Bounds, 5> of_media = {{{"sigma_a", 0, far},
                                               {"sigma_s", 0, far},
                                               {"sigma_t", 0, far},
                                               {"scale", 0, far},
                                               {"g", -0.99999, 0.99999}}};
  constexpr std::array<Bounds, 1> of_metals = {{{"ext_eta", 1e-6, far}}};
  std::span<const Bounds> bounds;
  if (object.category == "medium" || object.plugin == "hk") bounds = of_media;
  if (object.plugin == "conductor" || object.plugin == "roughconductor") bounds = of_metals;
  for (const Bounds& bound : bounds)
    for (Property& property : object.properties) {
      if (property.name != bound.name) continue;
      const PropertyRule rule = {.name = bound.name,
                                 .types = {PropertyType::number, PropertyType::rgb},
                                 .minimum = bound.minimum,
                                 .maximum = bound.maximum};
      clamp_to(rule, property, passed_over);
    }
  if (object.category == "texture") {
    constexpr double least = 1e-6;
    for (Property& property : object.properties) {
      const bool scales =
          property.name == "uscale" || property.name == "vscale" || property.name == "uvscale";
      if (!scales || as_number(property).value_or(1) != 0) continue;
      passed_over.push_back(
          {property.where, fmt::format("'{}' must not be 0: {} is taken", property.name, least)});
      property.type = PropertyType::number;
      property.value = least;
    }
  }
  if (object.plugin == "blendbsdf" || object.plugin == "blendphase")
    for (Property& property : object.properties) raise_weights(property, passed_over);
}

void properties(Object& object, const PluginRule& rule, std::vector<Note>& passed_over) {
  if (object.category == "film") drop_crop(object, passed_over);
  std::erase_if(object.properties, [&](Property& property) {
    const PropertyRule* property_rule = find_rule(rule, property.name);
    if (property_rule == nullptr) return false;
    const Result<void> fits = check_property(property, *property_rule);
    if (fits.ok()) return false;
    if (property_rule->only.empty() && clamp_to(*property_rule, property, passed_over)) return false;
    if (property_rule->required) return false;
    passed_over.push_back(passed_over_note(fits.error()));
    return true;
  });
  if (object.category == "emitter" && object.plugin == "spot") narrow_beam(object, passed_over);
  if (object.category == "emitter" && is_rigid_light(object)) straighten(object, passed_over);
  if (object.category == "texture" && object.plugin == "bitmap") round_gamma(object, passed_over);
  if (object.category == "sensor" || object.plugin == "projector") open_camera(object, passed_over);
}

void material(Object& object, std::vector<Note>& passed_over) {
  if (object.category != "bsdf" || (object.plugin != "conductor" && object.plugin != "roughconductor"))
    return;
  std::erase_if(object.properties, [&](const Property& property) {
    const auto* name = std::get_if<std::string>(&property.value);
    if (property.name != "material" || name == nullptr) return false;
    if (text::lower(*name) == "none" || named_conductor(*name)) return false;
    passed_over.push_back(passed_over_note(unknown_conductor(property)));
    return true;
  });
}

}  // namespace candela::description::repair
