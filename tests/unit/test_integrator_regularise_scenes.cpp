// Mollified connections in scenes of several kinds of light: what has to stay as it is, to the bit.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/regularised_scenes.h"
#include "tests/unit/renderer_fixture.h"
#include "worker/transport/technique/mollify.h"

namespace candela::render::regularised_scenes {
namespace {

using test::camera;
using test::kMirror;
using test::square;

// Sums of the film of iterations [cuts[i], cuts[i + 1]), units of their own, in reverse order.
std::vector<std::int64_t> film_of(const test::SceneText& scene, const std::string& integrator,
                                  const SettingsMap& settings, const std::vector<std::uint64_t>& cuts) {
  const test::TextFiles files({{"scene.xml", "<scene version=\"3.0.0\"><integrator type=\"path\"/>" +
                                                 scene.sensor + scene.body + "</scene>"}});
  JobSettings job;
  job.integrator = integrator;
  job.width = job.height = 8;
  const auto renderer = test::make_renderer(files, job, settings);
  const NamedState state = test::state_at(*renderer, test::kFilmScaleLog2);
  std::vector<std::int64_t> sums;
  for (std::size_t i = cuts.size() - 1; i-- > 0;) {
    auto output = renderer->make_output(state);
    const auto done =
        renderer->run({Unit::Kind::iterations, 0, cuts[i], cuts[i + 1]}, {state, {}, {}}, output, {1});
    if (!done.ok()) throw std::runtime_error(done.error().to_string());
    const film::Layout& layout = output.film->layout();
    const std::size_t values = layout.pixel_count() * layout.layers * film::kChannels;
    sums.resize(values);
    for (std::size_t v = 0; v < values; ++v) sums[v] += output.film->sums()[v];
  }
  return sums;
}
bool any_light(const std::vector<std::int64_t>& film) {
  return std::ranges::any_of(film, [](std::int64_t v) { return v > 0; });
}

// Claim: a camera that sees matt surfaces alone has a technique of bidirectional path tracing for every path,
// although lamps are points, and light meets mirrors and glass at every second bounce: the film is the same
// with the option on, to the bit.
TEST(RegularisedScenes, EyesThatSeeMattSurfacesLoseNothing) {
  const test::SceneText scene{
      camera({0, 0.2, 1.5}, {0, -1, -0.6}, 40),
      square({0, -1, 0}, {0, 1, 0}, 3, R"(<bsdf type="diffuse"/>)") +
          square({-2.5, 0, 0}, {1, 0.1, 0}, 1, kMirror) +
          R"(<shape type="sphere"><point name="center" x="0.5" y="0.8" z="-0.4"/><float name="radius" value="0.4"/>
               <bsdf type="dielectric"/></shape>
             <shape type="sphere"><point name="center" x="0" y="-0.7" z="0.4"/><float name="radius" value="0.3"/>
               <bsdf type="diffuse"/></shape>
             <emitter type="point"><point name="position" x="1" y="2" z="-0.5"/></emitter>
             <emitter type="directional"><vector name="direction" x="0.3" y="-1" z="0.2"/></emitter>)"};
  const SettingsMap on = {{"regularise", "on"}, {"regularise_radius", "0.3"}, {"max_depth", "5"}};
  const auto off = film_of(scene, "bdpt", {{"max_depth", "5"}, {"plan", "full"}}, {0, 64});
  SettingsMap full = on;
  full["plan"] = "full";
  EXPECT_EQ(film_of(scene, "bdpt", full, {0, 64}), off);
  EXPECT_TRUE(any_light(off));
  // The option is not idle: path tracing has no technique for the caustics.
  EXPECT_NE(film_of(scene, "path", on, {0, 64}), film_of(scene, "path", {{"max_depth", "5"}}, {0, 64}));
}

// Claim: in all of its cone a lobe has its attenuation, whatever the angles: the cosine at the mollified
// vertex is that of the connection, which cancels. [regularisation note, section 4]
TEST(RegularisedScenes, CosineOfTheConnectionCancels) {
  const Vec3d lobe = normalize(Vec3d(0.8, 0, 0.6));
  scene::TurningLobes lobes;
  lobes.lobes[lobes.count++] = {Vec3(lobe), Spectrum(0.75f)};
  const transport::Mollifier mollifier(0.5);
  int inside = 0;
  for (const double up : {-0.6, -0.3, 0.0, 0.3, 0.6}) {
    const Vec3d to = lobe * 1.25 + Vec3d(-0.6, 0, 0.8) * up;
    const Spectrum value = transport::lobes_towards(lobes, {0, 0, 1}, to, mollifier);
    const bool hit = std::abs(up) < 0.5;
    EXPECT_FLOAT_EQ(value.g, hit ? 0.75f : 0.0f) << up;
    inside += hit ? 1 : 0;
  }
  EXPECT_EQ(inside, 3);
}

// Claim: chains of erpt have the radius of their iteration's index in the job: units cut and ordered anyhow
// have the same film.
TEST(RegularisedScenes, FilmsOfErptDoNotDependOnUnits) {
  const test::SceneText scene = test::scene_t(30);
  const SettingsMap settings{
      {"regularise", "on"}, {"regularise_radius", "0.2"}, {"direct", "chain"}, {"max_depth", "3"}};
  const auto whole = film_of(scene, "erpt", settings, {0, 32});
  EXPECT_EQ(whole, film_of(scene, "erpt", settings, {0, 1, 2, 17, 32}));
  EXPECT_TRUE(any_light(whole));
}

}  // namespace
}  // namespace candela::render::regularised_scenes
