// Hazards that are no sweep: textures that hold no numbers, and iterations of the same index but for a high
// bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "tests/epoch_run.h"
#include "tests/integrators.h"
#include "tests/statistical/harness.h"
#include "tests/stress/scenes.h"

namespace candela::stress {
namespace {

using statistical::MemorySource;
using statistical::TestScene;

// A PFM file of 4 by 4 equal pixels, one of which has `bad` in one channel.
std::string pfm(float value, float bad) {
  std::string file = "PF\n4 4\n-1.0\n";
  for (int i = 0; i < 48; ++i) {
    const auto bits = std::bit_cast<std::uint32_t>(i == 22 ? bad : value);
    for (int byte = 0; byte < 4; ++byte) file.push_back(static_cast<char>(bits >> (8 * byte) & 255));
  }
  return file;
}

TestScene textured(const std::string& use, float bad) {
  const std::string bitmap =
      R"(type="bitmap"><string name="filename" value="t.pfm"/><boolean name="raw" value="true"/></texture>)";
  std::string body = perspective({0, 0, 3}, {0, 0, 0}, {0, 1, 0}, 40);
  const auto texture = [&](const std::string& name) { return "<texture name=\"" + name + "\" " + bitmap; };
  if (use == "reflectance") {
    body += constant_sky(1) + plate("", "<bsdf type=\"diffuse\">" + texture("reflectance") + "</bsdf>");
  } else if (use == "opacity") {
    body +=
        constant_sky(1) + plate("", "<bsdf type=\"mask\">" + texture("opacity") + diffuse(0.5) + "</bsdf>");
  } else if (use == "roughness") {
    body += constant_sky(1) + plate("", "<bsdf type=\"roughconductor\">" + texture("alpha") + "</bsdf>");
  } else if (use == "normalmap") {
    body += constant_sky(1) +
            plate("", "<bsdf type=\"normalmap\">" + texture("normalmap") + diffuse(0.5) + "</bsdf>");
  } else if (use == "bumpmap") {
    body +=
        constant_sky(1) + plate("", "<bsdf type=\"bumpmap\">" + texture("bump") + diffuse(0.5) + "</bsdf>");
  } else if (use == "radiance") {
    body += plate("", diffuse(0.5) + "<emitter type=\"area\">" + texture("radiance") + "</emitter>");
  } else {
    body += R"(<emitter type="envmap"><string name="filename" value="t.pfm"/></emitter>)";
  }
  TestScene scene;
  scene.files = std::make_shared<MemorySource>(std::map<std::string, std::string>{
      {"scene.xml", "<scene version=\"3.0.0\"><integrator type=\"path\"/>" + body + "</scene>"},
      {"t.pfm", pfm(0.5f, bad)}});
  scene.main_key = "scene.xml";
  return statistical::read_scene(std::move(scene), 8, 8);
}

// Claim: an image with a NaN, an infinity or a negative value is refused when the scene is loaded, wherever
// it is used, with its name and the pixel; the same image without is rendered, and nothing of it is rejected.
TEST(HostileInput, TexturesWithoutNumbersAreRefused) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  for (const char* use :
       {"reflectance", "opacity", "roughness", "normalmap", "bumpmap", "radiance", "envmap"}) {
    for (const float bad : {std::numeric_limits<float>::quiet_NaN(), kInfinity, -kInfinity, -1.0f}) {
      const TestScene scene = textured(use, bad);
      const auto renderer = render::Renderer::create(*scene.files, scene.main_key, {}, scene.settings, 1);
      ASSERT_FALSE(renderer.ok()) << use << " " << bad;
      EXPECT_EQ(renderer.error().kind, ErrorKind::input) << use;
      const std::string text = renderer.error().to_string();
      EXPECT_NE(text.find("t.pfm"), std::string::npos) << text;
      EXPECT_NE(text.find("pixel"), std::string::npos) << text;
    }
    EXPECT_NO_THROW(statistical::render_batches(textured(use, 0.5f), 3, 1, 4)) << use;  // rejections throw
  }
}

// Claim: values that are numbers, but near the end of a float's range, end in the film or are counted: no
// image holds what is not finite. (Sums are integers; this is about what is rejected on the way.)
TEST(HostileInput, HugeTexelsAreCountedOrRendered) {
  for (const char* use : {"radiance", "envmap"}) {
    const TestScene scene = textured(use, 3e38f);
    const auto renderer = statistical::make_renderer(scene);
    const auto pilot = renderer->pilot({});
    ASSERT_TRUE(pilot.ok()) << pilot.error().to_string();
    auto output = renderer->make_output(pilot->state);
    const auto& film = output.film;
    ASSERT_TRUE(renderer->run({Unit::Kind::iterations, 0, 0, 4}, {pilot->state, {}, {}}, output, {}).ok());
    std::int64_t largest = 0;
    for (std::size_t i = 0; i < 8 * 8 * 3; ++i) largest = std::max(largest, film->sums()[i]);
    const double brightest = std::ldexp(static_cast<double>(largest), -film->scale_log2());
    std::uint64_t rejected = 0;
    for (const std::uint64_t n : film->sample_counts().rejected) rejected += n;
    EXPECT_TRUE(rejected > 0 || brightest > 1e37) << use << ": lost without a word, " << brightest;
  }
}

// Claim: a lamp whose radiance is a float but whose power is none (4e38 W) is not left out silently by who
// starts paths at it: what is lost is counted.
TEST(HostileInput, PowerBeyondFloatsIsCounted) {
  TestScene scene;
  scene.files = std::make_shared<MemorySource>(std::map<std::string, std::string>{
      {"scene.xml",
       "<scene version=\"3.0.0\"><integrator type=\"path\"/>" + closed_sphere(1, 0.5, 1e37) + "</scene>"}});
  scene.main_key = "scene.xml";
  scene = statistical::read_scene(std::move(scene), 8, 8);
  for (const std::string& integrator : test::iteration_integrators()) {
    if (test::integrator_row(integrator).family() == "path") continue;  // starts no path at a lamp
    if (integrator == "erpt") continue;  // densities of its paths need no power: it loses nothing
    const TestScene own = statistical::with_integrator(scene, integrator);
    const auto renderer = statistical::make_renderer(own);
    const auto pilot = renderer->pilot({});
    ASSERT_TRUE(pilot.ok()) << pilot.error().to_string();
    auto output = renderer->make_output(pilot->state);
    const auto& film = output.film;
    test::EpochRun job(*renderer, *pilot);
    ASSERT_TRUE(job.run({Unit::Kind::iterations, 0, 0, 4}, output, {}).ok());
    std::uint64_t rejected = 0;
    for (const std::uint64_t n : film->sample_counts().rejected) rejected += n;
    EXPECT_GT(rejected, 0U) << integrator;
  }
}

// Claim: iterations whose indices differ in a high bit alone are different samples: no index is cut to 32
// bits on its way to a sampler.
TEST(HostileInput, HighBitsOfAnIndexCount) {
  TestScene scene;
  scene.files = std::make_shared<MemorySource>(std::map<std::string, std::string>{
      {"scene.xml", "<scene version=\"3.0.0\"><integrator type=\"path\"/>" +
                        perspective({0, 0, 3}, {0, 0, 0}, {0, 1, 0}, 40) + constant_sky(1) +
                        sphere({0, 0, 0}, 1, diffuse(0.5)) +
                        sphere({2, 2, 2}, 0.5, diffuse(0) + area_light(9)) + "</scene>"}});
  scene.main_key = "scene.xml";
  scene = statistical::read_scene(std::move(scene), 8, 8);
  for (const auto& integrator : kEveryone) {
    if (test::has_chains(integrator)) continue;  // their segments follow each other
    for (const char* sampler : {"sobol", "independent"}) {
      TestScene own = statistical::with_integrator(scene, integrator);
      own.settings.sampler = sampler;
      const NamedState state = statistical::pilot_state(own);
      const auto low = statistical::render_layers(own, state, 1, 0, 5, 2);
      for (const int bit : {16, 31, 32, 35, 38}) {
        const auto high = statistical::render_layers(own, state, 1, 0, 5 + (1ULL << bit), 2);
        EXPECT_NE(low, high) << integrator << " " << sampler << " bit " << bit;
      }
    }
  }
}

}  // namespace
}  // namespace candela::stress
