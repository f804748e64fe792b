// Furnaces: closed rooms whose walls reflect half of the light and emit the other half, with fog, glass and
// glossy walls that absorb nothing. Radiance is 1 everywhere, whatever is in them, so that every weight,
// count and kernel that is not right shows as brightness. Merging alone is darker: the kernel of a photon
// near a wall, or near the end of its medium, reaches beyond it.
//
// Means of whole images; a test alarms falsely with probability below 1e-6 a mean (5 standard errors and the
// bias allowed), were the seeds drawn anew.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"Furnace.FogInEveryListOfUpbp", "Furnace.GlassInFog",
                                  "Furnace.GlassAndAGlossyFloor", "Furnace.NearDeltaLobes",
                                  "Furnace.NearDeltaLobesInARoom"});

constexpr const char* kMatt = R"(<bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>)";

std::string wall(const char* matrix, const std::string& bsdf, double emission) {
  return fmt::format(
      R"(<shape type="rectangle"><transform name="to_world"><matrix value="{}"/></transform>{}
         <emitter type="area"><rgb name="radiance" value="{}"/></emitter></shape>)",
      matrix, bsdf, emission);
}

// A room from -1 to 1 in x and y and 0 to 1.2 in z, with white fog of colors around the camera if `fog`. The
// floor has a bsdf of its own. contents: what else is in it.
TestScene furnace(bool fog, const std::string& floor, const std::string& contents, std::uint32_t size = 12,
                  const std::string& walls = kMatt, double emission = 0.5) {
  std::string body =
      R"(<medium id="fog" type="homogeneous"><rgb name="sigma_t" value="1.5, 0.7, 0.2"/><rgb name="albedo" value="1"/>
           <phase type="hg"><float name="g" value="0.6"/></phase></medium>)";
  body += fmt::format(
      R"(<sensor type="perspective"><float name="fov" value="60"/>{}<transform name="to_world">
           <lookat origin="0.3, -0.9, 0.6" target="0, 0.4, 0.5" up="0, 0, 1"/></transform></sensor>)",
      fog ? R"(<ref name="medium" id="fog"/>)" : "");
  body += wall("1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", floor, emission) +
          wall("1 0 0 0 0 -1 0 0 0 0 -1 1.2 0 0 0 1", walls, emission) +
          wall("0 0 1 -1 1 0 0 0 0 0.6 0 0.6 0 0 0 1", walls, emission) +
          wall("0 0 -1 1 -1 0 0 0 0 0.6 0 0.6 0 0 0 1", walls, emission) +
          wall("1 0 0 0 0 0 -1 1 0 0.6 0 0.6 0 0 0 1", walls, emission) +
          wall("-1 0 0 0 0 0 1 -1 0 0.6 0 0.6 0 0 0 1", walls, emission);
  if (fog)
    body +=
        R"(<shape type="cube"><transform name="to_world"><scale x="0.98" y="0.98" z="0.58"/><translate z="0.6"/></transform>
             <bsdf type="null"/><ref name="interior" id="fog"/></shape>)";
  return scene_from_xml(
      "<scene version=\"3.0.0\"><integrator type=\"volpath\"/>" + body + contents + "</scene>", size, size);
}

struct Mean {
  double mean = 0, error = 0;
};
Mean mean_of(const TestScene& scene, std::uint64_t iterations, std::uint64_t seed = 3) {
  constexpr std::size_t kBatches = 8;
  double sum = 0, squares = 0;
  for (const auto& batch : render_batches(scene, seed, kBatches, iterations)) {
    double of_batch = 0;
    for (const float value : batch)
      of_batch += static_cast<double>(value) / static_cast<double>(batch.size());
    sum += of_batch / kBatches;
    squares += of_batch * of_batch / kBatches;
  }
  return {sum, std::sqrt(std::max(squares - sum * sum, 0.0) / (kBatches - 1))};
}

// bias: by how much kernels at borders may darken the image.
void expect_one(const TestScene& scene, std::uint64_t iterations, double bias, double largest_error,
                const std::string& what) {
  const Mean found = mean_of(scene, iterations);
  std::printf("%-72s %.4f +- %.4f\n", what.c_str(), found.mean, found.error);
  EXPECT_LE(found.error, largest_error) << what;
  EXPECT_LE(found.mean, 1 + 5 * found.error) << what;
  EXPECT_GE(found.mean, 1 - bias - 5 * found.error) << what;
}

// How much darker merging alone may be, at a radius over that of the room's sphere: borders lose a share of
// the order of the radius over the room's width, in fog and at its end.
double border(double radius) {
  return 0.05 * radius / 0.1;
}

// Claim: in white fog every list of upbp has radiance 1, at two radii, with short and long beams, few
// connections, and without merging on surfaces.
TEST(Furnace, FogInEveryListOfUpbp) {
  struct Row {
    const char* techniques;
    SettingsMap more = {};
  };
  const std::vector<Row> rows = {{"pp3d"},
                                 {"pb2d"},
                                 {"bp2d"},
                                 {"bb1d"},
                                 {"pp3d,pb2d"},
                                 {"bp2d,bb1d"},
                                 {"pp3d,pb2d,bp2d,bb1d"},
                                 {"vcm,pp3d"},
                                 {"vcm,pb2d"},
                                 {"vcm,bp2d"},
                                 {"vcm,bb1d"},
                                 {"vcm,pp3d,pb2d"},
                                 {"all"},
                                 {"all", {{"plan", "full"}}},
                                 {"all", {{"connect_media", "0.125"}}},
                                 {"all", {{"merge_surfaces", "false"}}},
                                 {"pb2d", {{"query_beams", "long"}}},
                                 {"bp2d", {{"photon_beams", "long"}}},
                                 {"bb1d", {{"query_beams", "long"}, {"photon_beams", "long"}}},
                                 {"all", {{"query_beams", "long"}, {"photon_beams", "long"}}},
                                 {"auto"}};
  const TestScene scene = furnace(true, kMatt, "");
  for (const double radius : {0.1, 0.03})
    for (const Row& row : rows) {
      SettingsMap settings = {
          {"techniques", row.techniques}, {"radius", fmt::format("{}", radius)}, {"alpha", "1"}};
      settings.insert(row.more.begin(), row.more.end());
      std::string what = fmt::format("upbp {} radius {}", row.techniques, radius);
      for (const auto& [name, value] : row.more) what += fmt::format(" {}={}", name, value);
      expect_one(with_integrator(scene, "upbp", settings), 12, border(radius), 0.01, what);
    }
}

// The integrators that weigh or merge, and what each runs with. Chains bring shares of bdpt and path.
std::vector<std::pair<std::string, SettingsMap>> integrators(const std::string& radius) {
  const SettingsMap none, merges = {{"radius", radius}, {"alpha", "1"}};
  const SettingsMap adapts = {{"radius", radius}};
  return {{"path", none},
          {"bdpt", none},
          {"optimis", none},
          {"bpm", merges},
          {"vcm", merges},
          {"ppm", merges},
          {"vcmplus", merges},
          {"appm", adapts},
          {"cppm", adapts},
          {"fppm", adapts},
          {"upbp", merges},
          {"upbp", {{"radius", radius}, {"alpha", "1"}, {"techniques", "all"}}},
          {"upbp", {{"radius", radius}, {"alpha", "1"}, {"techniques", "pp3d,pb2d,bp2d,bb1d"}}}};
}

// The family of ppm finds lamps by luck: its noise is that of few photons.
bool merges_alone(const std::string& name) {
  return name == "ppm" || name == "appm" || name == "cppm" || name == "fppm";
}

void expect_one_in_all(const TestScene& scene, double radius, std::uint64_t iterations, double loss,
                       double largest_error, const std::string& what, bool merging_alone = false) {
  for (const auto& [name, settings] : integrators(fmt::format("{}", radius))) {
    const bool merges = settings.contains("radius");
    if (merging_alone && !merges) continue;
    const auto techniques = settings.find("techniques");
    expect_one(with_integrator(scene, name, settings), iterations, loss + (merges ? border(radius) : 0),
               merges_alone(name) ? 0.05 : largest_error,
               fmt::format("{}: {} {}", what, name,
                           techniques == settings.end() ? std::string() : techniques->second));
  }
}

constexpr const char* kGlassBall =
    R"(<shape type="sphere"><point name="center" x="-0.3" y="0.2" z="0.5"/><float name="radius" value="0.3"/>
         <bsdf type="dielectric"/>{}</shape>)";

// Claim: a ball of glass in the room, in fog and filled with it, disappears, for all integrators.
TEST(Furnace, GlassInFog) {
  const std::string ball =
      fmt::format(kGlassBall, R"(<ref name="exterior" id="fog"/><ref name="interior" id="fog"/>)");
  expect_one_in_all(furnace(true, kMatt, ball), 0.05, 12, 0, 0.015, "glass in fog");
}

// Claim: a glossy floor and a ball of glass disappear, for all integrators. What facets shadow is lost: below
// 1 % for a roughness of 0.1, as path finds.
TEST(Furnace, GlassAndAGlossyFloor) {
  const std::string glossy =
      R"(<bsdf type="roughconductor"><string name="material" value="none"/><float name="alpha" value="0.1"/>
           <rgb name="specular_reflectance" value="0.5"/></bsdf>)";
  expect_one_in_all(furnace(false, glossy, fmt::format(kGlassBall, "")), 0.05, 24, 0.01, 0.02,
                    "glass and a glossy floor");
}

// Lobes narrower than what photons in a disc can find: a floor of this roughness, and a ball of glass that
// bends light by next to nothing, of which photons in a straight line are part of the lobe alone.
std::string near_delta_floor(const char* distribution, double alpha, double reflectance) {
  return fmt::format(
      R"(<bsdf type="roughconductor"><string name="material" value="none"/><string name="distribution" value="{}"/>
           <float name="alpha" value="{}"/><rgb name="specular_reflectance" value="{}"/></bsdf>)",
      distribution, alpha, reflectance);
}
constexpr const char* kMatchedBall =
    R"(<shape type="sphere"><point name="center" x="-0.1" y="0.2" z="0.7"/><float name="radius" value="0.3"/>
         <bsdf type="roughdielectric"><float name="int_ior" value="1.0001"/><float name="ext_ior" value="1"/>
           <float name="alpha" value="0.1"/></bsdf></shape>)";

// Claim: a floor of roughness 1e-4 and rough glass of index 1.0001 disappear in the furnace for all that
// merge.
TEST(Furnace, NearDeltaLobes) {
  for (const char* distribution : {"beckmann", "ggx"})
    expect_one_in_all(furnace(false, near_delta_floor(distribution, 1e-4, 0.5), kMatchedBall), 0.05, 12, 0,
                      0.02, fmt::format("near-delta, {}", distribution), true);
}

// A room without emission but for its lamps, with such a floor and ball.
TestScene room(double alpha, const std::string& lamps) {
  return furnace(false, near_delta_floor("ggx", alpha, 0.9), kMatchedBall + lamps, 12,
                 R"(<bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf>)", 0);
}
constexpr const char* kLamp =
    R"(<shape type="rectangle"><transform name="to_world"><matrix value="0.4 0 0 0 0 -0.4 0 0 0 0 -1 1.19 0 0 0 1"/></transform>
         <emitter type="area"><rgb name="radiance" value="4"/></emitter></shape>)";
constexpr const char* kPoint =
    R"(<emitter type="point"><point name="position" x="0.2" y="0.5" z="0.9"/><rgb name="intensity" value="1"/></emitter>)";

// Claim: in a room with a lamp that walks meet, with a point lamp, whose highlight on the floor photons alone
// can find, and with both, all that merge agree with bdpt (path misses a point lamp's light through the
// ball), at roughness 1e-4 and 0.02, where only the middle of the lobe is narrow.
TEST(Furnace, NearDeltaLobesInARoom) {
  struct Row {
    double alpha;
    const char *lamp, *point, *what;
  };
  // Where the second row fails, the rows of the long form tell which of its lamps it is.
  std::vector<Row> rows = {{1e-4, kLamp, "", "lamp, 1e-4"}, {0.02, kLamp, kPoint, "both, 0.02"}};
  const char* form = std::getenv("CANDELA_LONG");
  if (form != nullptr && std::string(form) == "1")
    rows.insert(rows.end(), {{0.02, kLamp, "", "lamp, 0.02"}, {0.02, "", kPoint, "point, 0.02"}});
  for (const Row& row : rows) {
    const TestScene scene = room(row.alpha, std::string(row.lamp) + row.point);
    const Mean truth = mean_of(with_integrator(scene, "bdpt"), 256);
    EXPECT_LE(truth.error, 0.01 * truth.mean);
    for (const auto& [name, settings] : integrators("0.03")) {
      if (!settings.contains("radius") || settings.contains("techniques")) continue;
      SettingsMap more = settings;
      // Few photons lie in the rest of such a lobe, and each is bright.
      if (merges_alone(name)) more["light_paths"] = "64";
      const Mean found = mean_of(with_integrator(scene, name, more), 48);
      const double error = std::hypot(found.error, truth.error) / truth.mean;
      std::printf("%-20s %-8s over bdpt %.4f +- %.4f\n", row.what, name.c_str(), found.mean / truth.mean,
                  error);
      EXPECT_LE(error, 0.04) << name << ' ' << row.what;
      EXPECT_NEAR(found.mean / truth.mean, 1, 5 * error + 0.02) << name << ' ' << row.what;
    }
  }
}

// The mean of the image, and the count of walks that the bound ended. A scale of the film that is known
// spares the pilot, whose walks are as long.
struct Bounded {
  double mean = 0;
  std::uint64_t walks = 0;
};
Bounded bounded(const TestScene& scene, std::uint64_t iterations) {
  constexpr int kScale = 24;
  const auto renderer = make_renderer(scene);
  auto output = renderer->make_output(NamedState{kScale, 0});
  EXPECT_TRUE(renderer->run({Unit::Kind::iterations, 0, 0, iterations}, {}, output, {}).ok());
  const std::size_t values = output.film->layout().pixel_count() * 3;
  double sum = 0;
  for (std::size_t i = 0; i < values; ++i) sum += static_cast<double>(output.film->sums()[i]);
  return {std::ldexp(sum, -kScale) / static_cast<double>(iterations * values),
          output.film->sample_counts().bounded_walks};
}

// Claim: between walls of albedo .999 a third of the light has more edges than Russian roulette lets bright
// walks have (1,024). It is missing, and the walks that lost it are counted; with roulette from 4,096 edges
// on the light is there. Walls of albedo .5 end no walk so. The count is that of the share of light that is
// missing, .999^1023 = 0.36 of the light paths.
TEST(Furnace, WalksThatTheBoundEndsAreCounted) {
  const auto bright = [](const char* bsdf) { return furnace(false, bsdf, "", 8, bsdf, 0.001); };
  const TestScene scene = bright(R"(<bsdf type="diffuse"><rgb name="reflectance" value="0.999"/></bsdf>)");
  constexpr std::uint64_t kIterations = 4;
  const double paths = 8 * 8 * kIterations;
  for (const std::string name : {"light", "ppm", "bpm"}) {
    SCOPED_TRACE(name);
    // Each of bpm's eye walks merges at a thousand vertices.
    const SettingsMap merges =
        name == "light" ? SettingsMap{} : SettingsMap{{"radius", name == "ppm" ? "0.1" : "0.02"}};
    const Bounded found = bounded(with_integrator(scene, name, merges), kIterations);
    std::printf("%-6s %.3f, %.3f of the light paths are ended\n", name.c_str(), found.mean,
                static_cast<double>(found.walks) / paths);
    EXPECT_LT(found.mean, 0.9);  // bpm's paths have two walks of so many edges
    // The eye's walks of bpm are counted, too.
    const double most = name == "bpm" ? 2 : 1;
    EXPECT_GT(static_cast<double>(found.walks), 0.25 * paths);
    EXPECT_LT(static_cast<double>(found.walks), 0.5 * most * paths);
    EXPECT_EQ(bounded(with_integrator(furnace(false, kMatt, "", 8), name, merges), kIterations).walks, 0U);
  }
  const Bounded whole = bounded(with_integrator(scene, "light", {{"rr_depth", "4096"}}), kIterations);
  std::printf("light  %.3f with rr_depth=4096\n", whole.mean);
  EXPECT_NEAR(whole.mean, 1, 0.1);
  EXPECT_LT(static_cast<double>(whole.walks), 0.1 * paths);  // .999^4095 = 0.017
  // path's bound is 16,384 edges.
  EXPECT_EQ(bounded(with_integrator(scene, "path"), 1).walks, 0U);
  EXPECT_GT(
      bounded(with_integrator(
                  bright(R"(<bsdf type="diffuse"><rgb name="reflectance" value="0.9999"/></bsdf>)"), "path"),
              1)
          .walks,
      0U);
}

}  // namespace
}  // namespace candela::statistical
