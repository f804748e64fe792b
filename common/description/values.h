// The elements of a scene file that carry values: numbers, colors, vectors and transform operations.
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"

namespace candela::description {

// An element without its children, $parameters resolved.
struct Element {
  std::string_view name;
  std::vector<std::pair<std::string_view, std::string>> attributes;
  Location where;
  bool legacy = false;  // of a file before version 2

  const std::string* find(std::string_view attribute) const;
  std::string_view get(std::string_view attribute) const;  // empty where absent

  // All of `required` are there and nothing beside them and `optional`.
  Result<void> expect(std::initializer_list<std::string_view> required,
                      std::initializer_list<std::string_view> optional = {}) const;
  Error error(std::string message) const;  // at this element
};

bool is_value_element(std::string_view name);  // boolean, integer, float, string, point, vector, rgb, srgb
bool is_transform_operation(std::string_view name);  // translate, rotate, scale, lookat, matrix

// The attribute 'intent' of 0.6's colors, if it is there: reflectance or illuminant.
Result<void> check_intent(const Element& element);

// A property; its name as written.
Result<Property> parse_value(const Element& element);

// One operation inside <transform>. In a 2D transform (to_uv) a matrix of 9 values acts on (u, v, 1), else on
// (x, y, z).
Result<Mat4> parse_operation(const Element& element, bool two_dimensional);

}  // namespace candela::description
