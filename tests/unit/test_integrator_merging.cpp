// ppm, bpm and vcm as the farm sees them: settings, plans, units, stops.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/integrators.h"
#include "tests/pilot_state.h"
#include "tests/unit/scene_fixture.h"
#include "worker/integrators/merging/pixels_alone.h"
#include "worker/render/renderer.h"
#include "worker/transport/film_position.h"

namespace candela::render {
namespace {

constexpr std::uint32_t kSize = 40;

// A lit box with a glass ball in it.
const std::string kBox =
    "<shape type=\"cube\"><bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf></shape>"
    "<shape type=\"sphere\"><point name=\"center\" x=\"0.3\" y=\"-0.4\" z=\"0.4\"/><float name=\"radius\" "
    "value=\"0.3\"/><bsdf type=\"dielectric\"/></shape>"
    "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"0.3\"/><rotate x=\"1\" "
    "angle=\"90\"/><translate y=\"0.99\"/></transform><emitter type=\"area\"/></shape>";
const std::string kPlain = "<shape type=\"sphere\"><emitter type=\"area\"/></shape><shape type=\"cube\"/>";

std::unique_ptr<Renderer> make(const std::string& integrator, const std::string& body,
                               const SettingsMap& chosen = {}) {
  const test::TextFiles files(
      {{"scene.xml", "<scene version=\"3.0.0\"><integrator type=\"path\"/><sensor type=\"perspective\"/>" +
                         body + "</scene>"}});
  JobSettings job;
  job.integrator = integrator;
  job.width = job.height = kSize;
  job.seed = 3;
  const auto settings = complete_integrator_settings(integrator, {}, chosen);
  if (!settings.ok()) throw std::runtime_error(settings.error().to_string());
  job.integrator_settings = *settings;
  auto renderer = Renderer::create(files, "scene.xml", {}, job, 1);
  if (!renderer.ok()) throw std::runtime_error(renderer.error().to_string());
  return std::move(*renderer);
}

std::vector<std::int64_t> sums(const film::UnitFilm& film) {
  return {film.sums(), film.sums() + film.layout().pixel_count() * film::kChannels};
}

// Claim: a pixel is one tile's alone only if no path of another tile can have its position in it, however
// far the filter scatters; and most of a tile's pixels are.
TEST(Merging, PixelsAloneAreReachedFromOneTile) {
  using integrators::merging::PixelsAlone;
  constexpr std::uint32_t kTile = film::kTileSize, kWidth = 100, kHeight = 40;
  const auto tile = [&](std::uint32_t x, std::uint32_t y, double radius) {
    const std::uint32_t x0 = x / kTile * kTile, y0 = y / kTile * kTile;
    return PixelsAlone(kWidth, kHeight, radius, x0, y0, std::min(x0 + kTile, kWidth),
                       std::min(y0 + kTile, kHeight));
  };
  for (const double radius : {1e-3, 0.5, 0.75, 1.0, 1.4999, 1.5, 2.0, 3.0, 31.0, 40.0, 200.0}) {
    std::vector<int> alone(std::size_t{kWidth} * kHeight, -1);  // the tile
    for (std::uint32_t y = 0; y < kHeight; ++y)
      for (std::uint32_t x = 0; x < kWidth; ++x)
        for (std::uint32_t of_y = 0; of_y < kHeight; of_y += kTile)
          for (std::uint32_t of_x = 0; of_x < kWidth; of_x += kTile) {
            if (!tile(of_x, of_y, radius).contains(x, y)) continue;
            int& owner = alone[std::size_t{y} * kWidth + x];
            EXPECT_EQ(owner, -1) << x << ' ' << y;
            owner = static_cast<int>(of_y / kTile * 4 + of_x / kTile);
          }
    for (std::uint32_t y = 0; y < kHeight; ++y)
      for (std::uint32_t x = 0; x < kWidth; ++x)
        for (int place = 0; place < 25; ++place) {
          const auto shift = [&](int step) { return static_cast<float>(radius * (step - 2) / 2); };
          const auto at = transport::pixel_of({static_cast<float>(x) + 0.5f + shift(place % 5),
                                               static_cast<float>(y) + 0.5f + shift(place / 5)},
                                              kWidth, kHeight);
          const int owner = alone[std::size_t{at.y} * kWidth + at.x];
          ASSERT_TRUE(owner == -1 || owner == static_cast<int>(y / kTile * 4 + x / kTile))
              << radius << ": " << x << ' ' << y << " to " << at.x << ' ' << at.y;
        }
    const auto count = std::count_if(alone.begin(), alone.end(), [](int owner) { return owner >= 0; });
    if (radius <= 2) {
      EXPECT_GT(count, kWidth * kHeight / 2) << radius;
    }
  }
}

// Claim: a unit is a pure function of its indices, not of threads, nor of how iterations are cut into units.
TEST(Merging, ThreadsAndCutsChangeNothing) {
  for (const std::string& integrator : test::merging_integrators()) {
    if (test::has_epochs(integrator)) continue;  // its units begin with a state: test_integrator_adaptive.cpp
    const auto renderer = make(integrator, kBox, {{"radius", "0.02"}});
    const NamedState state = test::state_at(*renderer, 20);
    const UnitInput input{state, {}, {}};
    auto one = renderer->make_output(state), four = renderer->make_output(state),
         cut = renderer->make_output(state);
    ASSERT_TRUE(renderer->run({Unit::Kind::iterations, 1, 2, 5}, input, one, {1}).ok());
    ASSERT_TRUE(renderer->run({Unit::Kind::iterations, 1, 2, 5}, input, four, {4}).ok());
    ASSERT_TRUE(renderer->run({Unit::Kind::iterations, 1, 3, 5}, input, cut, {2}).ok());
    ASSERT_TRUE(renderer->run({Unit::Kind::iterations, 1, 2, 3}, input, cut, {3}).ok());
    EXPECT_EQ(sums(*one.film), sums(*four.film)) << integrator;
    EXPECT_EQ(sums(*one.film), sums(*cut.film)) << integrator;
    EXPECT_EQ(one.film->sample_counts(), four.film->sample_counts()) << integrator;
    EXPECT_EQ(one.film->sample_counts().eye_samples, 3 * kSize * kSize) << integrator;
    EXPECT_EQ(one.film->sample_counts().light_paths, 3 * kSize * kSize) << integrator;
    for (const std::uint64_t count : one.film->sample_counts().rejected) EXPECT_EQ(count, 0u) << integrator;
  }
}

// Claim: the number of light paths is the setting's, down to one, and a path of each pixel can be had with
// fewer light paths than pixels.
TEST(Merging, CountsOfLightPaths) {
  for (const auto& [setting, count] :
       {std::pair<std::string, std::uint64_t>{"0.1", 160}, {"2.5", 4000}, {"1e-9", 1}}) {
    const auto renderer = make("vcm", kBox, {{"light_paths", setting}});
    const NamedState state = test::state_at(*renderer, 0);
    auto output = renderer->make_output(state);
    const auto& film = output.film;
    ASSERT_TRUE(renderer->run({Unit::Kind::iterations, 0, 0, 1}, {state, {}, {}}, output, {1}).ok());
    EXPECT_EQ(film->sample_counts().light_paths, count);
  }
}

// Claim: a stop ends a unit with an error; progress ends at 1 without one.
TEST(Merging, StopsAndProgress) {
  const auto renderer = make("vcm", kBox);
  const UnitInput input{test::state_at(*renderer, 0), {}, {}};
  auto output = renderer->make_output(input.state);
  const auto& film = output.film;
  std::atomic<bool> stop{true};
  std::atomic<float> progress{0};
  EXPECT_FALSE(renderer->run({Unit::Kind::iterations, 0, 0, 2}, input, output, {1, &stop, &progress}).ok());
  stop = false;
  film->clear();
  EXPECT_TRUE(renderer->run({Unit::Kind::iterations, 0, 0, 2}, input, output, {1, &stop, &progress}).ok());
  EXPECT_EQ(progress.load(), 1.0f);
}

// Claim: plans skip what cannot pay, say so, and no more.
TEST(Merging, PlansSaySo) {
  const auto plan = [](const std::string& integrator, const std::string& body,
                       const SettingsMap& chosen = {}) {
    return make(integrator, body, chosen)->plan_text().value();
  };
  const std::string no_merging =
      "skip merging on surfaces: nothing glossy or specular can hide a light from connections: bidirectional "
      "path tracing is left\n";
  EXPECT_NE(plan("vcm", kPlain).find(no_merging), std::string::npos);
  EXPECT_EQ(plan("vcm", kBox).find(no_merging), std::string::npos);
  EXPECT_EQ(plan("vcm", kPlain, {{"plan", "full"}}).find("skip"), std::string::npos);
  EXPECT_NE(plan("bpm", kPlain).find("use  merging on surfaces: the only way light paths are used\n"),
            std::string::npos);
  EXPECT_NE(plan("ppm", kPlain, {{"photons", "caustics"}}).find("there are no caustics"), std::string::npos);
  const std::string mirrors =
      "<shape type=\"sphere\"><bsdf type=\"conductor\"/><emitter type=\"area\"/></shape>";
  for (const std::string integrator : {"bpm", "vcm"}) {
    const std::string text = plan(integrator, mirrors);
    EXPECT_NE(text.find("skip light paths: no technique needs them\n"), std::string::npos) << text;
  }
  EXPECT_NE(plan("vcm", "").find("skip everything: the scene has no emitter"), std::string::npos);
  EXPECT_NE(plan("vcm", kBox, {{"max_depth", "1"}}).find("skip all but light seen directly"),
            std::string::npos);
}

// Claim: numbers in settings are read back exactly, and bad ones are errors that name the range.
TEST(Merging, NumbersInSettings) {
  const auto defaults = complete_integrator_settings("ppm", {}, {});
  ASSERT_TRUE(defaults.ok());
  EXPECT_EQ(std::stod(defaults->at("alpha")), 2.0 / 3);
  EXPECT_EQ(defaults->at("radius"), "0");
  const auto given = complete_integrator_settings("vcm", {}, {{"radius", "1e-05"}, {"alpha", "1"}});
  ASSERT_TRUE(given.ok());
  EXPECT_EQ(given->at("radius"), "1e-05");
  EXPECT_EQ(given->at("alpha"), "1");
  for (const std::string bad : {"0", "-1", "1.5", "nan", "inf", "x", "0.5 ", "", "1e999"}) {
    const auto refused = complete_integrator_settings("ppm", {}, {{"alpha", bad}});
    ASSERT_FALSE(refused.ok()) << bad;
    EXPECT_NE(refused.error().to_string().find("is not a number above 0 and at most 1"), std::string::npos)
        << refused.error().to_string();
  }
  EXPECT_FALSE(complete_integrator_settings("ppm", {}, {{"radius_pixels", "-1"}}).ok());
  EXPECT_TRUE(complete_integrator_settings("ppm", {}, {{"radius_pixels", "0"}}).ok());
}

// Claim: integrators that weigh merges say which heuristic they have, and who has another; path and bdpt take
// it.
TEST(Merging, HasTheBalanceHeuristicAlone) {
  for (const std::string integrator : {"vcm", "bpm", "vcmplus"})
    for (const std::string heuristic : {"power", "balance"}) {
      const auto refused = complete_integrator_settings(integrator, {}, {{"heuristic", heuristic}});
      ASSERT_FALSE(refused.ok()) << integrator;
      EXPECT_EQ(refused.error().field, "heuristic");
      EXPECT_NE(refused.error().message.find("balance heuristic alone"), std::string::npos);
      EXPECT_NE(refused.error().mend.find("bdpt"), std::string::npos);
    }
  for (const std::string integrator : {"path", "bdpt"}) {
    const auto taken = complete_integrator_settings(integrator, {}, {{"heuristic", "power"}});
    ASSERT_TRUE(taken.ok()) << taken.error().to_string();
    EXPECT_EQ(taken->at("heuristic"), "power");
  }
}

}  // namespace
}  // namespace candela::render
