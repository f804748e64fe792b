// Color maps: colors of sRGB for numbers in [0, 1].
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace candela::image {

enum class ColorMap : std::uint8_t { viridis, turbo, grey, heat, cool_warm };

// Names of the maps to choose, in the order of ColorMap. cool_warm has no name: cool_warm serves values of
// either sign, white-gray at 0.5.
inline constexpr std::array<std::string_view, 4> kColorMapNames = {"viridis", "turbo", "grey", "heat"};
std::optional<ColorMap> color_map_of(std::string_view name);

using Color8 = std::array<std::uint8_t, 3>;  // sRGB

// t below 0 is taken as 0, t above 1 as 1. Precondition: t is not NaN.
Color8 color_at(ColorMap map, double t);

}  // namespace candela::image
