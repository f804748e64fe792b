#include "common/description/lenient.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <utility>
#include <vector>

#include "common/description/check.h"
#include "common/description/text.h"
#include "common/description/transform.h"

namespace candela::description::lenient {
namespace {

struct Nearest {
  std::string_view category, name, plugin;
  bool is_close = false;  // Mitsuba's own, and the same picture but for what the warning says
};

// By name: plugins of Mitsuba that Candela lacks, and those of well-known forks and courses.
constexpr std::array<Nearest, 31> kNearest = {{
    {"bsdf", "disneybsdf", "principled"},
    {"bsdf", "disney", "principled"},
    {"bsdf", "disneymetal", "principled"},
    {"bsdf", "disneyglass", "principled"},
    {"bsdf", "disneyclearcoat", "principled"},
    {"bsdf", "simplemicrofacet", "roughplastic"},
    {"bsdf", "approxmicrofacet", "roughplastic"},
    {"bsdf", "pplastic", "roughplastic", true},
    {"bsdf", "glass", "dielectric"},
    {"bsdf", "mirror", "conductor"},
    {"bsdf", "polarizer", "thindielectric", true},
    {"bsdf", "circular", "thindielectric"},
    {"bsdf", "retarder", "null"},
    {"integrator", "photonmapper", "ppm"},
    {"integrator", "upm", "ppm"},
    {"emitter", "directionalarea", "area"},
    {"emitter", "collimated", "spot", true},
    {"sensor", "radiancemeter", "orthographic", true},
    {"sensor", "telecentric", "orthographic"},
    {"phase", "tabphase", "hg"},
    {"phase", "microflake", "isotropic", true},  // as 0.6 has it without a field of orientations
    {"texture", "", "rawconstant"},
    {"bsdf", "", "diffuse"},
    {"film", "", "hdrfilm"},
    {"sensor", "", "perspective"},
    {"sampler", "", "independent"},
    {"rfilter", "", "gaussian"},
    {"phase", "", "isotropic"},
    {"medium", "", "homogeneous"},
    {"integrator", "", "path"},
}};

const Nearest* find_nearest(std::string_view category, std::string_view name) {
  const auto found = std::find_if(kNearest.begin(), kNearest.end(), [&](const Nearest& nearest) {
    return nearest.category == category && nearest.name == name;
  });
  return found == kNearest.end() ? nullptr : &*found;
}

// The longest known name that `name` begins with: forks add words to Mitsuba's names
// ("roughconductor_heitz").
std::string_view known_beginning(std::string_view category, std::string_view name) {
  std::string_view longest;
  for (const std::string_view known : plugin_names(category))
    if (known.size() >= 4 && known.size() > longest.size() && name.starts_with(known)) longest = known;
  return longest;
}

// True if the known plugin holds as many bsdfs as the object does. The number matters to bsdfs alone.
bool holds_as_many(const Object& object, std::string_view plugin, std::size_t bsdf_parts) {
  if (object.category != "bsdf") return true;
  const std::vector<std::string_view>& children = find_plugin("bsdf", plugin)->child_categories;
  if (std::find(children.begin(), children.end(), "bsdf") == children.end()) return bsdf_parts == 0;
  if (plugin == "twosided") return bsdf_parts == 1 || bsdf_parts == 2;
  return bsdf_parts == (plugin == "blendbsdf" ? 2U : 1U);
}

// The known plugin that an unknown name misspells. A shape, emitter or volume, which would otherwise be left
// out, must be nearer than the others: "curve" is no misspelled "cube".
std::string_view meant_plugin(const Object& object, std::string_view name, std::size_t bsdf_parts) {
  std::vector<std::string_view> known = plugin_names(object.category);
  std::erase_if(known, [&](std::string_view plugin) { return !holds_as_many(object, plugin, bsdf_parts); });
  const std::string_view nearest = nearest_name(name, known);
  if (nearest.empty()) return {};
  const std::size_t edits = edit_distance(name, nearest);
  const bool has_default = find_nearest(object.category, "") != nullptr;
  const bool is_near = has_default ? 3 * edits <= name.size() + 1 : 4 * edits <= name.size() + 2;
  return is_near ? nearest : std::string_view();
}

bool has_any(const Object& object, std::initializer_list<std::string_view> names) {
  return std::any_of(names.begin(), names.end(),
                     [&](std::string_view name) { return object.find(name) != nullptr; });
}

Property* find(Object& object, std::string_view name) {
  const auto found = std::find_if(object.properties.begin(), object.properties.end(),
                                  [&](const Property& property) { return property.name == name; });
  return found == object.properties.end() ? nullptr : &*found;
}

// Adds the property if the object does not have it.
void add(Object& object, std::string_view name, PropertyType type, decltype(Property::value) value) {
  if (find(object, name) == nullptr)
    object.properties.push_back({std::string(name), type, std::move(value), object.where});
}

void remove(Object& object, std::string_view name) {
  std::erase_if(object.properties, [&](const Property& property) { return property.name == name; });
}

// Parameters of one meaning under the names that plugins and forks give it.
const std::vector<std::vector<std::string_view>>& synonyms() {
  static const std::vector<std::vector<std::string_view>> groups = {
      {"reflectance", "diffuse_reflectance", "base_color", "diffuse_color", "color", "albedo", "kd"},
      {"specular_reflectance", "r0", "specular_color"},
      {"spec_trans", "specular_transmission", "transmission"},
      {"spec_tint", "specular_tint"},
      {"flatness", "subsurface"},
      {"scale", "density", "density_scale", "density_multiplier"},
      {"cutoff_angle", "total_angle"},
      {"beam_width", "falloff_angle"},
      {"int_ior", "ior"},
  };
  return groups;
}

Rgb color_of(const Object& object, std::string_view name) {
  return object.get_rgb(name).value_or(Rgb{{1, 1, 1}});
}

void set(Object& object, std::string_view name, PropertyType type, decltype(Property::value) value) {
  remove(object, name);
  add(object, name, type, std::move(value));
}

// A beam of no width becomes a cone of half a degree of the same power.
void become_narrow_spot(Object& beam) {
  constexpr double half_angle = 0.25;                // degrees
  constexpr double solid_angle = 5.980697163503e-5;  // sr, 2 pi (1 - cos(half_angle))
  const Property* given = beam.find("power");
  Rgb intensity = {{1, 1, 1}};
  if (given != nullptr && (given->type == PropertyType::rgb || given->type == PropertyType::number ||
                           given->type == PropertyType::integer))
    intensity = color_of(beam, "power");
  for (double& component : intensity.value) component /= solid_angle;
  remove(beam, "power");
  set(beam, "intensity", PropertyType::rgb, intensity);
  set(beam, "cutoff_angle", PropertyType::number, half_angle);
  set(beam, "beam_width", PropertyType::number, half_angle);
}

// A ray becomes a camera of parallel rays that is next to a point.
void become_narrow_camera(Object& meter) {
  constexpr double half_width = 1e-4;  // in units of the scene
  Mat4 place = transform::identity;
  if (const Property* given = meter.find("to_world");
      given != nullptr && given->type == PropertyType::transform)
    place = std::get<Mat4>(given->value);
  const Property* origin = meter.find("origin");
  const Property* direction = meter.find("direction");
  if (origin != nullptr && direction != nullptr && std::holds_alternative<Vec3>(origin->value) &&
      std::holds_alternative<Vec3>(direction->value)) {
    const Vec3 from = std::get<Vec3>(origin->value), along = std::get<Vec3>(direction->value);
    const Vec3 to = {from[0] + along[0], from[1] + along[1], from[2] + along[2]};
    place = transform::look_at(from, to, {0, 0, 0}).value_or(place);
  }
  for (const std::string_view name : {"origin", "direction"}) remove(meter, name);
  set(meter, "to_world", PropertyType::transform,
      transform::multiply(place, transform::scale({half_width, half_width, 1})));
}

// A table of values at even distances of the cosine, linear between them: its mean cosine, for which Henyey
// and Greenstein's function stands in.
double mean_cosine(std::string_view table) {
  std::vector<double> values;
  for (const std::string_view word : text::tokens(table)) {
    const std::optional<double> value = text::to_number(word);
    if (!value || !(*value >= 0)) return 0;
    values.push_back(*value);
  }
  if (values.size() < 2) return 0;
  double sum = 0, moment = 0;
  const double width = 2 / static_cast<double>(values.size() - 1);
  for (std::size_t i = 0; i + 1 < values.size(); ++i) {
    const double a = values[i], b = values[i + 1], left = -1 + static_cast<double>(i) * width;
    sum += (a + b) / 2 * width;
    moment += ((a + b) / 2 * left + (a + 2 * b) / 6 * width) * width;
  }
  const double mean = moment / sum;
  return std::isfinite(mean) ? std::clamp(mean, -0.99999, 0.99999) : 0;
}

}  // namespace

bool has_close_plugin(const Object& object) {
  const Nearest* nearest = find_nearest(object.category, object.plugin);
  return nearest != nullptr && nearest->is_close;
}

std::string nearest_plugin(const Object& object, std::size_t bsdf_parts) {
  const std::string name = text::lower(object.plugin);
  if (find_plugin(object.category, name) != nullptr) return name;
  if (const Nearest* nearest = find_nearest(object.category, name)) {
    if (nearest->plugin == "dielectric" && has_any(object, {"alpha", "roughness"})) return "roughdielectric";
    return std::string(nearest->plugin);
  }
  const std::string_view beginning = known_beginning(object.category, name);
  if (!beginning.empty() && holds_as_many(object, beginning, bsdf_parts)) return std::string(beginning);
  if (support_of_plugin(object.category, name) == Support::none)
    if (const std::string_view meant = meant_plugin(object, name, bsdf_parts); !meant.empty())
      return std::string(meant);
  if (object.category == "bsdf" && bsdf_parts == 1) return "mask";
  if (object.category == "bsdf" && bsdf_parts == 2) return "blendbsdf";
  if (!beginning.empty()) return std::string(beginning);
  const Nearest* fallback = find_nearest(object.category, "");
  return fallback == nullptr ? std::string() : std::string(fallback->plugin);
}

void adopt(Object& object, std::string_view original) {
  const std::string name = text::lower(original);
  const auto number = [&](std::string_view parameter, double value) {
    add(object, parameter, PropertyType::number, value);
  };
  for (Property& property : object.properties) {
    const std::string snake = text::snake_case(property.name);
    if (object.find(snake) == nullptr) property.name = snake;
  }
  if (object.plugin == "mask" && object.category == "bsdf") number("opacity", 1);
  if (name == "disneymetal") number("metallic", 1);
  if (name == "disneyglass") number("spec_trans", 1);
  if (name == "disneyclearcoat") {
    number("clearcoat", 1);
    number("specular", 0);
    add(object, "base_color", PropertyType::rgb, Rgb{});
  }
  if (object.plugin == "principled" && object.find("eta") != nullptr) remove(object, "specular");
  // An ideal polarizer passes half of unpolarized light.
  if (name == "polarizer" || name == "circular") {
    for (const std::string_view index : {"int_ior", "ext_ior"}) {
      remove(object, index);
      number(index, 1);
    }
    add(object, "specular_transmittance", PropertyType::rgb, Rgb{{0.5, 0.5, 0.5}});
  }
  if (object.category == "bsdf" && name.find("ggx") != std::string::npos &&
      (object.plugin == "roughconductor" || object.plugin == "roughdielectric"))
    add(object, "distribution", PropertyType::string, std::string("ggx"));
  if (name == "tabphase" && object.category == "phase") {
    const Property* table = object.find("values");
    const auto* words = table == nullptr ? nullptr : std::get_if<std::string>(&table->value);
    number("g", words == nullptr ? 0 : mean_cosine(*words));
    remove(object, "values");
  }
  if (name == "collimated") become_narrow_spot(object);
  if (name == "radiancemeter") become_narrow_camera(object);
  // A reflectance at normal incidence in place of an index: a mirror of that color.
  if (object.plugin == "roughconductor" && has_any(object, {"r0"}))
    add(object, "material", PropertyType::string, std::string("none"));
  if (object.category == "texture" && object.plugin == "rawconstant" && object.find("value") == nullptr)
    number("value", 0.5);
}

std::string_view meant_parameter(const PluginRule& rule, std::string_view name) {
  const auto known = [&](std::string_view parameter) -> std::string_view {
    const PropertyRule* found = find_rule(rule, parameter);
    return found == nullptr ? std::string_view() : found->name;
  };
  const std::string snake = text::snake_case(name);
  if (const std::string_view same = known(snake); !same.empty()) return same;
  for (const auto& group : synonyms()) {
    if (std::find(group.begin(), group.end(), snake) == group.end()) continue;
    for (const std::string_view other : group)
      if (const std::string_view found = known(other); !found.empty()) return found;
  }
  return {};
}

std::string_view usual_value(std::string_view parameter) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 18> kUsual = {{
      {"spp", "16"},
      {"sample_count", "16"},
      {"samples", "16"},
      {"resx", "768"},
      {"resy", "576"},
      {"res_x", "768"},
      {"res_y", "576"},
      {"width", "768"},
      {"height", "576"},
      {"res", "512"},
      {"resolution", "512"},
      {"max_depth", "-1"},
      {"maxdepth", "-1"},
      {"depth", "-1"},
      {"rr_depth", "5"},
      {"seed", "0"},
      {"integrator", "path"},
      {"sampler", "independent"},
  }};
  const std::string folded = text::snake_case(parameter);
  for (const auto& [name, value] : kUsual)
    if (name == folded || name == text::lower(parameter)) return value;
  return {};
}

}  // namespace candela::description::lenient
