// Names of enumerators that count from 0.
#pragma once

#include <cstddef>
#include <string_view>

namespace candela {

// The name of `value` in the list of all names; a value beyond the list has the name `other`.
template <std::size_t N, class Enum>
constexpr std::string_view name_of_value(const std::string_view (&names)[N], Enum value,
                                         std::string_view other = "?") {
  const auto at = static_cast<std::size_t>(value);
  return at < N ? names[at] : other;
}

}  // namespace candela
