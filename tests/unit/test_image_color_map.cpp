// Tests of color maps against published colors.
#include "common/image/color_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <utility>
#include <vector>

#include "common/image/image.h"

namespace candela::image {
namespace {

void expect_near(ColorMap map, double t, std::uint32_t expected, int tolerance) {
  const Color8 color = color_at(map, t);
  for (std::size_t c = 0; c < 3; ++c)
    EXPECT_LE(std::abs(color[c] - static_cast<int>(expected >> (16 - 8 * c) & 0xff)), tolerance)
        << "map " << static_cast<int>(map) << " at " << t << " channel " << c;
}

// Claim: viridis and turbo have the colors of Matplotlib's tables of 256, within one step of 8 bits. The
// entries are chosen off the points that our tables hold.
TEST(ColorMaps, FollowTheTablesOfMatplotlib) {
  const std::vector<std::pair<int, std::uint32_t>> viridis = {
      {0, 0x440154},   {1, 0x440256},   {13, 0x481467},  {47, 0x423f85},  {77, 0x34608d},
      {101, 0x2a778e}, {128, 0x21918c}, {153, 0x22a884}, {176, 0x3fbc73}, {199, 0x6ece58},
      {222, 0xa8db34}, {249, 0xefe51c}, {254, 0xfbe723}, {255, 0xfde725}};
  const std::vector<std::pair<int, std::uint32_t>> turbo = {
      {0, 0x30123b},   {1, 0x321543},   {13, 0x3e3891},  {47, 0x4391fe},  {77, 0x18d7ca},
      {101, 0x43f787}, {128, 0xa4fc3c}, {153, 0xe1dd37}, {176, 0xfdac34}, {199, 0xf56918},
      {222, 0xd43305}, {249, 0x8e0a01}, {254, 0x7e0502}, {255, 0x7a0403}};
  for (const auto& [i, color] : viridis) expect_near(ColorMap::viridis, i / 255.0, color, 1);
  for (const auto& [i, color] : turbo) expect_near(ColorMap::turbo, i / 255.0, color, 1);
}

// Claim: heat is MATLAB's hot(8), whose rows its manual prints; grey is its own number; the signed map is
// Moreland's, with his ends and his white.
TEST(ColorMaps, FollowTheirFormulas) {
  const std::uint32_t hot8[] = {0x550000, 0xaa0000, 0xff0000, 0xff5500,
                                0xffaa00, 0xffff00, 0xffff80, 0xffffff};
  for (int i = 0; i < 8; ++i) expect_near(ColorMap::heat, (i + 1) / 8.0, hot8[i], 1);
  for (int i = 0; i < 256; ++i)
    expect_near(ColorMap::grey, i / 255.0, static_cast<std::uint32_t>(i * 0x010101), 0);
  expect_near(ColorMap::cool_warm, 0, 0x3b4cc0, 0);
  expect_near(ColorMap::cool_warm, 0.5, 0xdddddd, 0);
  expect_near(ColorMap::cool_warm, 1, 0xb40426, 0);
}

// Claim: viridis, grey and heat become brighter all the way; the signed map becomes brighter up to 0.5 and
// darker after it.
TEST(ColorMaps, LightnessIsMonotonic) {
  const auto luminance = [](ColorMap map, double t) {
    const Color8 c = color_at(map, t);
    const auto linear = [](std::uint8_t v) { return double{srgb_to_linear(static_cast<float>(v) / 255)}; };
    return 0.2126 * linear(c[0]) + 0.7152 * linear(c[1]) + 0.0722 * linear(c[2]);
  };
  for (int i = 0; i < 64; ++i) {
    const double t = i / 64.0, next = (i + 1) / 64.0;
    for (const ColorMap map : {ColorMap::viridis, ColorMap::grey, ColorMap::heat})
      EXPECT_LT(luminance(map, t), luminance(map, next)) << static_cast<int>(map) << " at " << t;
    EXPECT_EQ(luminance(ColorMap::cool_warm, t) < luminance(ColorMap::cool_warm, next), t < 0.5) << t;
  }
}

// Claim: numbers beyond [0, 1] have the colors of the ends; names are those of the maps.
TEST(ColorMaps, EndsAndNames) {
  for (const std::string_view name : kColorMapNames) {
    const auto map = color_map_of(name);
    ASSERT_TRUE(map.has_value()) << name;
    EXPECT_EQ(color_at(*map, -1e300), color_at(*map, 0));
    EXPECT_EQ(color_at(*map, 1e300), color_at(*map, 1));
    EXPECT_NE(color_at(*map, 0), color_at(*map, 1));
  }
  EXPECT_EQ(color_map_of("turbo"), ColorMap::turbo);
  EXPECT_EQ(color_map_of("heat"), ColorMap::heat);
  EXPECT_EQ(color_map_of("jet"), std::nullopt);
}

}  // namespace
}  // namespace candela::image
