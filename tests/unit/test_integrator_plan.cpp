// The plan says what a kernel leaves out, and why.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <tuple>
#include <utility>

#include "tests/unit/renderer_fixture.h"
#include "tests/unit/volume_file.h"

namespace candela::render {
namespace {

std::unique_ptr<Renderer> renderer_of(const std::string& body, const std::string& integrator,
                                      const SettingsMap& chosen) {
  const test::TextFiles files(
      {{"scene.xml", std::string("<scene version=\"3.0.0\"><integrator type=\"path\"/>") +
                         (body.starts_with("<sensor") ? "" : "<sensor type=\"perspective\"/>") + body +
                         "</scene>"},
       {"v.vol", test::volume_file({1, 1, 1}, 1, {1})}});
  JobSettings job;
  job.integrator = integrator;
  job.width = job.height = 4;
  SettingsMap settings = chosen;
  // A first stage of few samples. It has none of what the tests look for.
  if (integrator == "pssmlt" || integrator == "mmlt") settings.emplace("bootstrap", "1000");
  return test::make_renderer(files, job, settings);
}

std::string plan_of(const std::string& body, const std::string& integrator = "path",
                    const SettingsMap& chosen = {}) {
  return renderer_of(body, integrator, chosen)->plan_text().value();
}

bool says(const std::string& plan, const std::string& line) {
  return plan.find(line + "\n") != std::string::npos;
}

// Claim: media and straight passes run only where the scene has them, and a scene of nothing but glass and
// fog samples light from the fog.
TEST(IntegratorPlan, LeavesOutMediaAndStraightPasses) {
  const std::string lamp = "<shape type=\"sphere\"><emitter type=\"area\"/></shape>";
  const std::string plain = plan_of(lamp + "<shape type=\"cube\"/>");
  EXPECT_TRUE(says(plain, "skip media: there is none")) << plain;
  EXPECT_TRUE(says(plain, "skip light through surfaces straight on: no surface lets light pass straight"))
      << plain;
  const std::string mask =
      plan_of(lamp + "<shape type=\"cube\"><bsdf type=\"mask\"><bsdf type=\"diffuse\"/></bsdf></shape>");
  EXPECT_TRUE(says(mask, "skip media: there is none")) << mask;
  EXPECT_TRUE(
      says(mask, "use  light through surfaces straight on: some surface is null, a mask or thin glass"))
      << mask;
  const std::string fog = plan_of(lamp +
                                  "<shape type=\"cube\"><bsdf type=\"dielectric\"/><medium name=\"interior\" "
                                  "type=\"homogeneous\"/></shape>");
  EXPECT_TRUE(says(fog, "use  media: homogeneous: free flights and transmittance in closed form")) << fog;
  EXPECT_TRUE(
      says(fog, "use  next event estimation: emitters can be sampled from points in media and from surfaces"))
      << fog;
  EXPECT_TRUE(says(fog, "media: 1")) << fog;
  const std::string cloud = plan_of(
      lamp +
      "<shape type=\"cube\"><medium name=\"interior\" type=\"heterogeneous\"><volume name=\"sigma_t\" "
      "type=\"gridvolume\"><string name=\"filename\" value=\"v.vol\"/></volume></medium></shape>");
  EXPECT_TRUE(
      says(cloud, "use  media: free flights by delta tracking, transmittance by residual ratio tracking"))
      << cloud;
  EXPECT_TRUE(says(cloud, "media: 1, not all homogeneous")) << cloud;
}

// Claim: a plan notes light that is found by luck or never, with an integrator that finds it; not where no
// surface bends light, where all do, where paths are too short, or where merging finds it.
TEST(IntegratorPlan, NotesLightFoundByLuck) {
  const std::string lamp = "<shape type='sphere'><emitter type='area'/></shape>",
                    point = "<emitter type='point'/>", matt = "<shape type='cube'/>",
                    glass = "<shape type='sphere'><bsdf type='dielectric'/></shape>",
                    mask = "<shape type='cube'><bsdf type='mask'><bsdf type='diffuse'/></bsdf></shape>";
  const auto luck = [](const std::string& plan) {
    return plan.find("note light found by luck: ") != std::string::npos;
  };
  const auto missing = [](const std::string& plan) {
    return plan.find("note light that is missing: ") != std::string::npos;
  };
  for (const char* integrator : {"path", "optimis", "bdpt", "mmlt"}) {
    const std::string area = plan_of(lamp + matt + glass, integrator);
    EXPECT_TRUE(luck(area) && !missing(area)) << integrator << area;
    EXPECT_NE(area.find(integrator == std::string("bdpt") ? "; vcm finds it" : "finds it"),
              std::string::npos);
    const std::string dots = plan_of(point + matt + glass, integrator);
    EXPECT_TRUE(missing(dots) && !luck(dots)) << integrator << dots;
    // The other way out, of integrators that have it.
    const bool blurs = integrator != std::string("optimis");
    EXPECT_EQ(dots.find("take vcm") != std::string::npos && dots.find("regularise=on") != std::string::npos,
              blurs)
        << dots;
    if (blurs) {
      EXPECT_FALSE(missing(plan_of(point + matt + glass, integrator, {{"regularise", "on"}})));
    }
    for (const std::string& body : {lamp + matt, lamp + mask, glass + lamp.substr(0, 0)}) {
      const std::string plan = plan_of(body, integrator);
      EXPECT_FALSE(luck(plan) || missing(plan)) << integrator << plan;
    }
  }
  // Lamps in mirrors alone.
  for (const char* integrator : {"path", "bdpt", "mmlt"}) {
    const std::string plan = plan_of(point + glass, integrator);
    EXPECT_TRUE(missing(plan)) << plan;
    EXPECT_NE(plan.find("no integrator finds it; give regularise=on"), std::string::npos) << plan;
    EXPECT_FALSE(missing(plan_of(point + glass, integrator, {{"regularise", "on"}})));
    EXPECT_FALSE(missing(plan_of(point + glass, integrator, {{"max_depth", "1"}})));
  }
  // A lens with an area, which light paths meet by luck: eye paths do not profit.
  const std::string lens = "<sensor type='thinlens'><float name='aperture_radius' value='0.1'/></sensor>";
  for (const char* integrator : {"bdpt", "mmlt"}) {
    const std::string plan = plan_of(lens + point + matt + glass, integrator);
    EXPECT_TRUE(luck(plan) && !missing(plan)) << integrator << plan;
    EXPECT_NE(plan.find("happens to hit the lens"), std::string::npos) << plan;
    EXPECT_FALSE(missing(plan_of(lens + point + glass, integrator)));
  }
  EXPECT_TRUE(missing(plan_of(lens + point + matt + glass, "path")));
  EXPECT_FALSE(missing(plan_of(lamp + glass, "bdpt")));
  EXPECT_TRUE(luck(plan_of(lamp + matt + glass, "path", {{"max_depth", "3"}})));
  EXPECT_FALSE(luck(plan_of(lamp + matt + glass, "path", {{"max_depth", "2"}})));
  EXPECT_FALSE(luck(plan_of(lamp + matt + glass, "bdpt", {{"max_depth", "3"}})));
  for (const char* integrator : {"vcm", "ppm"}) {
    const std::string plan = plan_of(lamp + point + matt + glass, integrator);
    EXPECT_FALSE(luck(plan) || missing(plan)) << plan;
  }
}

// A fog of one mean free path a unit in null walls, under a sky.
std::string fog(double size, double albedo, double mean_cosine = 0) {
  return fmt::format(
      "<emitter type=\"constant\"/><shape type=\"cube\"><transform name=\"to_world\"><scale "
      "value=\"{}\"/></transform><bsdf type=\"null\"/><medium name=\"interior\" type=\"homogeneous\">"
      "<rgb name=\"albedo\" value=\"{}\"/><phase type=\"hg\"><float name=\"g\" "
      "value=\"{}\"/></phase></medium></shape>",
      size / 2, albedo, mean_cosine);
}

constexpr std::string_view kNote = "note media: up to ";

// Claim: only `path` says that it traces a shadow ray for each group of lights, as it alone does, and only
// where a lamp stands beside an uneven environment.
TEST(IntegratorPlan, SaysWhoTracesARayForEachGroup) {
  const std::string cube = "<shape type=\"cube\"/>", sun = "<emitter type=\"sunsky\"/>",
                    lamp = "<emitter type=\"point\"/>",
                    line = "a shadow ray to lamps and one to the environment";
  const auto has = [&](const std::string& body, const std::string& integrator, const SettingsMap& chosen) {
    return plan_of(body, integrator, chosen).find(line) != std::string::npos;
  };
  EXPECT_TRUE(has(cube + sun + lamp, "path", {}));
  EXPECT_FALSE(has(cube + sun + lamp, "path", {{"plan", "full"}}));
  EXPECT_FALSE(has(cube + sun, "path", {}));
  EXPECT_FALSE(has(cube + "<emitter type=\"constant\"/>" + lamp, "path", {}));
  for (const auto& [integrator, chosen] : {std::pair<std::string, SettingsMap>{"pssmlt", {{"over", "path"}}},
                                           {"pssmlt", {}},
                                           {"mmlt", {}},
                                           {"optimis", {}},
                                           {"optimis", {{"depth", "full"}}},
                                           {"bdpt", {}},
                                           {"vcm", {}}})
    EXPECT_FALSE(has(cube + sun + lamp, integrator, chosen)) << integrator;
}

// Claim: whoever's walks roulette ends in a thick white medium says so, and nobody else does, nor where it
// does not matter.
TEST(IntegratorPlan, NotesMediaInWhichRouletteHurts) {
  for (const char* integrator : {"light", "bdpt", "ppm", "bpm", "vcm", "pssmlt"}) {
    SCOPED_TRACE(integrator);
    const std::string thick = plan_of(fog(100, 1), integrator);
    EXPECT_NE(thick.find("note media: up to 100 mean free paths across"), std::string::npos) << thick;
    EXPECT_NE(plan_of(fog(100, 1), integrator, {{"plan", "full"}}).find(kNote), std::string::npos);
    EXPECT_EQ(plan_of(fog(100, 1), integrator, {{"max_depth", "30"}}).find(kNote), std::string::npos);
    EXPECT_EQ(plan_of(fog(100, 0.9), integrator).find(kNote), std::string::npos);
    EXPECT_EQ(plan_of(fog(5, 1), integrator).find(kNote), std::string::npos);
    EXPECT_EQ(plan_of(fog(38, 1), integrator).find(kNote), std::string::npos);
    EXPECT_NE(plan_of(fog(46, 1), integrator).find(kNote), std::string::npos);
  }
  EXPECT_NE(plan_of(fog(100, 1), "mmlt", {{"rr_depth", "2"}}).find(kNote), std::string::npos);
  EXPECT_EQ(plan_of(fog(100, 1)).find(kNote), std::string::npos);
  EXPECT_EQ(plan_of(fog(100, 1), "pssmlt", {{"over", "path"}}).find(kNote), std::string::npos);
}

// Claim: the medium's box is that of the shapes around it, flat ones together; outside of
// them it has no end.
TEST(IntegratorPlan, LastingMediaFillTheirShapes) {
  const auto thickness = [](const std::string& body) {
    return static_cast<double>(
        renderer_of("<emitter type=\"constant\"/>" + body, "bdpt", {})->features()->lasting_thickness);
  };
  const std::string medium = "<bsdf type=\"null\"/><medium name=\"{}\" type=\"homogeneous\"/>";
  const auto shape = [&](const char* plugin, const char* side, const char* transform) {
    return fmt::format("<shape type=\"{}\"><transform name=\"to_world\">{}</transform>{}</shape>", plugin,
                       transform, fmt::format(fmt::runtime(medium), side));
  };
  const std::string ball = shape("sphere", "interior", "<scale value=\"3\"/><translate x=\"50\"/>");
  EXPECT_NEAR(thickness(ball), 6, 1e-5);
  EXPECT_NEAR(thickness(ball + shape("sphere", "interior", "<scale value=\"4\"/>")), 8, 1e-5);
  EXPECT_TRUE(std::isinf(thickness(shape("sphere", "exterior", ""))));
  // Floor and ceiling of a tank share one medium object.
  const std::string tank =
      "<medium type=\"homogeneous\" id=\"water\"/>" +
      fmt::format(
          "<shape type=\"rectangle\"><bsdf type=\"null\"/><transform name=\"to_world\"><scale "
          "value=\"10\"/></transform><ref id=\"water\" name=\"interior\"/></shape>"
          "<shape type=\"rectangle\"><bsdf type=\"null\"/><transform name=\"to_world\"><scale "
          "value=\"10\"/><translate z=\"-7\"/></transform><ref id=\"water\" "
          "name=\"interior\"/></shape>");
  EXPECT_NEAR(thickness(tank + "<shape type=\"sphere\"><transform name=\"to_world\"><scale value=\"30\"/>"
                               "</transform></shape>"),
              7, 1e-5);
}

// Claim: of a long walk in a box so much is left after each scattering, to a tenth of what is lost, to a
// quarter where scattering goes forward.
TEST(IntegratorPlan, LastingFractionIsThatOfWalks) {
  for (const auto& [size, mean_cosine, from, to, error] :
       {std::tuple{10.0, 0.0, 15, 40, 0.1}, std::tuple{4.0, 0.0, 6, 14, 0.1},
        std::tuple{20.0, 0.7, 30, 90, 0.25}}) {
    SCOPED_TRACE(fmt::format("{} mean free paths, g = {}", size, mean_cosine));
    const auto phase = scene::Phase::henyey_greenstein(static_cast<float>(mean_cosine));
    rng::Stream stream(rng::key(7, 1));
    int early = 0, late = 0;
    for (int walk = 0; walk < 40'000; ++walk) {
      Vec3 p{0, 0, 0}, d = test::uniform_direction(stream);
      const float half = static_cast<float>(size / 2);
      for (int n = 0; n < to; ++n) {
        p = p + d * -std::log(1 - stream.next_float());
        if (std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) > half) break;
        if (n + 1 == from) ++early;
        if (n + 1 == to) ++late;
        Vec3 next;
        const float u = stream.next_float();
        phase.sample(-d, {u, stream.next_float()}, next);
        d = next;
      }
    }
    ASSERT_GT(late, 300);
    const double measured = -std::log(static_cast<double>(late) / early) / (to - from);
    const double said = -std::log(static_cast<double>(
        renderer_of(fog(size, 1, mean_cosine), "bdpt", {})->features()->lasting_fraction));
    EXPECT_NEAR(said / measured, 1, error) << said << " for " << measured;
  }
}

}  // namespace
}  // namespace candela::render
