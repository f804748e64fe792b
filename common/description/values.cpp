#include "common/description/values.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "common/description/text.h"
#include "common/description/transform.h"
#include "common/description/vocabulary.h"

namespace candela::description {
namespace {

constexpr std::array<std::string_view, 8> value_elements = {"boolean", "integer", "float", "string",
                                                            "point",   "vector",  "rgb",   "srgb"};
constexpr std::array<std::string_view, 6> operations = {"translate", "rotate", "scale",
                                                        "lookat",    "lookAt", "matrix"};

Result<double> number(const Element& element, std::string_view word) {
  const std::optional<double> value = text::to_number(word);
  if (!value)
    return element.error(fmt::format("{} in <{}> is not a finite number", text::quote(word), element.name));
  return *value;
}

// The three numbers of an attribute.
Result<Vec3> triple(const Element& element, std::string_view attribute) {
  const std::vector<std::string_view> words = text::tokens(element.get(attribute));
  if (words.size() != 3)
    return element.error(
        fmt::format("attribute '{}' of <{}> needs 3 numbers, not {}", attribute, element.name, words.size()));
  Vec3 result{};
  for (std::size_t i = 0; i < 3; ++i) {
    CANDELA_ASSIGN(result[i], number(element, words[i]));
  }
  return result;
}

// x, y, z, or all in value (one number for all three, or three); `otherwise` for absent ones.
Result<Vec3> components(const Element& element, double otherwise) {
  if (const std::string* value = element.find("value")) {
    if (element.find("x") != nullptr || element.find("y") != nullptr || element.find("z") != nullptr)
      return element.error(fmt::format("<{}> has both 'value' and 'x', 'y' or 'z'", element.name));
    const std::vector<std::string_view> words = text::tokens(*value);
    if (words.size() == 3) return triple(element, "value");
    if (words.size() != 1)
      return element.error(
          fmt::format("attribute 'value' of <{}> needs 1 or 3 numbers, not {}", element.name, words.size()));
    CANDELA_ASSIGN(const double all, number(element, words[0]));
    return Vec3{all, all, all};
  }
  Vec3 result = {otherwise, otherwise, otherwise};
  constexpr std::array<std::string_view, 3> axes = {"x", "y", "z"};
  for (std::size_t i = 0; i < 3; ++i)
    if (const std::string* value = element.find(axes[i])) {
      CANDELA_ASSIGN(result[i], number(element, *value));
    }
  return result;
}

// "#rrggbb", by everybody's convention sRGB-encoded.
std::optional<Vec3> hex_color(std::string_view word) {
  if (word.size() != 7 || word[0] != '#') return std::nullopt;
  Vec3 result{};
  for (std::size_t i = 0; i < 3; ++i) {
    int value = 0;
    for (const char c : word.substr(1 + 2 * i, 2)) {
      const std::string_view digits = "0123456789abcdef";
      const std::size_t digit = digits.find(text::lower(std::string_view(&c, 1)));
      if (digit == std::string_view::npos) return std::nullopt;
      value = value * 16 + static_cast<int>(digit);
    }
    result[i] = value / 255.0;
  }
  return result;
}

Result<Rgb> color(const Element& element) {
  const bool encoded = element.name == "srgb";
  const std::vector<std::string_view> words = text::tokens(element.get("value"));
  Vec3 value{};
  bool decode = encoded;
  if (words.size() == 1 && words[0].starts_with('#')) {
    const std::optional<Vec3> hex = hex_color(words[0]);
    if (!hex)
      return element.error(fmt::format("{} in <{}> is not a color", text::quote(words[0]), element.name))
          .with_mend("write it as '#rrggbb'");
    value = *hex;
    decode = encoded || !element.legacy;  // 0.6 takes the bytes of an <rgb> for linear ones
  } else if (words.size() == 1 || words.size() == 3) {
    for (std::size_t i = 0; i < 3; ++i) {
      CANDELA_ASSIGN(value[i], number(element, words[words.size() == 1 ? 0 : i]));
    }
  } else {
    return element.error(
        fmt::format("attribute 'value' of <{}> needs 1 or 3 numbers, not {}", element.name, words.size()));
  }
  if (decode)
    for (double& component : value) {
      if (component < 0 || component > 1) return element.error("<srgb> values are between 0 and 1");
      component = transform::srgb_to_linear(component);
    }
  return Rgb{value};
}

// 0.6 lets colors say whether they are of light or of a surface, which tells its spectral builds alone
// something.
Result<void> expect_value(const Element& element) {
  if (!element.legacy || (element.name != "rgb" && element.name != "srgb"))
    return element.expect({"name", "value"});
  CANDELA_TRY(element.expect({"name", "value"}, {"intent"}));
  return check_intent(element);
}

Result<Mat4> matrix(const Element& element, bool two_dimensional) {
  CANDELA_TRY(element.expect({"value"}));
  const std::vector<std::string_view> words = text::tokens(element.get("value"));
  if (words.size() != 16 && words.size() != 9)
    return element.error(fmt::format("<matrix> needs 16 or 9 numbers, not {}", words.size()));
  const std::size_t side = words.size() == 16 ? 4 : 3;
  // A 2D homogeneous matrix keeps its third row and column for the translation, which is the fourth in 3D.
  const std::array<std::size_t, 4> place = side == 3 && two_dimensional
                                               ? std::array<std::size_t, 4>{0, 1, 3, 2}
                                               : std::array<std::size_t, 4>{0, 1, 2, 3};
  Mat4 result = transform::identity;
  for (std::size_t i = 0; i < side; ++i)
    for (std::size_t j = 0; j < side; ++j) {
      CANDELA_ASSIGN(result[place[i] * 4 + place[j]], number(element, words[i * side + j]));
    }
  if (!transform::is_affine(result))
    return element.error("<matrix> is not affine").with_mend("its last row must be 0 0 0 1");
  return result;
}

Result<Mat4> rotation(const Element& element) {
  CANDELA_TRY(element.expect({"angle"}, {"x", "y", "z", "value"}));
  CANDELA_ASSIGN(const Vec3 axis, components(element, 0));
  CANDELA_ASSIGN(const double degrees, number(element, element.get("angle")));
  const std::optional<Mat4> result = transform::rotate(axis, degrees);
  if (result) return *result;
  if (degrees == 0) return transform::identity;  // about any axis
  return element.error("the axis of <rotate> has no length").with_mend("give x, y or z");
}

Result<Mat4> look_at(const Element& element) {
  CANDELA_TRY(element.expect({"origin", "target"}, {"up"}));
  CANDELA_ASSIGN(const Vec3 origin, triple(element, "origin"));
  CANDELA_ASSIGN(const Vec3 target, triple(element, "target"));
  Vec3 up{};
  if (element.find("up") != nullptr) {
    CANDELA_ASSIGN(up, triple(element, "up"));
  }
  const std::optional<Mat4> result = transform::look_at(origin, target, up);
  if (!result)
    return element.error(
        fmt::format("<{}> has no direction: target is origin, or up is parallel to the view", element.name));
  return *result;
}

}  // namespace

Result<void> check_intent(const Element& element) {
  const std::string* intent = element.find("intent");
  if (intent == nullptr || text::lower(*intent) == "reflectance" || text::lower(*intent) == "illuminant")
    return {};
  return element.error(fmt::format("{} is not an intent", text::quote(*intent)))
      .with_mend("write 'reflectance' or 'illuminant'");
}

const std::string* Element::find(std::string_view attribute) const {
  const auto found = std::find_if(attributes.begin(), attributes.end(),
                                  [&](const auto& entry) { return entry.first == attribute; });
  return found == attributes.end() ? nullptr : &found->second;
}

std::string_view Element::get(std::string_view attribute) const {
  const std::string* value = find(attribute);
  return value == nullptr ? std::string_view() : std::string_view(*value);
}

Result<void> Element::expect(std::initializer_list<std::string_view> required,
                             std::initializer_list<std::string_view> optional) const {
  std::vector<std::string_view> known(required);
  known.insert(known.end(), optional.begin(), optional.end());
  for (const auto& [attribute, value] : attributes)
    if (std::find(known.begin(), known.end(), attribute) == known.end())
      return error(fmt::format("unknown attribute {} of <{}>", text::quote(attribute), name))
          .with_mend(text::did_you_mean(nearest_name(attribute, known)));
  for (const std::string_view attribute : required)
    if (find(attribute) == nullptr)
      return error(fmt::format("<{}> lacks the attribute '{}'", name, attribute));
  return {};
}

Error Element::error(std::string message) const {
  return input_error(std::move(message)).at(where.file, where.line);
}

bool is_value_element(std::string_view name) {
  return std::find(value_elements.begin(), value_elements.end(), name) != value_elements.end();
}

bool is_transform_operation(std::string_view name) {
  return std::find(operations.begin(), operations.end(), name) != operations.end();
}

Result<Property> parse_value(const Element& element) {
  Property property;
  property.where = element.where;
  if (element.name == "point" || element.name == "vector") {
    if (element.find("value") != nullptr) {
      CANDELA_TRY(element.expect({"name", "value"}, {"x", "y", "z"}));
    } else {
      CANDELA_TRY(element.expect({"name", "x", "y", "z"}));
    }
    property.type = element.name == "point" ? PropertyType::point : PropertyType::vector;
    CANDELA_ASSIGN(property.value, components(element, 0));
  } else {
    CANDELA_TRY(expect_value(element));
    const std::string_view value = element.get("value");
    if (element.name == "boolean") {
      const std::optional<bool> parsed = text::to_boolean(value);
      if (!parsed)
        return element.error(fmt::format("{} is not a boolean", text::quote(value)))
            .with_mend("write 'true' or 'false'");
      property.type = PropertyType::boolean;
      property.value = *parsed;
    } else if (element.name == "integer") {
      const std::optional<std::int64_t> parsed = text::to_integer(value);
      if (!parsed) return element.error(fmt::format("{} is not an integer", text::quote(value)));
      property.type = PropertyType::integer;
      property.value = *parsed;
    } else if (element.name == "float") {
      property.type = PropertyType::number;
      CANDELA_ASSIGN(property.value, number(element, value));
    } else if (element.name == "string") {
      property.type = PropertyType::string;
      property.value = std::string(value);
    } else {
      property.type = PropertyType::rgb;
      CANDELA_ASSIGN(property.value, color(element));
    }
  }
  property.name = std::string(element.get("name"));
  return property;
}

Result<Mat4> parse_operation(const Element& element, bool two_dimensional) {
  if (element.name == "matrix") return matrix(element, two_dimensional);
  if (element.name == "rotate") return rotation(element);
  if (element.name == "lookat" || element.name == "lookAt") return look_at(element);
  CANDELA_TRY(element.expect({}, {"x", "y", "z", "value"}));
  const bool scale = element.name == "scale";
  CANDELA_ASSIGN(const Vec3 by, components(element, scale ? 1 : 0));
  return scale ? transform::scale(by) : transform::translate(by);
}

}  // namespace candela::description
