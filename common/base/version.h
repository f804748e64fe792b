#pragma once

#include <cstdint>
#include <string_view>

namespace candela {

std::string_view version();  // "0.1.0"
// Names the sources and architecture this binary was built from. Two binaries with one build id make the same
// bits.
std::string_view build_id();
inline constexpr std::uint32_t kProtocol = 3;  // of proto/candela/v1; grows when old and new cannot talk

// An error where this CPU lacks an instruction set the binary was compiled for, to be printed before anything
// runs. (Called first thing in main: the alternative is an illegal instruction without a word.)
const char* missing_cpu_feature();  // nullptr: all there

}  // namespace candela
