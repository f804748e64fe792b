// The nearest of several names, for messages.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace candela {

// The known name with the smallest edit distance, or empty if none is near (distance > half the length).
std::string_view nearest_name(std::string_view name, std::span<const std::string_view> known);

// Edits (insert, delete, replace, swap of neighbors) from a to b: the optimal string alignment distance.
std::size_t edit_distance(std::string_view a, std::string_view b);

// "did you mean 'x'?", or empty where `nearest` is.
std::string did_you_mean(std::string_view nearest);

}  // namespace candela
