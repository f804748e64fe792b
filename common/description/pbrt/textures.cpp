#include "common/description/pbrt/textures.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "common/description/check.h"
#include "common/description/resolve.h"
#include "common/description/text.h"
#include "common/description/transform.h"

namespace candela::description::pbrt {
namespace {

constexpr std::array<std::string_view, 14> texture_types = {
    "constant", "imagemap", "checkerboard", "scale", "mix",      "directionmix", "bilerp",
    "dots",     "fbm",      "marble",       "ptex",  "wrinkled", "windy",        "uv"};

constexpr int max_depth = 64;

bool is_one_of(std::string_view name, std::span<const std::string_view> names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// An 8-bit picture, whose numbers are sRGB if nothing else is said.
bool is_encoded(std::string_view file) {
  const std::string name = text::lower(file);
  return !name.ends_with(".exr") && !name.ends_with(".hdr") && !name.ends_with(".pfm");
}

Result<Value> texture_value(const Context& context, std::shared_ptr<Object> object) {
  Value value;
  value.where = object->where;
  CANDELA_ASSIGN(value.texture, context.finish(std::move(object)));
  return value;
}

// Values of rows are counted from the bottom in pbrt.
Mat4 upside_down(const Mat4& to_uv) {
  return transform::multiply(Mat4{1, 0, 0, 0, 0, -1, 0, 1, 0, 0, 1, 0, 0, 0, 0, 1}, to_uv);
}

}  // namespace

void set_color(Object& object, std::string_view name, const Value& value) {
  if (value.is_constant())
    set(object, name, Rgb{value.constant});
  else
    add(object, name, value.texture);
}

void set_number(Object& object, std::string_view name, const Value& value) {
  if (value.is_constant())
    set(object, name, value.number());
  else
    add(object, name, value.texture);
}

Result<void> Textures::define(const std::string& name, std::string_view kind, const std::string& type,
                              ParameterList parameters, ColorSpace space, const Location& where) {
  if (kind != "float" && kind != "spectrum")
    return error_at(where,
                    fmt::format("a texture is of 'float' or 'spectrum', not of {}", text::quote(kind)));
  auto& known = kind == "float" ? floats_ : spectra_;
  constexpr std::size_t node_bytes = 64;
  CANDELA_TRY(
      context_.budget().charge(sizeof(Definition) + node_bytes + heap_bytes(name), where, "textures"));
  const auto [entry, added] = known.try_emplace(
      name, Definition{type, std::move(parameters), space, where, kind == "float", false, std::nullopt});
  if (added) return {};
  const Location& first = entry->second.where;
  return error_at(
      where, fmt::format("the texture {} is defined since {}:{}", text::quote(name), first.file, first.line));
}

Result<Value> Textures::named(const Parameter& parameter, bool is_float) {
  auto& known = is_float ? floats_ : spectra_;
  if (parameter.strings.size() != 1)
    return error_at(parameter.where,
                    fmt::format("parameter {} needs one texture", text::quote(parameter.name)));
  const auto found = known.find(parameter.strings[0]);
  if (found == known.end()) {
    std::vector<std::string_view> names;
    for (const auto& [name, definition] : known) names.push_back(name);
    return Context::unknown(parameter.where, is_float ? "float texture" : "spectrum texture",
                            parameter.strings[0], names);
  }
  Definition& definition = found->second;
  if (definition.value) return *definition.value;
  if (definition.open)
    return error_at(definition.where, fmt::format("the texture {} holds itself", text::quote(found->first)));
  if (depth_ >= max_depth)
    return error_at(definition.where, fmt::format("textures are nested deeper than {} levels", max_depth));
  definition.open = true;
  ++depth_;
  CANDELA_ASSIGN(Value value, read(definition));
  --depth_;
  definition.open = false;
  // A lookup looks a texture up as often as it is named: levels that name the next twice double it.
  if (!value.is_constant() && unfolded(value.texture) > max_texture_unfolded)
    return error_at(definition.where, fmt::format("the texture {} unfolds into more than {} textures",
                                                  text::quote(found->first), max_texture_unfolded))
        .with_mend("name textures that are made of others only once");
  CANDELA_TRY(context_.refuse_unused(definition.parameters, fmt::format("texture '{}'", definition.type)));
  definition.value = value;
  return value;
}

std::uint64_t Textures::unfolded(const ObjectPtr& texture) {
  if (const auto known = unfolded_.find(texture); known != unfolded_.end()) return known->second;
  std::uint64_t count = 1;
  for (const ObjectPtr& part : texture->children_of("texture"))
    count = std::min(max_texture_unfolded + 1, count + unfolded(part));
  unfolded_.emplace(texture, count);
  return count;
}

namespace {

Result<void> not_negated(const Value& value) {
  if (!value.negated) return {};
  return error_at(value.where, "the values of the texture are negative");
}

}  // namespace

Result<std::optional<Value>> Textures::optional_color(ParameterList& parameters, std::string_view name,
                                                      ColorSpace space, SpectrumUse use) {
  if (const Parameter* texture = parameters.take(name, {"texture"})) {
    CANDELA_ASSIGN(Value value, named(*texture, false));
    value.where = texture->where;
    CANDELA_TRY(not_negated(value));
    return std::optional<Value>(std::move(value));
  }
  const Parameter* parameter = parameters.take(name, {"rgb", "spectrum", "blackbody"});
  if (parameter == nullptr) return std::optional<Value>();
  CANDELA_ASSIGN(const Rgb rgb, color_of(context_, *parameter, use, space));
  return std::optional<Value>(Value{rgb.value, nullptr, parameter->where});
}

Result<std::optional<Value>> Textures::optional_number(ParameterList& parameters, std::string_view name) {
  CANDELA_ASSIGN(std::optional<Value> value, displacement(parameters, name));
  if (value) CANDELA_TRY(not_negated(*value));
  return value;
}

Result<std::optional<Value>> Textures::displacement(ParameterList& parameters, std::string_view name) {
  if (const Parameter* texture = parameters.take(name, {"texture"})) {
    CANDELA_ASSIGN(Value value, named(*texture, true));
    value.where = texture->where;
    return std::optional<Value>(std::move(value));
  }
  const Parameter* parameter = parameters.take(name, {"float"});
  if (parameter == nullptr) return std::optional<Value>();
  CANDELA_ASSIGN(const double number, parameters.number(name, 0));
  return std::optional<Value>(Value{{number, number, number}, nullptr, parameter->where});
}

Result<Value> Textures::color(ParameterList& parameters, std::string_view name, const Vec3& otherwise,
                              ColorSpace space, SpectrumUse use) {
  CANDELA_ASSIGN(std::optional<Value> value, optional_color(parameters, name, space, use));
  return value ? std::move(*value) : Value{otherwise, nullptr, {}};
}

Result<Value> Textures::number(ParameterList& parameters, std::string_view name, double otherwise) {
  CANDELA_ASSIGN(std::optional<Value> value, optional_number(parameters, name));
  return value ? std::move(*value) : Value{{otherwise, otherwise, otherwise}, nullptr, {}};
}

Result<Value> Textures::read(Definition& definition) {
  const std::string& type = definition.type;
  if (type == "constant") return part(definition, "value", 1);
  if (type == "imagemap") return read_image(definition);
  if (type == "checkerboard") return read_checkerboard(definition);
  if (type == "scale") return read_scale(definition);
  if (type == "mix") return read_mix(definition);
  if (is_one_of(type, texture_types)) return read_mean(definition);
  CANDELA_TRY(context_.refuse(Context::unknown(definition.where, "texture", type, texture_types),
                              "it is read as the constant 0.5"));
  definition.parameters = {};
  return Value{{0.5, 0.5, 0.5}, nullptr, definition.where};
}

// A constant near the mean of a texture that is not supported.
Result<Value> Textures::read_mean(Definition& definition) {
  ParameterList& parameters = definition.parameters;
  const std::string& type = definition.type;
  const auto mean_of = [&](std::initializer_list<std::string_view> names,
                           std::initializer_list<double> defaults) -> Result<Value> {
    Value mean{{0, 0, 0}, nullptr, definition.where};
    std::optional<Value> texture;
    auto otherwise = defaults.begin();
    for (const std::string_view name : names) {
      CANDELA_ASSIGN(Value value, part(definition, name, *otherwise++));
      if (!value.is_constant()) {
        if (!texture) texture = std::move(value);
        continue;
      }
      for (std::size_t i = 0; i < 3; ++i)
        mean.constant[i] += value.constant[i] / static_cast<double>(names.size());
    }
    // The first texture stands for all: the mean of a picture is not known here.
    if (texture) return *std::move(texture);
    return mean;
  };
  const auto gray = [&](double v) { return Value{{v, v, v}, nullptr, definition.where}; };
  const auto known = [&]() -> Result<Value> {
    if (type == "bilerp") return mean_of({"v00", "v01", "v10", "v11"}, {0, 1, 0, 1});
    if (type == "directionmix") return mean_of({"tex1", "tex2"}, {0, 1});
    if (type == "dots") return mean_of({"outside", "inside"}, {0, 1});
    // The mean of the colors of pbrt's spline.
    if (type == "marble") return Value{{0.8, 0.8, 0.83}, nullptr, definition.where};
    // Noise of a mean magnitude of 0.2, and octaves of it.
    if (type == "wrinkled") return gray(0.4);
    if (type == "fbm" || type == "windy") return gray(0);
    return gray(0.5);
  };
  CANDELA_ASSIGN(Value mean, known());
  context_.differs(definition.where, fmt::format("texture '{}' is {}", type,
                                                 mean.is_constant() ? "the constant of its mean"
                                                                    : "the first of its textures"));
  CANDELA_TRY(mapping(definition));
  parameters.ignore({"octaves", "roughness", "scale", "variation", "dir", "filename", "encoding"});
  return mean;
}

// A parameter of a texture that may be a texture of the same kind.
Result<Value> Textures::part(Definition& definition, std::string_view name, double otherwise) {
  if (definition.is_float) return number(definition.parameters, name, otherwise);
  const Vec3 gray = {otherwise, otherwise, otherwise};
  return color(definition.parameters, name, gray, definition.space, SpectrumUse::unbounded);
}

// From the surface's (u, v) to the texture's.
Result<Mat4> Textures::mapping(Definition& definition) {
  ParameterList& parameters = definition.parameters;
  CANDELA_ASSIGN(const std::string kind, parameters.text("mapping", "uv"));
  if (kind != "uv") {
    constexpr std::array<std::string_view, 4> known = {"uv", "spherical", "cylindrical", "planar"};
    if (is_one_of(kind, known))
      context_.differs(definition.where,
                       fmt::format("the mapping '{}' of a texture follows the surface's u and v", kind));
    else
      CANDELA_TRY(context_.refuse(Context::unknown(definition.where, "mapping", kind, known),
                                  "the texture follows the surface's u and v"));
    parameters.ignore({"v1", "v2"});
  }
  std::array<double, 4> scale_and_shift = {1, 1, 0, 0};
  const std::array<std::string_view, 4> names = {"uscale", "vscale", "udelta", "vdelta"};
  for (std::size_t i = 0; i < 4; ++i) {
    CANDELA_ASSIGN(scale_and_shift[i], parameters.number(names[i], scale_and_shift[i]));
  }
  const auto [su, sv, du, dv] = scale_and_shift;
  return Mat4{su, 0, 0, du, 0, sv, 0, dv, 0, 0, 1, 0, 0, 0, 0, 1};
}

Result<ObjectPtr> Textures::projected_picture(const Location& where, std::string_view file) {
  const std::shared_ptr<Object> bitmap = make("texture", "bitmap", where);
  CANDELA_ASSIGN(const std::string key, context_.find_file(where, file));
  set(*bitmap, "filename", key);
  set(*bitmap, "filter_type", std::string("nearest"));
  set(*bitmap, "wrap_mode", std::string("clamp"));
  return context_.finish(bitmap);
}

Result<ObjectPtr> Textures::picture(const Location& where, std::string_view file, bool raw) {
  const std::shared_ptr<Object> bitmap = make("texture", "bitmap", where);
  CANDELA_ASSIGN(const std::string key, context_.find_file(where, file));
  set(*bitmap, "filename", key);
  set(*bitmap, "to_uv", upside_down(transform::identity));
  if (raw) set_flag(*bitmap, "raw", true);
  return context_.finish(bitmap);
}

Result<Value> Textures::read_image(Definition& definition) {
  ParameterList& parameters = definition.parameters;
  const std::shared_ptr<Object> bitmap = make("texture", "bitmap", definition.where);
  if (definition.is_float) set(*bitmap, "channel", std::string("number"));
  CANDELA_ASSIGN(const std::string file, parameters.text("filename", ""));
  CANDELA_ASSIGN(const std::string key, context_.find_file(definition.where, file));
  set(*bitmap, "filename", key);
  CANDELA_ASSIGN(const Mat4 to_uv, mapping(definition));
  set(*bitmap, "to_uv", upside_down(to_uv));
  CANDELA_ASSIGN(const std::string filter, parameters.text("filter", "bilinear"));
  if (filter == "point") set(*bitmap, "filter_type", std::string("nearest"));
  parameters.ignore({"maxanisotropy"});
  CANDELA_ASSIGN(const std::string wrap, parameters.text("wrap", "repeat"));
  constexpr std::array<std::string_view, 4> wraps = {"repeat", "black", "clamp", "octahedralsphere"};
  if (!is_one_of(wrap, wraps)) return Context::unknown(definition.where, "wrap", wrap, wraps);
  if (wrap == "octahedralsphere")
    context_.differs(definition.where, "the wrap 'octahedralsphere' is 'repeat'");
  set(*bitmap, "wrap_mode", std::string(wrap == "black" ? "zero" : wrap == "clamp" ? "clamp" : "repeat"));
  CANDELA_ASSIGN(const std::string encoding, parameters.text("encoding", ""));
  if (encoding == "linear") {
    set_flag(*bitmap, "raw", true);
  } else if (encoding.starts_with("gamma ")) {
    const std::optional<double> gamma = text::to_number(std::string_view(encoding).substr(6));
    if (!gamma || !(*gamma > 0))
      return error_at(definition.where, fmt::format("{} is no encoding", text::quote(encoding)));
    set(*bitmap, "gamma", *gamma);
  } else if (!encoding.empty() && encoding != "sRGB") {
    return error_at(definition.where, fmt::format("{} is no encoding", text::quote(encoding)))
        .with_mend("there is 'sRGB', 'linear', 'gamma 2.2'");
  }
  CANDELA_ASSIGN(const bool invert, parameters.flag("invert", false));
  CANDELA_ASSIGN(const double scale, parameters.number("scale", 1));
  CANDELA_ASSIGN(const Value picture, texture_value(context_, bitmap));
  CANDELA_ASSIGN(const Value value, scaled(picture, {scale, scale, scale}));
  if (!invert) return value;
  if (!definition.is_float)
    context_.differs(definition.where, "an inverted picture is gray: its luminance is inverted");
  const std::shared_ptr<Object> inverse = make("texture", "mix", definition.where);
  set(*inverse, "color0", Rgb{{1, 1, 1}});
  set(*inverse, "color1", Rgb{{0, 0, 0}});
  set_number(*inverse, "amount", value);
  return texture_value(context_, inverse);
}

Result<Value> Textures::read_checkerboard(Definition& definition) {
  const std::shared_ptr<Object> board = make("texture", "checkerboard", definition.where);
  CANDELA_ASSIGN(const std::int64_t dimension, definition.parameters.integer("dimension", 2));
  if (dimension != 2 && dimension != 3)
    return error_at(definition.where, "a checkerboard has 2 or 3 dimensions");
  if (dimension == 3)
    context_.differs(definition.where, "a checkerboard of 3 dimensions follows the surface's u and v");
  CANDELA_ASSIGN(const Mat4 to_uv, mapping(definition));
  // pbrt's squares have the width 1, ours 1/2.
  set(*board, "to_uv", transform::multiply(transform::scale({0.5, 0.5, 1}), to_uv));
  CANDELA_ASSIGN(const Value first, part(definition, "tex1", 1));
  CANDELA_ASSIGN(const Value second, part(definition, "tex2", 0));
  set_color(*board, "color0", first);
  set_color(*board, "color1", second);
  return texture_value(context_, board);
}

Result<Value> Textures::scaled(const Value& value, const Vec3& factor) const {
  Value result = value;
  if (value.is_constant()) {
    for (std::size_t i = 0; i < 3; ++i) result.constant[i] *= factor[i];
    return result;
  }
  if (factor == Vec3{1, 1, 1}) return result;
  const bool negative = std::max({factor[0], factor[1], factor[2]}) < 0;
  result.negated ^= negative;
  const std::shared_ptr<Object> scale = make("texture", "scale", value.texture->where);
  const double sign = negative ? -1 : 1;
  set(*scale, "scale", Rgb{{sign * factor[0], sign * factor[1], sign * factor[2]}});
  add(*scale, "", value.texture);
  CANDELA_ASSIGN(result.texture, context_.finish(scale));
  return result;
}

namespace {

// An upper bound of the texture's values, as far as its description tells.
double upper_bound(const Object& texture) {
  const auto largest_of = [&](std::string_view name, double otherwise) {
    if (const Child* child = texture.find_child(name)) return upper_bound(*child->object);
    const std::optional<Rgb> rgb = texture.get_rgb(name);
    return rgb ? std::max({rgb->value[0], rgb->value[1], rgb->value[2]}) : otherwise;
  };
  constexpr double unknown = std::numeric_limits<double>::infinity();
  if (texture.plugin == "bitmap") return is_encoded(texture.get_string("filename", "")) ? 1 : unknown;
  if (texture.plugin == "checkerboard") return std::max(largest_of("color0", 0.4), largest_of("color1", 0.2));
  if (texture.plugin == "scale") return largest_of("scale", 1) * upper_bound(*texture.children.at(0).object);
  if (texture.plugin == "mix") return texture.get_number("maximum", unknown);
  return unknown;
}

}  // namespace

Result<Value> Textures::at_most_one(const Value& value) const {
  Value result = value;
  if (value.is_constant() || upper_bound(*value.texture) <= 1) return result;
  const std::shared_ptr<Object> clamp = make("texture", "mix", value.texture->where);
  add(*clamp, "color0", value.texture);
  set(*clamp, "amount", 0.0);
  set(*clamp, "maximum", 1.0);
  CANDELA_ASSIGN(result.texture, context_.finish(clamp));
  return result;
}

Result<Value> Textures::reflectance(ParameterList& parameters, std::string_view name, const Vec3& otherwise,
                                    ColorSpace space) {
  CANDELA_ASSIGN(const Value value, color(parameters, name, otherwise, space));
  return at_most_one(value);
}

// Black and a texture mixed by a factor are their product.
Result<Value> Textures::read_scale(Definition& definition) {
  CANDELA_ASSIGN(const std::optional<Value> given,
                 definition.is_float ? displacement(definition.parameters, "tex")
                                     : optional_color(definition.parameters, "tex", definition.space,
                                                      SpectrumUse::unbounded));
  const Value texture = given.value_or(Value{{1, 1, 1}, nullptr, definition.where});
  CANDELA_ASSIGN(const Value factor, number(definition.parameters, "scale", 1));
  if (factor.is_constant()) return scaled(texture, factor.constant);
  if (texture.is_constant()) return scaled(factor, texture.constant);
  const std::shared_ptr<Object> product = make("texture", "mix", definition.where);
  set(*product, "color0", Rgb{{0, 0, 0}});
  set_color(*product, "color1", texture);
  set_number(*product, "amount", factor);
  CANDELA_ASSIGN(Value value, texture_value(context_, product));
  value.negated = texture.negated;
  return value;
}

Result<Value> Textures::read_mix(Definition& definition) {
  CANDELA_ASSIGN(const Value first, part(definition, "tex1", 0));
  CANDELA_ASSIGN(const Value second, part(definition, "tex2", 1));
  CANDELA_ASSIGN(const Value amount, number(definition.parameters, "amount", 0.5));
  if (first.is_constant() && second.is_constant() && amount.is_constant()) {
    Value value = first;
    for (std::size_t i = 0; i < 3; ++i)
      value.constant[i] += amount.number() * (second.constant[i] - first.constant[i]);
    return value;
  }
  if (amount.is_constant() && amount.number() == 0) return first;
  if (amount.is_constant() && amount.number() == 1) return second;
  const std::shared_ptr<Object> mix = make("texture", "mix", definition.where);
  set_color(*mix, "color0", first);
  set_color(*mix, "color1", second);
  set_number(*mix, "amount", amount);
  return texture_value(context_, mix);
}

Result<Value> Textures::mean(const Value& a, const Value& b) const {
  Value result = a;
  if (a.is_constant() && b.is_constant()) {
    for (std::size_t i = 0; i < 3; ++i) result.constant[i] = 0.5 * (a.constant[i] + b.constant[i]);
    return result;
  }
  const std::shared_ptr<Object> mix = make("texture", "mix", a.is_constant() ? b.where : a.where);
  set_color(*mix, "color0", a);
  set_color(*mix, "color1", b);
  set(*mix, "amount", 0.5);
  CANDELA_ASSIGN(result.texture, context_.finish(mix));
  return result;
}

Result<Value> Textures::root(const Value& value) const {
  Value result = value;
  if (value.is_constant()) {
    for (double& component : result.constant) component = std::sqrt(std::max(component, 0.0));
    return result;
  }
  const std::shared_ptr<Object> root = make("texture", "mix", value.texture->where);
  add(*root, "color0", value.texture);
  set(*root, "amount", 0.0);
  set_flag(*root, "root", true);
  CANDELA_ASSIGN(result.texture, context_.finish(root));
  return result;
}

}  // namespace candela::description::pbrt
