// Frames of a group as `candela submit --frames` names them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace candela::client {

// "1-240", "1-240x2" (every second one), "7", or several of these after commas. In their order, each once; at
// most 10,000.
Result<std::vector<std::int32_t>> parse_frames(std::string_view text, std::string_view option);

// Makes the group's name: the pattern without {frame} and without the dots, lines and blanks around it.
// The name is empty if nothing else is left.
std::string group_name_of(std::string_view pattern);

}  // namespace candela::client
