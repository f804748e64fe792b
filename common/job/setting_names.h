// The values that settings of a job with a closed set of them may have.
#pragma once

#include <array>
#include <string_view>

namespace candela {

inline constexpr std::array<std::string_view, 6> kFilterNames = {"box",      "tent",       "gaussian",
                                                                 "mitchell", "catmullrom", "lanczos"};
inline constexpr std::array<std::string_view, 2> kSamplerNames = {"independent", "sobol"};
inline constexpr std::array<std::string_view, 5> kIsaNames = {"sse2", "sse4.2", "avx", "avx2", "avx512"};

}  // namespace candela
