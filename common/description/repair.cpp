#include "common/description/repair.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "common/description/check.h"
#include "common/description/conductors.h"
#include "common/description/film_window.h"
#include "common/description/resolve.h"
#include "common/description/text.h"

namespace candela::description::repair {
namespace {

bool takes(const PropertyRule& rule, PropertyType type) {
  return std::find(rule.types.begin(), rule.types.end(), type) != rule.types.end();
}

// Numbers above a bound that is excluded begin here.
double lowest(const PropertyRule& rule) {
  return rule.above_minimum ? rule.minimum + 1e-6 * std::max(1.0, std::abs(rule.minimum)) : rule.minimum;
}

// On the far side of an excluded bound something else is meant: a radius of -1 is no small radius.
bool is_senseless(double value, const PropertyRule& rule) {
  return rule.above_minimum && value < rule.minimum;
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

}  // namespace

void properties(Object& object, const PluginRule& rule, std::vector<Note>& passed_over) {
  if (object.category == "film") drop_crop(object, passed_over);
  std::erase_if(object.properties, [&](Property& property) {
    const PropertyRule* property_rule = find_rule(rule, property.name);
    if (property_rule == nullptr) return false;
    const Result<void> fits = check_property(property, *property_rule);
    if (fits.ok()) return false;
    const std::optional<double> number = as_number(property);
    if (number && is_senseless(*number, *property_rule)) return false;
    if (property_rule->only.empty()) {
      std::optional<Property> mended = nearest(property, *property_rule);
      if (mended && check_property(*mended, *property_rule).ok()) {
        passed_over.push_back(
            {property.where, fmt::format("{}: {} is taken", fits.error().message, shown(*mended))});
        property = std::move(*mended);
        return false;
      }
    }
    if (property_rule->required) return false;
    passed_over.push_back(passed_over_note(fits.error()));
    return true;
  });
  if (object.category == "emitter" && object.plugin == "spot") narrow_beam(object, passed_over);
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
