// Finds the layers of a job that add up to its image.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace candela::letters {

// Light groups are called light.NAME, by the name of the lamp.
inline constexpr std::string_view kLightGroupPrefix = "light.";

// `request`: the text of the layers in the job's settings. `layers`: all of the job's layers. All layers of
// expressions if the request is a partition; else the light groups, since each path begins at one lamp and
// each lamp has one name; else none.
std::vector<std::string> partition_of(std::string_view request, std::span<const std::string> layers);

}  // namespace candela::letters
