// Flags of Mitsuba 0.6 that turn mutations of `mlt` and `erpt` on and off, and the settings that they stand
// for.
#pragma once

#include <array>
#include <string_view>

namespace candela::description {

struct MutationFlag {
  std::string_view name;     // of the integrator's parameter
  std::string_view setting;  // a share of 1 or 0
};

inline constexpr std::array<MutationFlag, 5> kMutationFlags{{{"bidirectional_mutation", "bidirectional"},
                                                             {"lens_perturbation", "lens"},
                                                             {"multi_chain_perturbation", "multichain"},
                                                             {"caustic_perturbation", "caustic"},
                                                             {"manifold_perturbation", "manifold"}}};

}  // namespace candela::description
