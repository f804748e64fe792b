// Mollified connections through the renderer, in scenes whose light no technique of an integrator can sample
// and whose answers are known: the scenes of the theory's table (regularisation.csv) and what follows from
// them in closed form.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "tests/long_form.h"
#include "tests/regularised_scenes.h"
#include "tests/statistical/moments.h"
#include "tests/unit/renderer_fixture.h"
#include "tests/unit/shared_cases.h"
#include "worker/integrators/regularise.h"

namespace candela::render::regularised {
namespace {

using test::angle;
using test::camera;
using test::kMirror;
using test::mirrored;
using test::on_plane;
using test::point;
using test::square;

// A scene and the scale of its bandwidths: r = radius * the setting.
struct Built {
  std::string xml;
  double radius = 0;
};
Built built(const std::string& sensor, const std::string& body) {
  const auto scene = test::build_scene(body, {}, sensor);
  if (!scene.ok()) throw std::runtime_error(scene.error().to_string());
  return {fmt::format("<scene version=\"3.0.0\"><integrator type=\"path\"/>{}{}</scene>", sensor, body),
          static_cast<double>((*scene)->features().radius)};
}

struct Case {
  std::string integrator;
  std::uint64_t iterations;
  SettingsMap settings;
  std::uint32_t size = 8;
};
// The mean over the film, of batches with seeds of their own.
statistical::Moments measure(const Built& scene, const Case& one, double bandwidth, std::uint64_t batches) {
  const test::TextFiles files({{"scene.xml", scene.xml}});
  statistical::Moments mean;
  for (std::uint64_t batch = 0; batch < batches; ++batch) {
    JobSettings job;
    job.integrator = one.integrator;
    job.width = job.height = one.size;
    job.seed = 4500 + batch;
    job.sampler = "independent";
    SettingsMap settings = one.settings;  // win over these
    settings.insert({{"regularise", "on"},
                     {"regularise_radius", fmt::format("{}", bandwidth / scene.radius)},
                     {"regularise_exponent", "0"}});
    const auto renderer = test::make_renderer(files, job, settings);
    const auto film = test::render_film(*renderer, one.iterations);
    double sum = 0;
    const std::size_t pixels = std::size_t{one.size} * one.size;
    for (std::size_t i = 0; i < pixels; ++i) sum += static_cast<double>(film->sums()[3 * i + 1]);
    mean.add(std::ldexp(sum, -test::kFilmScaleLog2) /
             (static_cast<double>(pixels) * static_cast<double>(one.iterations)));
  }
  return mean;
}
void expect_mean(const statistical::Moments& measured, double expected, double most_relative_error,
                 const std::string& what) {
  const double error = measured.error();
  EXPECT_NEAR(measured.mean(), expected, 6 * error) << what << " +- " << error;
  EXPECT_LT(error, most_relative_error * expected) << what;
}

// A row of the table: scene M, M_close or M_steep at one bandwidth.
struct TableScene {
  std::map<std::string, std::string> row;
  double number(const std::string& name) const { return std::stod(row.at(name)); }
  Vec3d vector(const std::string& name) const {
    return {number(name + "_x"), number(name + "_y"), number(name + "_z")};
  }
  // Mirror B moved along its path, which stays as long, until both of its edges are equal.
  void balance() {
    const Vec3d y = vector("y"), nb = vector("mirrorB_n"),
                image = mirrored(vector("light"), vector("mirrorB_p"), nb), z = (y + image) * 0.5;
    const auto set = [&](const std::string& name, Vec3d p) {
      row[name + "_x"] = fmt::format("{:.17g}", p.x);
      row[name + "_y"] = fmt::format("{:.17g}", p.y);
      row[name + "_z"] = fmt::format("{:.17g}", p.z);
    };
    set("mirrorB_p", z);
    set("light", mirrored(image, z, nb));
  }
  // The spot reaches mirror B alone. closer: the pinhole's distance to mirror A, as a fraction of the
  // table's.
  Built build(double closer = 1) const {
    const Vec3d y = vector("y"), light = vector("light"), b = vector("mirrorB_p"), nb = vector("mirrorB_n"),
                a = vector("mirrorA_p"), na = vector("mirrorA_n"), direction = vector("pixel_dir");
    const Vec3d z = on_plane(y, mirrored(light, b, nb) - y, b, nb);
    const Vec3d at_a = on_plane(vector("pinhole"), direction, a, na);
    const double cutoff = 0.9 * std::min({angle(y - light, z - light), angle(at_a - light, z - light), 60.0});
    return built(
        camera(at_a + (vector("pinhole") - at_a) * closer, direction, 0.02),
        square(at_a, -na, 0.2, kMirror) + square(z, nb, 3, kMirror) +
            square(y, {0, 0, 1}, 0.1,
                   fmt::format("<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"{}\"/></bsdf>",
                               row.at("albedo"))) +
            fmt::format("<emitter type=\"spot\"><rgb name=\"intensity\" value=\"{}\"/><float "
                        "name=\"cutoff_angle\" value=\"{}\"/><float name=\"beam_width\" value=\"{}\"/>"
                        "<transform name=\"to_world\"><lookat origin=\"{}\" target=\"{}\" "
                        "up=\"0.1,0.2,1\"/></transform></emitter>",
                        row.at("intensity"), cutoff, cutoff * 0.99, point(light), point(z)));
  }
};
std::vector<TableScene> table_scenes(double bandwidth_over_length) {
  std::ifstream file(test::shared_path() / "theory" / "regularisation.csv");
  const auto fields = [](const std::string& line) {
    std::vector<std::string> list;
    std::stringstream stream(line);
    for (std::string field; std::getline(stream, field, ',');) list.push_back(field);
    return list;
  };
  std::vector<TableScene> scenes;
  std::string line;
  if (!std::getline(file, line)) return scenes;
  const auto header = fields(line);
  while (std::getline(file, line)) {
    TableScene scene;
    const auto values = fields(line);
    for (std::size_t i = 0; i < values.size(); ++i) scene.row[header[i]] = values[i];
    if (std::abs(scene.number("r") / scene.number("dist_mirror_light") - bandwidth_over_length) < 1e-9)
      scenes.push_back(scene);
  }
  EXPECT_FALSE(scenes.empty()) << "the table is there, but has no scene of this bandwidth";
  return scenes;
}

// Claim: path tracing shows a point light over a mirror, a matt floor and another mirror as bright as
// quadrature says for this bandwidth: with the cosine of the connection, and K / l^2 for its distance. The
// cosine of the sampled direction would make 2 to 6 % more, which the long form sees.
TEST(RegularisedPath, MeetsTheTable) {
  const auto scenes = table_scenes(0.5);
  if (scenes.empty()) GTEST_SKIP() << "no regularisation.csv in " << test::shared_path() / "theory";
  for (const TableScene& scene : scenes) {
    const bool is_long = test::long_form();
    const std::uint64_t iterations = is_long ? 6000 : 400;
    const auto measured =
        measure(scene.build(), {"path", iterations, {{"max_depth", "4"}}}, scene.number("r"), 16);
    expect_mean(measured, scene.number("expected_connection_cosine"), is_long ? 0.008 : 0.03,
                scene.row.at("scene"));
  }
}

// Claim: bidirectional path tracing joins the ways to mollify this path so that the edge to the light, or
// that before it, whichever is longer, has it all: the bias at r / l = 0.3 is the theory's, -0.0200.
// [regularisation note, section 3]
TEST(RegularisedBdpt, LongestEdgeHasTheWholePath) {
  const auto scenes = table_scenes(0.5);
  if (scenes.empty()) GTEST_SKIP() << "no regularisation.csv in " << test::shared_path() / "theory";
  for (const TableScene& scene : scenes) {
    if (scene.row.at("scene") != "M_close") continue;
    const auto measured = measure(scene.build(0.2), {"bdpt", 300, {{"max_depth", "4"}}},
                                  0.3 * scene.number("dist_mirror_light"), 16);
    expect_mean(measured, scene.number("exact_radiance") * (1 - 0.02), 0.03, "M_close");
  }
}

// Claim: where both edges at the mirror are equally long, each of the two ways has about half of the paths
// and both have all: the bias at r / l = 0.3 is the theory's, -0.0192. [regularisation note, section 3]
TEST(RegularisedBdpt, EqualEdgesShareThePath) {
  const auto scenes = table_scenes(0.5);
  if (scenes.empty()) GTEST_SKIP() << "no regularisation.csv in " << test::shared_path() / "theory";
  for (TableScene scene : scenes) {
    if (scene.row.at("scene") != "M_close") continue;
    scene.balance();
    const auto measured =
        measure(scene.build(0.2), {"bdpt", 300, {{"max_depth", "4"}}}, 0.3 * scene.number("D") / 2, 16);
    expect_mean(measured, scene.number("exact_radiance") * (1 - 0.0192), 0.03, "tie");
  }
}

Built scene_t(double fov) {
  const test::SceneText text = test::scene_t(fov);
  return built(text.sensor, text.body);
}

// Claim: a lamp seen over two mirrors sends to the lens what its image does, for path tracing, which
// mollifies the mirror at the lamp, and for bidirectional path tracing, which mollifies that at the eye,
// whose edge is longer. The bias is that of a quarter of (r / l)^2.
TEST(Regularised, LampOverTwoMirrors) {
  const Built scene = scene_t(30);
  constexpr double r = 0.1;
  for (const auto& [integrator, length] :
       {std::pair{"path", test::SceneT::kBeforeB}, std::pair{"bdpt", test::SceneT::kBeforeA}}) {
    const auto measured = measure(scene, {integrator, 100, {{"max_depth", "3"}}, 24}, r, 12);
    const double flux = test::SceneT::kIntensity / (test::SceneT::kD * test::SceneT::kD) *
                        (1 - r * r / (4 * length * length));
    // The mean over the film's area is that over directions, weighted by 1 / cos^3 of the angle to its
    // middle; the disc lies in the middle.
    const double half = std::tan(15 * std::numbers::pi / 180);
    expect_mean(measured, flux / (4 * half * half), 0.03, integrator);
  }
}

// Claim: a medium in between passes its transmittance.
TEST(Regularised, LampOverTwoMirrorsInFog) {
  constexpr double kSigma = 0.3, r = 0.1;
  test::SceneText text = test::scene_t(30);
  const auto put = [](std::string& in, const std::string& before) {
    in.insert(in.find(before), "<ref id=\"fog\"/>");
  };
  put(text.sensor, "</sensor>");
  put(text.body, "</emitter>");
  text.sensor = fmt::format(
                    "<medium type=\"homogeneous\" id=\"fog\"><rgb name=\"sigma_t\" value=\"{}\"/><rgb "
                    "name=\"albedo\" value=\"0\"/></medium>",
                    kSigma) +
                text.sensor;
  const Built fog = built(text.sensor, text.body), clear = scene_t(30);
  for (const char* integrator : {"path", "bdpt"}) {
    const Case one{integrator, 50, {{"max_depth", "3"}}, 24};
    const auto dim = measure(fog, one, r, 12), bright = measure(clear, one, r, 12);
    const double passed = std::exp(-kSigma * test::SceneT::kD), ratio = dim.mean() / bright.mean();
    const double error = std::hypot(dim.error() / dim.mean(), bright.error() / bright.mean());
    EXPECT_NEAR(ratio / passed, 1, 6 * error + 0.01) << integrator;
    EXPECT_LT(error, 0.06) << integrator;
  }
}

// A lamp in glass under a flat boundary, seen from the air by way of a matt floor above it: `body` completes
// it. Index 1.5.
std::string glass_and_lamp() {
  return R"(<shape type="rectangle"><transform name="to_world"><scale value="6"/></transform>
      <bsdf type="dielectric"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf></shape>
    <emitter type="spot"><rgb name="intensity" value="4"/><float name="cutoff_angle" value="30"/>
      <float name="beam_width" value="29.5"/><transform name="to_world"><lookat origin="0.3,0.1,-1.2"
      target="0.4,0.15,0" up="0.1,1,0"/></transform></emitter>)";
}

// Claim: a floor right above a lamp in glass is as bright as it is: the eye's side of a refraction has the
// factor 1 / eta^2 of radiance, once. Without it 2.25 times the light. Seen from the floor at the height H
// the lamp, h below the boundary, has the irradiance I T / (h + eta H)^2.
TEST(RegularisedPath, RefractsWithTheFactorOfRadiance) {
  const Vec3d y(0.3, 0.1, 0.9), eye(-1.5, 0.2, 0.5);
  const Built scene = built(
      camera(eye, y - eye, 0.1),
      glass_and_lamp() + square(y, {0, 0, -1}, 0.15,
                                "<bsdf type=\"twosided\"><bsdf type=\"diffuse\"><rgb name=\"reflectance\" "
                                "value=\"0.5\"/></bsdf></bsdf>"));
  const double distance = 1.2 + 1.5 * 0.9, transmittance = 0.96;
  const double exact = 0.5 / std::numbers::pi * 4 * transmittance / (distance * distance);
  const auto measured = measure(scene, {"path", 300, {{"max_depth", "3"}}}, 0.24, 16);
  EXPECT_NEAR(measured.mean(), exact, 6 * measured.error() + 0.015 * exact) << measured.error();
  EXPECT_LT(measured.error(), 0.03 * exact);
}

// Claim: seen in a mirror, where bidirectional path tracing cannot sample it either, the same light is as
// bright for path tracing, which mollifies the glass from the eye, as for bidirectional path tracing, whose
// longest edge is that between glass and floor, and which mollifies the glass from the light.
TEST(RegularisedBdpt, RefractsFromTheLight) {
  const Vec3d y(0.8, 0.3, 1.8), a(-0.6, 0.25, 1.0), n = normalize(Vec3d(-0.6, 0, -1));
  const Vec3d na = normalize(Vec3d(0.9, 0.05, -0.3));
  const Vec3d away = normalize(mirrored(a - y, {}, na)), eye = a + away * 0.3;
  const Built scene =
      built(camera(eye, a - eye, 0.5),
            glass_and_lamp() + square(a, na, 0.1, kMirror) +
                square(y, n, 0.15, "<bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf>"));
  const auto from_eye = measure(scene, {"path", 300, {{"max_depth", "4"}}}, 0.25, 12);
  const auto both = measure(scene, {"bdpt", 150, {{"max_depth", "4"}}}, 0.25, 12);
  const double error = std::hypot(from_eye.error(), both.error());
  EXPECT_NEAR(from_eye.mean(), both.mean(), 6 * error + 0.02 * both.mean());
  EXPECT_LT(error, 0.04 * both.mean());
}

// Claim: light from infinitely far away, which a mirror sends onto a floor, is as bright as it is: the edge
// to it counts with the diameter of the scene. So is its picture in a mirror for an orthographic camera,
// which bidirectional path tracing shows from either end; and that of a lens with an area by path tracing.
TEST(Regularised, EndsThatAreFarOrWide) {
  const Vec3d eye(0.5, -0.8, 0.7);
  // The sun comes from below the floor, whose back is black.
  const std::string body = square({-1, 0, 2}, {0, 0, -1}, 3, kMirror) +
                           square({0, 0, 0}, {0, 0, 1}, 0.15,
                                  "<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0.5\"/></bsdf>") +
                           R"(<emitter type="directional"><vector name="direction" x="0.5" y="0" z="1"/>
         <rgb name="irradiance" value="2"/></emitter>)";
  const double exact = 0.5 / std::numbers::pi * 2 / std::sqrt(1.25);
  const auto sensor_at = [](const std::string& type, Vec3d from, Vec3d to, const std::string& more) {
    return fmt::format(
        "<sensor type=\"{}\">{}<transform name=\"to_world\"><lookat origin=\"{}\" target=\"{}\" "
        "up=\"0, 1, 0.1\"/></transform></sensor>",
        type, more, point(from), point(to));
  };
  const auto expect = [&](const Built& scene, const std::string& integrator, const char* depth,
                          const std::string& what) {
    const auto measured = measure(scene, {integrator, 250, {{"max_depth", depth}}}, 0.2 * scene.radius, 12);
    EXPECT_NEAR(measured.mean(), exact, 6 * measured.error() + 0.02 * exact) << what << measured.error();
    EXPECT_LT(measured.error(), 0.04 * exact) << what;
  };
  const std::string narrow = "<float name=\"fov\" value=\"2\"/>";
  expect(built(sensor_at("perspective", eye, {0, 0, 0}, narrow), body), "path", "3", "pinhole");
  expect(built(sensor_at("thinlens", eye, {0, 0, 0},
                         narrow + "<float name=\"aperture_radius\" value=\"0.02\"/><float "
                                  "name=\"focus_distance\" value=\"1.17\"/>"),
               body),
         "path", "3", "lens");
  // Mirror A hangs beside the floor and shows it.
  const Vec3d a(0.4, -0.5, 1), to_floor = normalize(-a),
                               n = normalize(to_floor + normalize(Vec3d(1, -0.2, 0.1)));
  const Vec3d from = a + normalize(Vec3d(1, -0.2, 0.1)) * 0.8;
  const std::string both = body + square(a, n, 0.12, kMirror);
  const std::string small = fmt::format(
      "<sensor type=\"orthographic\"><float name=\"near_clip\" value=\"0.001\"/><transform "
      "name=\"to_world\"><scale x=\"0.02\" y=\"0.02\"/><lookat origin=\"{}\" target=\"{}\" up=\"0, "
      "0, 1\"/></transform></sensor>",
      point(from), point(a));
  for (const char* integrator : {"path", "bdpt"})
    expect(built(small, both), integrator, "4", std::string("orthographic ") + integrator);
}

// Sums of the film of units [cuts[i], cuts[i + 1]).
std::vector<std::int64_t> film_of_units(const Built& scene, const std::string& integrator,
                                        const SettingsMap& settings, const std::vector<std::uint64_t>& cuts) {
  const test::TextFiles files({{"scene.xml", scene.xml}});
  JobSettings job;
  job.integrator = integrator;
  job.width = job.height = 8;
  const auto renderer = test::make_renderer(files, job, settings);
  const NamedState state = test::state_at(*renderer, test::kFilmScaleLog2);
  std::vector<std::int64_t> sums;
  for (std::size_t i = cuts.size() - 1; i-- > 0;) {  // in reverse order
    auto output = renderer->make_output(state);
    const auto done =
        renderer->run({Unit::Kind::iterations, 0, cuts[i], cuts[i + 1]}, {state, {}, {}}, output, {1});
    if (!done.ok()) throw std::runtime_error(done.error().to_string());
    const film::Layout& layout = output.film->layout();
    const std::size_t values = layout.pixel_count() * layout.layers * 3;
    sums.resize(values);
    for (std::size_t v = 0; v < values; ++v) sums[v] += output.film->sums()[v];
  }
  return sums;
}

// Claim: a sample's bandwidth is a function of its index in the job: units cut and ordered anyhow have the
// same film.
TEST(Regularised, FilmsDoNotDependOnUnits) {
  const Built scene = scene_t(30);
  for (const std::string integrator : {"path", "bdpt"}) {
    const SettingsMap settings{{"regularise", "on"}, {"regularise_radius", "0.1"}};
    const auto whole = film_of_units(scene, integrator, settings, {0, 64});
    EXPECT_EQ(whole, film_of_units(scene, integrator, settings, {0, 1, 2, 17, 40, 64})) << integrator;
    EXPECT_TRUE(std::ranges::any_of(whole, [](std::int64_t v) { return v > 0; })) << integrator;
    SettingsMap off = settings;
    off["regularise"] = "off";
    const auto dark = film_of_units(scene, integrator, off, {0, 64});
    EXPECT_TRUE(std::ranges::all_of(dark, [](std::int64_t v) { return v == 0; })) << integrator;
  }
}

// The setting of a first radius that is this one to the bit; empty if no number is.
std::string radius_setting(const Built& scene, double first) {
  double setting = first / scene.radius;
  for (int i = 0; i < 4; ++i) setting = std::nextafter(setting, 0.0);
  for (int i = 0; i < 9 && setting * scene.radius != first; ++i) setting = std::nextafter(setting, 1.0);
  return setting * scene.radius == first ? fmt::format("{:.17g}", setting) : "";
}
// A first radius near 0.1 of the scene's that a setting gives, as settings give those of these numbers.
double given_by_settings(const Built& scene, const std::vector<std::uint64_t>& numbers) {
  for (int i = 0; i < 10000; ++i) {
    const double first = scene.radius * (0.1 + 1e-6 * i);
    if (std::ranges::all_of(numbers, [&](std::uint64_t n) {
          return !radius_setting(scene, transport::bandwidth(first, n, 1.0 / 6)).empty();
        }))
      return first;
  }
  throw std::runtime_error("no such radius");
}
// Sums of the film of one unit.
std::vector<std::int64_t> film_of(const Built& scene, const std::string& integrator,
                                  const SettingsMap& settings, const Unit& unit) {
  const test::TextFiles files({{"scene.xml", scene.xml}});
  JobSettings job;
  job.integrator = integrator;
  job.width = job.height = 16;
  const auto renderer = test::make_renderer(files, job, settings);
  const NamedState state = test::state_at(*renderer, test::kFilmScaleLog2);
  auto output = renderer->make_output(state);
  const auto done = renderer->run(unit, {state, {}, {}}, output, {1});
  if (!done.ok()) throw std::runtime_error(done.error().to_string());
  const std::int64_t* sums = output.film->sums();
  return {sums, sums + output.film->layout().pixel_count() * 3};
}

// Claim: each iteration of either half has the radius that the function of its index in the job gives: its
// film is that of a job whose radius stays at this one.
TEST(Regularised, EachIterationHasTheRadiusOfItsIndex) {
  const Built scene = scene_t(30);
  for (const std::string integrator : {"path", "bdpt"}) {
    bool any = false;
    for (const auto& [half, index] :
         {std::pair{0U, 0ULL}, {1U, 0ULL}, {0U, 3ULL}, {1U, 4ULL}, {1U, 700ULL}, {0U, 250000ULL}}) {
      const std::uint64_t number = global_iteration(half, index);
      const double first = given_by_settings(scene, {0, number});
      const Unit unit{Unit::Kind::iterations, half, index, index + 1};
      const auto falls =
          film_of(scene, integrator,
                  {{"regularise", "on"}, {"regularise_radius", radius_setting(scene, first)}}, unit);
      const auto stays = film_of(
          scene, integrator,
          {{"regularise", "on"},
           {"regularise_exponent", "0"},
           {"regularise_radius", radius_setting(scene, transport::bandwidth(first, number, 1.0 / 6))}},
          unit);
      EXPECT_EQ(falls, stays) << integrator << " " << half << " " << index;
      any |= std::ranges::any_of(falls, [](std::int64_t v) { return v > 0; });
    }
    EXPECT_TRUE(any) << integrator;
  }
}

// Claim: each segment of a chain has the radius of the epoch of mutations that it begins in: film and record
// are those of a job whose radius stays at this one. Threads leave no trace.
TEST(Regularised, EachSegmentHasTheRadiusOfItsEpoch) {
  const Built scene = scene_t(30);
  const double first = given_by_settings(scene, {0, 1, 2});
  constexpr std::uint32_t kChains = 4;
  constexpr std::uint64_t kMutations = 5008;  // of a segment: 64 * 313 / 4
  for (const std::string integrator : {"pssmlt", "mmlt"}) {
    const auto make = [&](double radius, const char* exponent) {
      const test::TextFiles files({{"scene.xml", scene.xml}});
      JobSettings job;
      job.integrator = integrator;
      job.width = job.height = 8;
      return test::make_renderer(files, job,
                                 {{"regularise", "on"},
                                  {"regularise_radius", radius_setting(scene, radius)},
                                  {"regularise_exponent", exponent},
                                  {"max_depth", "3"},
                                  {"chains", std::to_string(kChains)},
                                  {"bootstrap", "20000"},
                                  {"mutations", "313"}});
    };
    const auto falls = make(first, fmt::format("{:.17g}", 1.0 / 6).c_str());
    NamedState state = test::state_at(*falls, test::kFilmScaleLog2);
    render::UnitOutput output;
    const auto booted = falls->run({Unit::Kind::bootstrap, 0, 0, 20000}, {}, output, {1});
    ASSERT_TRUE(booted.ok()) << booted.error().to_string();
    chains::BootstrapTable table(20000);
    ASSERT_TRUE(table.insert(0, output.table).ok());
    state.bootstrap_b = table.normalisation().b;
    ASSERT_GT(state.bootstrap_b, 0) << integrator;
    const auto starts = table.choose_starts(kChains, 7);
    std::vector<chains::ChainStart> chain_starts;
    for (std::uint32_t i = 0; i < kChains / 2; ++i) chain_starts.push_back({starts[2 * i], {}});
    for (std::uint64_t segment = 0; segment < 5; ++segment) {
      const double radius = transport::bandwidth(first, segment * kMutations / 10000, 1.0 / 6);
      const Unit unit{Unit::Kind::segments, 0, segment * (kChains / 2), (segment + 1) * (kChains / 2)};
      const auto run = [&](const render::Renderer& renderer, unsigned threads) {
        auto one = renderer.make_output(state);
        const auto done = renderer.run(unit, {state, {}, chain_starts}, one, {threads});
        if (!done.ok()) throw std::runtime_error(done.error().to_string());
        return one;
      };
      const auto one = run(*falls, 1), stays = run(*make(radius, "0"), 1), threads = run(*falls, 3);
      const std::size_t values = one.film->layout().pixel_count() * 3 * one.film->layout().layers;
      for (const auto* other : {&stays, &threads}) {
        EXPECT_TRUE(std::equal(one.film->sums(), one.film->sums() + values, other->film->sums()))
            << integrator << " " << segment;
        // A radius that stays has no sums of mollified paths.
        const auto plain = [](std::vector<chains::ChainRecord> records) {
          for (chains::ChainRecord& record : records) record.counts.mollified.reset();
          return records;
        };
        EXPECT_EQ(plain(one.records), plain(other->records)) << integrator << " " << segment;
      }
      EXPECT_EQ(one.records, threads.records) << integrator << " " << segment;
      for (std::size_t i = 0; i < one.records.size(); ++i) {
        ASSERT_EQ(one.records[i].counts.mutations, (segment + 1) * kMutations);
        chain_starts[i].record = one.records[i];
      }
    }
  }
}

// Claim: a scene whose light techniques can sample has the same film with the option on, to the bit, and the
// plan says that nothing is mollified, and why.
TEST(Regularised, ScenesThatCanBeSampledStayAsTheyAre) {
  const Built scene =
      built(camera({0, 0, 0}, {0, 0, 1}, 60),
            square({0, 0, 3}, {0, 0, -1}, 2, kMirror) +
                R"(<shape type="sphere"><point name="center" x="0" y="0" z="-2"/><emitter type="area"><rgb
             name="radiance" value="2"/></emitter></shape>
             <shape type="sphere"><point name="center" x="1" y="0.5" z="2"/><float name="radius" value="0.5"/>
             <bsdf type="plastic"/></shape>)");
  for (const std::string integrator : {"path", "bdpt"}) {
    const auto off = film_of_units(scene, integrator, {}, {0, 16});
    EXPECT_EQ(film_of_units(scene, integrator, {{"regularise", "on"}}, {0, 16}), off) << integrator;
    const test::TextFiles files({{"scene.xml", scene.xml}});
    JobSettings job;
    job.integrator = integrator;
    job.width = job.height = 8;
    const auto plan = test::make_renderer(files, job, {{"regularise", "on"}})->plan_text();
    ASSERT_TRUE(plan.ok());
    EXPECT_NE(plan->find("mollified connections"), std::string::npos) << *plan;
    EXPECT_NE(plan->find("no light is a point or a direction"), std::string::npos) << *plan;
  }
}

// Claim: the layer `mollified` has all that the option adds.
TEST(Regularised, LayerHasWhatIsMollified) {
  const Built scene = scene_t(30);
  for (const char* integrator : {"path", "bdpt"}) {
    const auto sums = film_of_units(
        scene, integrator, {{"regularise", "on"}, {"regularise_radius", "0.1"}, {"regularise_layer", "true"}},
        {0, 64});
    const std::size_t image = sums.size() / 2;
    double all = 0, layer = 0;
    for (std::size_t i = 0; i < image; ++i) {
      all += static_cast<double>(sums[i]);
      layer += static_cast<double>(sums[image + i]);
    }
    EXPECT_GT(all, 0) << integrator;
    EXPECT_NEAR(layer / all, 1, 1e-6) << integrator;
  }
}

// Claim: paths of which every one can be sampled, or is dark, have the same film with the option on, to the
// bit, although ends of connections are specular: the lamps that would have others are in a black box. (So is
// a medium, for which all kernels take the form for media.)
TEST(Regularised, HiddenLampsAddNothing) {
  const Built scene = built(camera({0, 0, 0}, {0, 0, 1}, 60), square({0, 0, 3}, {0, 0, -1}, 2, kMirror) + R"(
        <shape type="sphere"><point name="center" x="0" y="0" z="-2"/><emitter type="area"><rgb name="radiance"
          value="2"/></emitter></shape>
        <shape type="sphere"><point name="center" x="0.4" y="0.3" z="2"/><float name="radius" value="0.4"/>
          <bsdf type="dielectric"/></shape>
        <shape type="sphere"><point name="center" x="-0.5" y="0.3" z="2"/><float name="radius" value="0.3"/>
          <bsdf type="plastic"/></shape>
        <shape type="cube"><transform name="to_world"><scale value="0.3"/><translate y="5"/></transform>
          <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf></shape>
        <shape type="sphere"><point name="center" x="0" y="5.1" z="0"/><float name="radius" value="0.1"/>
          <bsdf type="null"/><medium type="homogeneous" name="interior"><rgb name="sigma_t" value="1"/></medium></shape>
        <emitter type="point"><point name="position" x="0" y="4.9" z="0"/></emitter>)");
  for (const std::string integrator : {"path", "bdpt"}) {
    const auto off = film_of_units(scene, integrator, {}, {0, 16});
    EXPECT_EQ(film_of_units(scene, integrator, {{"regularise", "on"}, {"regularise_radius", "0.5"}}, {0, 16}),
              off)
        << integrator;
    EXPECT_TRUE(std::ranges::any_of(off, [](std::int64_t v) { return v > 0; })) << integrator;
  }
}

// Claim: chains keep their radius over an epoch of 10000 mutations, and the power law is that of epochs; the
// geometric schedule falls with each mutation, down to a floor.
TEST(ChainRegularization, FallsByEpochs) {
  using integrators::ChainRegularization;
  const integrators::Regularization first(0.5, 1.0 / 6);
  const ChainRegularization power(first, false), geometric(first, true);
  EXPECT_EQ(power.bandwidth(0), 0.5);
  EXPECT_EQ(power.bandwidth(9999), 0.5);
  EXPECT_NEAR(power.bandwidth(10000), 0.5 * std::pow(2, -1.0 / 6), 1e-12);
  EXPECT_NEAR(power.bandwidth(637777), 0.25, 1e-12);  // epoch 63
  EXPECT_NEAR(geometric.bandwidth(10000), 0.5 * std::pow(1 - 1e-4, 10000), 1e-12);
  EXPECT_GT(geometric.bandwidth(1ULL << 40), 0);
  EXPECT_FALSE(ChainRegularization().runs());
}

}  // namespace
}  // namespace candela::render::regularised
