// The nightly form of tests.
#pragma once

#include <cstdlib>
#include <string_view>

namespace candela::test {

// True if $CANDELA_LONG is set to other than 0.
inline bool long_form() {
  const char* const asked = std::getenv("CANDELA_LONG");
  return asked != nullptr && *asked != '\0' && std::string_view(asked) != "0";
}

}  // namespace candela::test
