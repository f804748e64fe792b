// Numbers on the command lines of the benchmark programs.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string_view>

namespace candela::bench {

// A whole number between `least` and `most`, also written as 1e7; whatever else it is ends the program with
// one line that names it.
inline std::uint64_t count_argument(std::string_view name, const char* text, double least, double most) {
  char* end = nullptr;
  const double value = std::strtod(text, &end);
  if (end != text && *end == '\0' && value >= least && value <= most && std::floor(value) == value)
    return static_cast<std::uint64_t>(value);
  std::fprintf(stderr, "%.*s: '%s' is not a whole number between %g and %g\n", static_cast<int>(name.size()),
               name.data(), text, least, most);
  std::exit(2);
}
// Reads argv[i], if there is one.
inline std::uint64_t count_argument(std::string_view name, int argc, char** argv, int i,
                                    std::uint64_t otherwise, double most) {
  return argc > i ? count_argument(name, argv[i], 1, most) : otherwise;
}

}  // namespace candela::bench
