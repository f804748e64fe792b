// Tests of pictures of numbers: ranges, ticks, colors of pixels and of the scale.
#include "common/image/false_color.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <set>

#include "common/rng/stream.h"

namespace candela::image {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr Color8 kWhite = {255, 255, 255};

std::vector<float> random_values(std::size_t count, std::uint64_t seed, bool with_negative) {
  rng::Stream stream(seed);
  std::vector<float> values(count);
  for (float& value : values) {
    value = std::ldexp(stream.next_float(), static_cast<int>(stream.next_u32() % 20) - 10);
    if (with_negative && stream.next_u32() % 3 == 0) value = -value;
    if (stream.next_u32() % 16 == 0) value = 0;
    if (stream.next_u32() % 16 == 0) value = stream.next_u32() % 2 == 0 ? kNan : kInfinity;
  }
  return values;
}

double naive_percentile(std::vector<float> values, double percent, bool logarithmic) {
  std::erase_if(values, [&](float v) { return !std::isfinite(v) || (logarithmic && v <= 0); });
  std::sort(values.begin(), values.end());
  const double rank = percent / 100 * static_cast<double>(values.size() - 1);
  const auto lower = static_cast<std::size_t>(std::floor(rank)),
             upper = static_cast<std::size_t>(std::ceil(rank));
  return values[lower] + (rank - std::floor(rank)) * (double{values[upper]} - values[lower]);
}

// Claim: the range is that of the percentiles of a sorted copy, of finite numbers and, on a logarithmic
// scale, of those above 0; a signed range reaches as far as the larger of the two, both ways.
TEST(PercentileScale, AgreesWithASort) {
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const auto values = random_values(50 + seed * 7, seed, seed % 2 == 0);
    for (const auto& [low, high] : {std::pair(1.0, 99.0), std::pair(0.0, 100.0), std::pair(12.5, 61.7)})
      for (const bool logarithmic : {false, true}) {
        const auto scale = percentile_scale(values, low, high, logarithmic, false);
        ASSERT_TRUE(scale.ok());
        const double a = naive_percentile(values, low, logarithmic),
                     b = naive_percentile(values, high, logarithmic);
        EXPECT_NEAR(scale->low, a, 1e-9 * std::abs(a));
        EXPECT_NEAR(scale->high, b, 1e-9 * std::abs(b));
        EXPECT_EQ(scale->logarithmic, logarithmic);
        if (logarithmic) continue;
        const auto both = percentile_scale(values, low, high, false, true);
        EXPECT_NEAR(both->high, std::max(std::abs(a), std::abs(b)), 1e-9 * std::abs(both->high));
        EXPECT_EQ(both->low, -both->high);
      }
  }
}

// Claim: a range is never empty: if the percentiles are equal it holds all numbers, and numbers around one
// that all pixels have; if no pixel can have a color, there is none.
TEST(PercentileScale, IsNeverEmpty) {
  std::vector<float> values(1000, 0.0F);
  values[7] = 5;
  const auto spike = percentile_scale(values, 1, 99, false, false);
  EXPECT_EQ(spike->low, 0);
  EXPECT_EQ(spike->high, 5);
  EXPECT_EQ(percentile_scale(values, 1, 99, false, true)->high, 5);
  for (const float value :
       {0.0F, 3.0F, -2.0F, std::numeric_limits<float>::denorm_min(), std::numeric_limits<float>::max()})
    for (const bool logarithmic : {false, true})
      for (const bool is_signed : {false, true}) {
        if (logarithmic && (value <= 0 || is_signed)) continue;
        const std::vector<float> constant(9, value);
        const auto scale = percentile_scale(constant, 1, 99, logarithmic, is_signed);
        ASSERT_TRUE(scale.ok()) << value;
        EXPECT_LT(scale->low, scale->high) << value;
        EXPECT_GE(scale->position(value), 0) << value;
        EXPECT_LE(scale->position(value), 1) << value;
      }
  EXPECT_FALSE(percentile_scale(std::vector<float>{kNan, kInfinity}, 1, 99, false, false).ok());
  EXPECT_FALSE(percentile_scale(std::vector<float>{0, -1, kNan}, 1, 99, true, false).ok());
}

// Claim: counts and figures of a few numbers are those of counting by hand.
TEST(Summary, CountsByKind) {
  const std::vector<float> values = {-1, 0, 0.5F, 1, 2, 8, 9, kNan, kInfinity, -kInfinity};
  const ValueSummary linear = summarize(values, {0, 8, false});
  EXPECT_EQ(linear.pixels, 10U);
  EXPECT_EQ(linear.not_finite, 3U);
  EXPECT_EQ(linear.not_positive, 0U);
  EXPECT_EQ(linear.below, 1U);
  EXPECT_EQ(linear.above, 1U);
  EXPECT_EQ(linear.minimum, -1);
  EXPECT_EQ(linear.maximum, 9);
  EXPECT_NEAR(linear.mean, 19.5 / 7, 1e-12);
  const ValueSummary log = summarize(values, {1, 8, true});
  EXPECT_EQ(log.not_positive, 2U);
  EXPECT_EQ(log.below, 1U);
  EXPECT_EQ(log.above, 1U);
  EXPECT_TRUE(std::isnan(summarize(std::vector<float>{kNan}, {0, 1, false}).mean));
}

// The number that a label shows.
double read_label(const Label& label) {
  if (label.raised.empty()) return std::strtod(label.base.c_str(), nullptr);
  const double mantissa = label.base == "10" ? 1 : std::strtod(label.base.c_str(), nullptr);
  EXPECT_TRUE(label.base.ends_with("10")) << label.base;
  return mantissa * std::pow(10.0, std::strtod(label.raised.c_str(), nullptr));
}

// Claim: on any scale there are at least two labeled ticks, within the scale, in order, with labels that do
// not touch, of which no two are alike, and which say the tick's number.
TEST(ScaleTicks, LabelsSayTheirNumbers) {
  rng::Stream stream(3);
  for (int i = 0; i < 4000; ++i) {
    const bool logarithmic = i % 2 == 0;
    ColorScale scale;
    scale.logarithmic = logarithmic;
    const double size = std::pow(10.0, 76 * stream.next_double() - 38);
    if (logarithmic) {
      scale.low = size;
      scale.high = std::min(3e38, size * (1 + std::pow(10.0, 8 * stream.next_double() - 2)));
      if (!(scale.low < scale.high)) continue;
    } else {
      scale.low = size * (2 * stream.next_double() - 1);
      scale.high = scale.low + size * std::pow(10.0, 3 * stream.next_double() - 2);
    }
    const double length = 190 + 1500 * stream.next_double(), capital = 8;
    const Ticks ticks = ticks_of(scale, length, capital);
    ASSERT_GE(ticks.labeled.size(), 2U) << scale.low << " " << scale.high;
    double end = -1e9;
    std::set<std::pair<std::string, std::string>> seen;
    for (const Tick& tick : ticks.labeled) {
      EXPECT_GE(scale.position(tick.value), -1e-6) << scale.low << " " << scale.high;
      EXPECT_LE(scale.position(tick.value), 1 + 1e-6) << scale.low << " " << scale.high;
      const double x = scale.position(tick.value) * length, half = text_width(tick.label, capital) / 2;
      EXPECT_GT(x - half, end) << scale.low << " " << scale.high << " " << tick.label.base;
      end = x + half;
      EXPECT_TRUE(seen.emplace(tick.label.base, tick.label.raised).second)
          << tick.label.base << " " << scale.low << " " << scale.high;
      const double shown = read_label(tick.label) * std::pow(10.0, ticks.exponent);
      EXPECT_NEAR(shown, tick.value,
                  2e-3 * std::max(std::abs(tick.value), logarithmic ? 0 : scale.high - scale.low))
          << tick.label.base << "^" << tick.label.raised << " e" << ticks.exponent;
    }
    for (const double value : ticks.minor) {
      EXPECT_GE(scale.position(value), -1e-6);
      EXPECT_LE(scale.position(value), 1 + 1e-6);
    }
  }
}

// Claim: the ticks of scales that people meet are those that a person would draw.
TEST(ScaleTicks, OfUsualScales) {
  const auto labels = [](const Ticks& ticks) {
    std::vector<std::string> out;
    for (const Tick& tick : ticks.labeled)
      out.push_back(tick.label.base + (tick.label.raised.empty() ? "" : "^" + tick.label.raised));
    return out;
  };
  using Labels = std::vector<std::string>;
  EXPECT_EQ(labels(ticks_of({0, 1, false}, 440, 10)), (Labels{"0.0", "0.2", "0.4", "0.6", "0.8", "1.0"}));
  EXPECT_EQ(labels(ticks_of({-1, 1, false}, 440, 10)), (Labels{"-1.0", "-0.5", "0.0", "0.5", "1.0"}));
  EXPECT_EQ(labels(ticks_of({0, 4e-5, false}, 440, 10)), (Labels{"0", "1", "2", "3", "4"}));
  EXPECT_EQ(ticks_of({0, 4e-5, false}, 440, 10).exponent, -5);
  EXPECT_EQ(labels(ticks_of({0.002, 12, true}, 440, 10)), (Labels{"0.01", "0.1", "1", "10"}));
  EXPECT_EQ(labels(ticks_of({1e-7, 1e-2, true}, 440, 10)),
            (Labels{"10^-7", "10^-6", "10^-5", "10^-4", "10^-3", "10^-2"}));
  EXPECT_EQ(labels(ticks_of({0.3, 8, true}, 440, 10)), (Labels{"0.5", "1", "2", "5"}));
}

Figure draw(const std::vector<float>& values, std::uint32_t width, ColorMap map, const ColorScale& scale) {
  return draw_false_color(values, width, static_cast<std::uint32_t>(values.size()) / width, map, scale,
                          summarize(values, scale), "quantity");
}

// Claim: to look a pixel's color up on the scale below gives the pixel's number back, up to what one column
// of the scale and one step of 8 bits hide.
TEST(FalseColor, PixelsReadBackFromTheScale) {
  rng::Stream stream(11);
  for (const bool logarithmic : {false, true})
    for (const ColorMap map : {ColorMap::viridis, ColorMap::turbo, ColorMap::grey, ColorMap::heat}) {
      const ColorScale scale{logarithmic ? 0.01 : -3.0, 7.0, logarithmic};
      std::vector<float> values(640 * 4);
      for (float& value : values) value = static_cast<float>(scale.value_at(stream.next_double()));
      const Figure figure = draw(values, 640, map, scale);
      const std::uint32_t row = figure.bar.y + figure.bar.height / 2;
      for (std::size_t i = 0; i < values.size(); i += 3) {
        const auto x = static_cast<std::uint32_t>(i % 640), y = static_cast<std::uint32_t>(i / 640);
        const Color8 color = figure.canvas.at(figure.picture.x + x, figure.picture.y + y);
        int best = 1 << 20;
        double nearest =
            0;  // position of the column whose color is nearest; of several, that near the number
        const double truth = scale.position(values[i]);
        for (std::uint32_t column = 2; column + 2 < figure.bar.width; ++column) {
          const Color8 other = figure.canvas.at(figure.bar.x + column, row);
          int distance = 0;
          for (std::size_t c = 0; c < 3; ++c) distance += std::abs(color[c] - other[c]);
          const double at = (column + 0.5) / figure.bar.width;
          if (distance < best || (distance == best && std::abs(at - truth) < std::abs(nearest - truth))) {
            best = distance;
            nearest = at;
          }
        }
        ASSERT_LE(best, 12) << values[i];
        ASSERT_NEAR(nearest, truth, 0.012) << values[i] << " map " << static_cast<int>(map);
      }
    }
}

// Claim: the scale's pixels have the map's colors, the lowest on the left; an end is an arrow if, and only
// if, numbers lie beyond it.
TEST(FalseColor, TheScaleShowsTheMap) {
  const std::vector<float> inside(256 * 2, 0.5F);
  std::vector<float> beyond = inside;
  beyond[0] = 9;
  for (const std::vector<float>* const values : {&inside, static_cast<const std::vector<float>*>(&beyond)}) {
    const Figure figure = draw(*values, 256, ColorMap::turbo, {0, 1, false});
    const PixelBox& bar = figure.bar;
    const std::uint32_t row = bar.y + bar.height / 2;
    for (std::uint32_t x = 2; x + 2 < bar.width; ++x)
      ASSERT_EQ(figure.canvas.at(bar.x + x, row), color_at(ColorMap::turbo, (x + 0.5) / bar.width)) << x;
    EXPECT_EQ(figure.canvas.at(bar.x + bar.width + 3, row),
              values == &beyond ? color_at(ColorMap::turbo, 1) : kWhite);
    EXPECT_EQ(figure.canvas.at(bar.x - 4, row), kWhite);
  }
}

// Claim: pixels that are not finite are magenta, those of 0 or less on a logarithmic scale have one color of
// their own, and numbers beyond the range have the colors of its ends; the legend says both kinds, with their
// colors, and makes the figure higher.
TEST(FalseColor, PixelsWithoutANumberHaveColorsOfTheirOwn) {
  std::vector<float> values(300 * 2, 1.0F);
  const float first[] = {kNan, kInfinity, -kInfinity, 0, -1, 1e-30F, 1e30F};
  std::copy(std::begin(first), std::end(first), values.begin());
  for (const ColorMap map : {ColorMap::viridis, ColorMap::grey}) {
    const ColorScale scale{0.1, 10, true};
    const Figure figure = draw(values, 300, map, scale);
    const auto color = [&](std::uint32_t x) { return figure.canvas.at(figure.picture.x + x, 0); };
    for (const std::uint32_t x : {0U, 1U, 2U}) EXPECT_EQ(color(x), (Color8{255, 0, 255})) << x;
    EXPECT_EQ(color(3), color(4));
    EXPECT_EQ(color(5), color_at(map, 0));
    EXPECT_EQ(color(6), color_at(map, 1));
    for (int i = 0; i <= 1000; ++i) {
      EXPECT_NE(color_at(map, i / 1000.0), color(0));
      EXPECT_NE(color_at(map, i / 1000.0), color(3));
    }
    const Figure plain = draw(std::vector<float>(300 * 2, 1.0F), 300, map, scale);
    EXPECT_GT(figure.canvas.height, plain.canvas.height);
    int magenta = 0, other = 0;
    for (std::uint32_t y = plain.canvas.height - 6; y < figure.canvas.height; ++y)
      for (std::uint32_t x = 0; x < figure.canvas.width; ++x) {
        magenta += figure.canvas.at(x, y) == color(0);
        other += figure.canvas.at(x, y) == color(3);
      }
    EXPECT_GT(magenta, 25);
    EXPECT_GT(other, 25);
  }
}

// Claim: pictures of any size, down to one pixel, have a whole scale: nothing of its ink touches the border
// of the canvas.
TEST(FalseColor, OfAnySize) {
  for (const auto& [width, height] : {std::pair(1U, 1U), std::pair(3U, 400U), std::pair(4000U, 2U)}) {
    const std::vector<float> values(std::size_t{width} * height, 2.0F);
    const ColorScale scale{1, 3, false};
    const Figure figure = draw_false_color(values, width, height, ColorMap::heat, scale,
                                           summarize(values, scale), std::string(300, 'W'));
    for (std::uint32_t y = height; y < figure.canvas.height; ++y) {
      ASSERT_EQ(figure.canvas.at(0, y), kWhite);
      ASSERT_EQ(figure.canvas.at(figure.canvas.width - 1, y), kWhite);
    }
    for (std::uint32_t x = 0; x < figure.canvas.width; ++x)
      ASSERT_EQ(figure.canvas.at(x, figure.canvas.height - 1), kWhite);
    EXPECT_EQ(figure.canvas.at(figure.picture.x + width - 1, height - 1), color_at(ColorMap::heat, 0.5));
    EXPECT_TRUE(encode_png(figure.canvas).ok());
  }
}

Canvas text_on_canvas(const std::string& text) {
  Canvas canvas(24, 24, kWhite);
  draw_text(canvas, 4, 18, 12, {text}, {0, 0, 0});
  return canvas;
}

// Claim: every letter, digit and mark that names of layers and numbers may have is drawn, and no two are
// alike; any other character is one box, also if it is several bytes of UTF-8 or none at all.
TEST(Lettering, CharactersDiffer) {
  std::set<std::vector<std::uint8_t>> seen = {Canvas(24, 24, kWhite).rgb};
  for (const char c :
       std::string("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-.,:+=/%()"))
    EXPECT_TRUE(seen.insert(text_on_canvas({c}).rgb).second) << c;
  const auto box = text_on_canvas("\x01").rgb;
  EXPECT_TRUE(seen.insert(box).second);
  EXPECT_EQ(text_on_canvas("\u20ac").rgb, box);
  EXPECT_EQ(text_on_canvas("\xff").rgb, box);
}

// Claim: text is as wide as it says, and what lies beyond the canvas is cut off.
TEST(Lettering, WidthIsThatOfTheInk) {
  for (const std::string text : {"layer", "0.125", "sh_normal, X"}) {
    Canvas canvas(300, 60, kWhite);
    draw_text(canvas, 20, 40, 16, {text, "-7"}, {0, 0, 0});
    std::uint32_t right = 0;
    for (std::uint32_t y = 0; y < canvas.height; ++y)
      for (std::uint32_t x = 0; x < canvas.width; ++x)
        if (canvas.at(x, y) != kWhite) right = std::max(right, x);
    EXPECT_NEAR(right, 20 + text_width({text, "-7"}, 16), 3) << text;
  }
  Canvas small(5, 5, kWhite);
  draw_text(small, -1e6, 3, 16, {"a"}, {0, 0, 0});
  EXPECT_EQ(small.rgb, Canvas(5, 5, kWhite).rgb);
  draw_text(small, -3, 9, 16, {"W0W"}, {0, 0, 0});
  EXPECT_NE(small.rgb, Canvas(5, 5, kWhite).rgb);
  EXPECT_EQ(fit_text("short", 10, 500), "short");
  const std::string cut = fit_text(std::string(200, 'm'), 10, 120);
  EXPECT_TRUE(cut.ends_with("m.."));
  EXPECT_LE(text_width({cut}, 10), 120);
}

}  // namespace
}  // namespace candela::image
