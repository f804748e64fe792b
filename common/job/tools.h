// Integrators that are tools of `candela inspect`: jobs have them, and no list of integrators.
#pragma once

#include <string_view>

namespace candela::tools {

inline constexpr std::string_view kSphere = "sphere";  // a path tracer

// The integrator whose paths these are.
constexpr std::string_view paths_of(std::string_view integrator) {
  return integrator == kSphere ? "path" : integrator;
}

}  // namespace candela::tools
