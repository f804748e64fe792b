// Names of enumerators that count from 0.
#pragma once

#include <cstddef>
#include <string_view>

namespace candela {

// The name of `value` in the list of all names, up to that of `kLast`; a value beyond the list has the name
// `other`.
template <auto kLast, std::size_t N>
constexpr std::string_view name_of_value(const std::string_view (&names)[N], decltype(kLast) value,
                                         std::string_view other = "?") {
  static_assert(N == static_cast<std::size_t>(kLast) + 1, "each enumerator has a name");
  const auto at = static_cast<std::size_t>(value);
  return at < N ? names[at] : other;
}

}  // namespace candela
