#include "common/description/setting_text.h"

#include <fmt/format.h>

namespace candela::description {

std::optional<std::string> setting_text(const Property& property) {
  switch (property.type) {
    case PropertyType::boolean:
      return std::get<bool>(property.value) ? "true" : "false";
    case PropertyType::integer:
      return fmt::format("{}", std::get<std::int64_t>(property.value));
    case PropertyType::number:
      return fmt::format("{}", std::get<double>(property.value));
    case PropertyType::string:
      return std::get<std::string>(property.value);
    default:
      return std::nullopt;
  }
}

}  // namespace candela::description
