#include "test_description_common.h"

#include <fmt/format.h>

namespace candela::description {
namespace {

struct ValueText {
  std::string operator()(bool value) const { return value ? "true" : "false"; }
  std::string operator()(std::int64_t value) const { return std::to_string(value); }
  std::string operator()(double value) const { return fmt::format("{}", value); }
  std::string operator()(const std::string& value) const { return value; }
  std::string operator()(const Vec3& value) const {
    return fmt::format("{},{},{}", value[0], value[1], value[2]);
  }
  std::string operator()(const Rgb& value) const { return (*this)(value.value); }
  std::string operator()(const Mat4& value) const {
    std::string text;
    for (const double entry : value) text += fmt::format("{} ", entry);
    return text;
  }
};

}  // namespace

std::string dump(const Object& object) {
  std::string text = fmt::format("({} {} #{}", object.category, object.plugin, object.id);
  for (const Property& property : object.properties)
    text += fmt::format("\n {} {}={}", name(property.type), property.name,
                        std::visit(ValueText{}, property.value));
  for (const Child& child : object.children) text += fmt::format("\n {}:{}", child.slot, dump(*child.object));
  return text + ")";
}

}  // namespace candela::description
