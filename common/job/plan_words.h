// Subjects of a plan's notes that stand beside the figure of a job's error: light that may be in no estimate.
#pragma once

#include <string_view>

namespace candela {

inline constexpr std::string_view kLuckyLight = "light found by luck";
inline constexpr std::string_view kMissingLight = "light that is missing";

}  // namespace candela
