// optimis in the full renderer: the expectation of its controls, its image against that of `path`, and what
// threads and units may not change. Batches are ranges of indices with independent random numbers.
//
// Controls are compared by t tests of 16 batches at 6e-7 (t > 8.25 with 15 degrees of freedom), of which
// there are at most 100; images at 1e-6, Bonferroni over their values, 24 times (36 in the long form); sums
// of errors at 6e-7, eleven times: a false alarm for other seeds with at most 1e-4.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <span>

#include "common/bundle/gather.h"
#include "tests/paths.h"
#include "tests/proofs/proofs.h"
#include "tests/statistical/optimis_job.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"Optimis.ControlsHaveExpectationOne", "Optimis.AgreesWithPath",
                                  "Optimis.GainsWhereALampIsHidden", "Optimis.GainsWithOneSmallLamp",
                                  "Optimis.GainsAsMuchAsTheExactTableSays", "Optimis.DirectBiasFalls",
                                  "Optimis.LittleIsLostWhereThePlanSkips"});

const SettingsMap kEverything = {
    {"selection", "contribution,power,uniform"}, {"plan", "full"}, {"max_depth", "4"}};

// Lamps near the horizon of many pixels, hidden from others.
const SettingsMap kPoints = {{"techniques", "bsdf,spherical,area,parallel"},
                             {"selection", "contribution,power"},
                             {"weights", "optimal"},
                             {"max_depth", "4"}};

// Claim: each control has the expectation 1 for each batch, whatever is between vertices and whichever lights
// there are, and the matrix counts whole samples.
TEST(Optimis, ControlsHaveExpectationOne) {
  // With plan=full the bsdf's control never varies, as where surfaces let light pass straight.
  SettingsMap automatic = kEverything;
  automatic["plan"] = "auto";
  automatic["weights"] = "optimal";
  std::vector<std::pair<std::string, SettingsMap>> cases;
  for (const char* scene : {"many-lamps", "box-diffuse", "envmap", "constant", "textured-lamp", "mixed",
                            "mask", "smoke", "point", "spot", "mirror-room", "mesh-lamp"})
    cases.emplace_back(scene, kEverything);
  for (const char* scene : {"many-lamps", "box-diffuse", "envmap", "constant", "textured-lamp", "mesh-lamp"})
    cases.emplace_back(scene, automatic);
  for (const char* scene : {"many-lamps", "box-diffuse", "textured-lamp", "mixed", "mesh-lamp"})
    cases.emplace_back(scene, kPoints);
  std::size_t compared = 0;
  for (const auto& [scene, settings] : cases) {
    Job job(scene, "optimis", settings);
    ASSERT_EQ(job.work().accumulators.size(), 2U) << scene;
    std::vector<std::vector<double>> values;
    for (std::size_t b = 0; b < kBatches; ++b) {
      Merged m = job.empty();
      job.merge(m, 0, b * 2, (b + 1) * 2);
      const Controls c = controls_of(job, m);
      EXPECT_NEAR(c.samples, std::nearbyint(c.samples), 1e-4) << scene;
      values.push_back(c.excess);
    }
    compared += expect_zero_means(values, scene);
  }
  EXPECT_LE(compared, 100U) << "the false alarms above are for so many";
  EXPECT_GE(compared, 50U);
}

SettingsMap with(SettingsMap settings, const SettingsMap& more) {
  for (const auto& [name, value] : more) settings[name] = value;
  return settings;
}

// Claim: the image is that of `path`, by all estimators without bias.
TEST(Optimis, AgreesWithPath) {
  struct Reading {
    SettingsMap settings;
    std::vector<std::string_view> estimators;
    std::span<const std::string> scenes;
  };
  const Regions regions(kExtent, kExtent, 16);
  const SettingsMap depth = {{"max_depth", "4"}};
  const std::uint64_t kIterations = long_form() ? 16 : 4;  // of a half
  const std::string all[] = {"many-lamps", "envmap", "mixed", "mask", "smoke", "mirror-glossy"};
  const std::string lit[] = {"many-lamps", "box-diffuse", "textured-lamp"};
  const SettingsMap points = with(kPoints, {{"plan", "auto"}});
  const Reading readings[] = {{{}, {"crossfit", "balance"}, all}, {points, {"crossfit", "balance"}, lit}};
  for (const std::string scene :
       {"many-lamps", "envmap", "mixed", "mask", "smoke", "mirror-glossy", "box-diffuse", "textured-lamp"}) {
    Job path(scene, "path", depth);
    const Rows expected = path.rows({}, kIterations, regions);
    for (const Reading& reading : readings) {
      if (std::find(reading.scenes.begin(), reading.scenes.end(), scene) == reading.scenes.end()) continue;
      Job optimis(scene, "optimis", with(kEverything, reading.settings));
      for (const std::string_view estimator : reading.estimators) {
        const Rows rows = optimis.rows(estimator, kIterations, regions);
        const std::string what = fmt::format("{} {}", scene, estimator);
        const std::size_t tested = expect_same_means(rows, expected, regions, what);
        EXPECT_GT(tested, regions.values() / 2) << what;
      }
    }
  }
}

// Claim: with one technique, sample for sample, and with two and the balance heuristic, within rounding of
// floats, the film is that of `path`.
TEST(Optimis, IsPathWithItsTechniques) {
  const auto film_of = [](const char* scene, const char* integrator, const SettingsMap& settings) {
    Job job(scene, integrator, settings);
    Merged m = job.empty();
    job.merge(m, 1, 0, 4);
    return m.film.develop(0);
  };
  for (const char* scene : {"point", "spot", "directional"})
    EXPECT_EQ(film_of(scene, "optimis", {{"selection", "contribution"}}), film_of(scene, "path", {}))
        << scene;
  for (const char* scene : {"many-lamps", "box-diffuse", "envmap", "smoke"}) {
    const auto a = film_of(scene, "optimis",
                           {{"selection", "contribution"}, {"weights", "balance"}, {"max_depth", "2"}});
    const auto b = film_of(scene, "path", {{"heuristic", "balance"}, {"max_depth", "2"}});
    for (std::size_t i = 0; i < a.size(); ++i)
      ASSERT_NEAR(a[i], b[i], 1e-4 * std::abs(b[i]) + 1e-5) << scene << " " << i;
  }
}

// Claim: sums and images are the same bits with one thread and four, and however the iterations are cut into
// units and in whichever order they are merged.
TEST(Optimis, UnitsAndThreadsChangeNothing) {
  Job job("many-lamps", "optimis", kEverything);
  Merged whole = job.empty(), cut = job.empty();
  for (const std::uint32_t half : {0U, 1U}) job.merge(whole, half, 0, 6, 1);
  for (const std::uint32_t half : {1U, 0U}) {
    job.merge(cut, half, 4, 6, 4);
    job.merge(cut, half, 0, 1, 3);
    job.merge(cut, half, 1, 4, 2);
  }
  for (std::uint32_t half = 0; half < 2; ++half)
    for (std::size_t i = 0; i < whole.sums[half].size(); ++i)
      EXPECT_EQ(whole.sums[half][i].serialise(), cut.sums[half][i].serialise());
  EXPECT_EQ(job.image(whole, {}), job.image(cut, {}));
  for (const std::string_view estimator : optimal_mis::kEstimators)
    EXPECT_EQ(job.image(whole, estimator), job.image(cut, estimator));
}

// A strong lamp that a screen hides from the whole floor, and two weak ones that it does not hide.
constexpr const char* kHiddenLamp = R"(<scene version="3.0.0">
  <sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="0, 2, 0" target="0, 0, 0" up="0, 0, 1"/></transform></sensor>
  <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="2"/></transform>
    <bsdf type="diffuse"/></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="0.1"/><rotate x="1" angle="90"/>
    <translate x="0" y="5" z="0"/></transform><emitter type="area"><rgb name="radiance" value="200"/></emitter></shape>
  <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="1.5"/>
    <translate x="0" y="4.5" z="0"/></transform><bsdf type="diffuse"/></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="0.1"/><rotate x="1" angle="90"/>
    <translate x="1.5" y="2.5" z="0"/></transform><emitter type="area"><rgb name="radiance" value="20"/></emitter></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="0.1"/><rotate x="1" angle="90"/>
    <translate x="-1.5" y="2.5" z="0.5"/></transform><emitter type="area"><rgb name="radiance" value="15"/></emitter></shape>
</scene>)";

double squared_error(const std::vector<float>& image, const std::vector<float>& truth) {
  double sum = 0;
  for (std::size_t i = 0; i < image.size(); ++i)
    sum += std::pow(static_cast<double>(image[i]) - static_cast<double>(truth[i]), 2);
  return sum;
}

// Claim: where the selections send many samples to a lamp that is hidden, optimal weights lower the squared
// error to less than half of the balance heuristic's; direct weights too.
TEST(Optimis, GainsWhereALampIsHidden) {
  TestScene scene = scene_from_xml(kHiddenLamp, kExtent, kExtent);
  scene.settings.sampler = "independent";
  Job job(with_integrator(std::move(scene), "optimis",
                          {{"techniques", "light"}, {"selection", "contribution,power,uniform"}}));
  Merged m = job.empty(), reference = job.empty();
  for (const std::uint32_t half : {0U, 1U}) {
    job.merge(m, half, 0, 32);
    job.merge(reference, half, 1000, 1256);
  }
  const std::vector<float> truth = job.image(reference, "crossfit");
  const auto error = [&](std::string_view estimator) {
    return squared_error(job.image(m, estimator), truth);
  };
  const double balance = error("balance");
  for (const char* estimator : {"crossfit", "direct"}) {
    const double ratio = error(estimator) / balance;
    std::printf("squared error of %s over that of balance, 64 iterations: %.3f\n", estimator, ratio);
    EXPECT_LT(ratio, 0.5) << estimator;
  }
}

// Claim: with one small lamp over a matt floor, bsdf sampling adds noise to the balance heuristic, which
// optimal weights take out: the squared error falls to less than three quarters.
TEST(Optimis, GainsWithOneSmallLamp) {
  constexpr const char* kScene = R"(<scene version="3.0.0">
  <sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="0, 2, 0" target="0, 0, 0" up="0, 0, 1"/></transform></sensor>
  <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="2"/></transform>
    <bsdf type="diffuse"/></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="0.05"/><rotate x="1" angle="90"/>
    <translate x="0.5" y="1.5" z="0"/></transform><emitter type="area"><rgb name="radiance" value="200"/></emitter></shape>
</scene>)";
  TestScene scene = scene_from_xml(kScene, kExtent, kExtent);
  scene.settings.sampler = "independent";
  Job job(with_integrator(std::move(scene), "optimis", {{"max_depth", "2"}}));
  Merged m = job.empty(), reference = job.empty();
  for (const std::uint32_t half : {0U, 1U}) {
    job.merge(m, half, 0, 32);
    job.merge(reference, half, 1000, 1128);
  }
  const std::vector<float> truth = job.image(reference, "crossfit");
  const auto error = [&](std::string_view estimator) {
    return squared_error(job.image(m, estimator), truth);
  };
  const double ratio = error("crossfit") / error("balance");
  std::printf("squared error of crossfit over that of balance, one small lamp: %.4f\n", ratio);
  EXPECT_LT(ratio, 0.75);
}

// A point with a normal, as far as a pixel can tell, under a rectangle [x0, x1] x [y0, y1] at the height z
// that faces it: problems R1, R2, R4 and R5 of docs/lab/optimal-mis-tests.md.
struct Rectangle {
  const char* name;
  double x0, x1, y0, y1, z;
  std::array<double, 3> normal;  // not unit
  double irradiance;
};
std::string under(const Rectangle& r) {
  return fmt::format(
      R"(<scene version="3.0.0">
        <sensor type="perspective"><float name="fov" value="0.01"/><transform name="to_world">
          <lookat origin="{0},{1},{2}" target="0,0,0" up="0,1,0"/></transform></sensor>
        <shape type="rectangle"><transform name="to_world"><scale value="0.01"/>
          <lookat origin="0,0,0" target="{3},{4},{5}" up="0,1,0"/></transform>
          <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>
        <shape type="rectangle"><transform name="to_world"><scale x="{6}" y="{7}"/><rotate x="1" angle="180"/>
          <translate x="{8}" y="{9}" z="{10}"/></transform>
          <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape></scene>)",
      0.05 * r.normal[0], 0.05 * r.normal[1], 0.05 * r.normal[2], r.normal[0], r.normal[1], r.normal[2],
      (r.x1 - r.x0) / 2, (r.y1 - r.y0) / 2, (r.x0 + r.x1) / 2, (r.y0 + r.y1) / 2, r.z);
}

// Claim: with 64 batches, the squared error of the balance heuristic over that of optimal weights (crossfit)
// is that of the exact variances within 10 %. 8192 pixels and more: a ratio's standard error is below 2.5 %.
TEST(Optimis, GainsAsMuchAsTheExactTableSays) {
  const Rectangle r1{"R1", -0.5, 1.5, -1, 0.5, 1, {0, 0, 1}, 1.29074085276298};
  const Rectangle r2{"R2", -0.5, 1.5, -1, 0.5, 1, {0.5, 0.3, 1}, 1.1933808008795};
  const Rectangle r4{"R4", -1, 1, -1, 1, 0.2, {0, 0, 1}, 3.04212843837004};
  const Rectangle r5{"R5", -1, 1, -1, 1, 0.5, {0.4, 0, 1}, 2.42402333495654};
  struct Case {
    Rectangle rectangle;
    const char* techniques;
    double balance, optimal;  // variances of one batch
  };
  const Case cases[] = {{r1, "spherical,parallel", 0.110447284415889, 0.00164192286797692},
                        {r2, "spherical,area", 0.0834032517372632, 0.0309835400703611},
                        {r2, "spherical,parallel", 0.200296569935115, 0.00935830165349945},
                        {r4, "spherical,area", 2.95319252500556, 0.473106279255098},
                        {r5, "spherical,area", 1.17198915049605, 0.257916134512271},
                        {r5, "spherical,parallel", 1.37380540649299, 0.387852266838492}};
  const std::uint64_t jobs = long_form() ? 16 : 2;
  for (const Case& c : cases) {
    TestScene scene = scene_from_xml(under(c.rectangle), kExtent, kExtent);
    scene.settings.sampler = "independent";
    Job job(with_integrator(std::move(scene), "optimis",
                            {{"techniques", c.techniques}, {"depth", "direct"}, {"max_depth", "2"}}));
    const double truth = 0.5 / std::numbers::pi * c.rectangle.irradiance;
    std::array<double, 2> squares{};
    double sum = 0;
    for (std::uint64_t k = 0; k < jobs; ++k) {
      Merged m = job.empty();
      for (const std::uint32_t half : {0U, 1U}) job.merge(m, half, 32 * k, 32 * (k + 1));
      for (std::size_t i = 0; i < 2; ++i) {
        const std::vector<float> image = job.image(m, i == 0 ? "balance" : "crossfit");
        for (std::size_t p = 0; p < image.size(); p += 3) {
          const double error = static_cast<double>(image[p]) / truth - 1;
          squares[i] += error * error;
          if (i == 1) sum += error;
        }
      }
    }
    const double pixels = static_cast<double>(jobs) * kExtent * kExtent;
    EXPECT_LE(std::abs(sum), 5 * std::sqrt(squares[1])) << c.rectangle.name << " " << c.techniques;
    const double expected = c.balance / 64 / (c.rectangle.irradiance * c.rectangle.irradiance);
    EXPECT_NEAR(squares[0] / pixels / expected, 1, 0.1) << c.rectangle.name << " " << c.techniques;
    const double gain = squares[0] / squares[1], exact = c.balance / c.optimal;
    std::printf("%s %s: squared error of balance over that of crossfit %.2f, exact %.2f\n", c.rectangle.name,
                c.techniques, gain, exact);
    EXPECT_NEAR(gain / exact, 1, 0.1) << c.rectangle.name << " " << c.techniques;
  }
}

// Claim: the bias of the direct estimator in the image under R2 is that of the theory's table after 16
// batches and after 64: a quarter of it. Paired with crossfit, which has none and most of the same noise.
TEST(Optimis, DirectBiasFalls) {
  const Rectangle r2{"R2", -0.5, 1.5, -1, 0.5, 1, {0.5, 0.3, 1}, 1.1933808008795};
  TestScene scene = scene_from_xml(under(r2), kExtent, kExtent);
  scene.settings.sampler = "independent";
  Job job(with_integrator(std::move(scene), "optimis",
                          {{"techniques", "spherical,parallel"}, {"depth", "direct"}, {"max_depth", "2"}}));
  struct Case {
    std::uint64_t batches, jobs;
    double mean, standard_error;  // of direct with the ridge 0.1 / T
  };
  for (const Case& c : {Case{16, 8, 1.18988559937416, 4.64e-05}, Case{64, 2, 1.19255317568364, 1.05e-05}}) {
    double sum = 0, squares = 0;
    for (std::uint64_t k = 0; k < c.jobs; ++k) {
      Merged m = job.empty();
      const std::uint64_t n = c.batches / 2;
      for (const std::uint32_t half : {0U, 1U}) job.merge(m, half, 2000 + n * k, 2000 + n * (k + 1));
      const std::vector<float> direct = job.image(m, "direct"), crossfit = job.image(m, "crossfit");
      for (std::size_t p = 0; p < direct.size(); p += 3) {
        const double bias =
            2 * std::numbers::pi * (static_cast<double>(direct[p]) - static_cast<double>(crossfit[p]));
        sum += bias;
        squares += bias * bias;
      }
    }
    const double pixels = static_cast<double>(c.jobs) * kExtent * kExtent, mean = sum / pixels,
                 error = std::sqrt((squares / pixels - mean * mean) / pixels),
                 expected = c.mean - r2.irradiance;
    std::printf("bias of direct, R2, T = %d: %.6f +- %.6f, expected %.6f\n", static_cast<int>(c.batches),
                mean, error, expected);
    EXPECT_NEAR(mean, expected, 5 * std::hypot(error, c.standard_error)) << c.batches;
    EXPECT_LT(mean, -5 * error) << "the test must see this bias";
  }
}

// Claim: where the plan leaves optimal weights out, the noise of the balance heuristic after 64 iterations is
// below 1 % of the picture's mean, or optimal weights lower the squared error by less than 12 %, about what
// their sums cost.
TEST(Optimis, LittleIsLostWhereThePlanSkips) {
  constexpr const char* kSmallLamp = R"(<scene version="3.0.0">
  <sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="0, 2, 0" target="0, 0, 0" up="0, 0, 1"/></transform></sensor>
  <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="2"/></transform>
    <bsdf type="diffuse"/></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="0.004"/><rotate x="1" angle="90"/>
    <translate x="0.5" y="1.5" z="0"/></transform><emitter type="area"><rgb name="radiance" value="20000"/></emitter></shape>
</scene>)";
  const auto loaded = [&](const std::string& name, const SettingsMap& settings) {
    if (name != "small lamp") return load(name, "optimis", settings);
    TestScene scene = scene_from_xml(kSmallLamp, kExtent, kExtent);
    scene.settings.sampler = "independent";
    return with_integrator(std::move(scene), "optimis", settings);
  };
  for (const char* name : {"small lamp", "constant", "envmap"}) {
    const Job chosen(loaded(name, {}));
    EXPECT_FALSE(chosen.work().development) << name << "\n" << chosen.plan();
    Job job(loaded(name, {{"weights", "optimal"}, {"depth", "direct"}}));
    Merged m = job.empty(), reference = job.empty();
    for (const std::uint32_t half : {0U, 1U}) {
      job.merge(m, half, 0, 32);
      job.merge(reference, half, 1000, 1256);
    }
    const std::vector<float> truth = job.image(reference, "crossfit");
    double mean = 0;
    for (const float v : truth) mean += static_cast<double>(v) / static_cast<double>(truth.size());
    const double balance = squared_error(job.image(m, "balance"), truth),
                 relative = balance / static_cast<double>(truth.size()) / (mean * mean),
                 ratio = squared_error(job.image(m, "crossfit"), truth) / balance;
    std::printf("squared error of balance over squared mean, %s: %.2e; of crossfit over balance: %.4f\n",
                name, relative, ratio);
    EXPECT_TRUE(relative < 1e-4 || ratio > 0.88) << name;
  }
}

// Claim: a trial keeps optimal weights where the study mis-scenes found them worth their time, at any size of
// the film and with any seed, and leaves them out at a lamp on the horizon, which no fact of the scene tells.
TEST(Optimis, ATrialKeepsWhatPays) {
  const auto job = [](const std::string& name, std::uint32_t side, std::uint64_t seed,
                      const SettingsMap& settings) {
    TestScene scene;
    scene.files = std::make_shared<bundle::DiskSource>(test::source_path("tests/bench/candela_study/scenes"));
    scene.main_key = "mis-" + name + ".xml";
    scene = read_scene(std::move(scene), side, side);
    scene.settings.seed = seed;
    return Job(with_integrator(std::move(scene), "optimis", settings));
  };
  struct Case {
    const char* scene;
    bool pays;
  };
  for (const Case& c : {Case{"parallel", true}, Case{"tilted", true}, Case{"near", true},
                        Case{"hidden", true}, Case{"horizon", false}}) {
    for (const std::uint32_t side : {24U, 200U})
      for (const std::uint64_t seed : {1U, 2U}) {
        const Job chosen = job(c.scene, side, seed, {});
        const std::size_t at = chosen.plan().find("a trial found");
        ASSERT_NE(at, std::string::npos) << c.scene << "\n" << chosen.plan();
        if (seed == 1) std::printf("%s, %u: %s\n", c.scene, side, chosen.plan().substr(at, 70).c_str());
        EXPECT_EQ(chosen.work().development.has_value(), c.pays) << c.scene << "\n" << chosen.plan();
      }
    // The plan runs no trial if the user asks for optimal weights, an estimator or the full plan.
    for (const SettingsMap& asked : {SettingsMap{{"weights", "optimal"}},
                                     SettingsMap{{"estimator", "direct"}}, SettingsMap{{"plan", "full"}}}) {
      const Job forced = job(c.scene, 24, 1, asked);
      EXPECT_TRUE(forced.work().development) << c.scene;
      EXPECT_EQ(forced.plan().find("a trial found"), std::string::npos) << forced.plan();
    }
  }
}

// Claim: the plan says which techniques run and why not the others.
TEST(Optimis, PlanSaysWhy) {
  const Job one("box-diffuse", "optimis", {}), point("point", "optimis", {}),
      many("many-lamps", "optimis", {});
  EXPECT_NE(one.plan().find("there is one emitter"), std::string::npos) << one.plan();
  EXPECT_NE(point.plan().find("one technique needs no weights"), std::string::npos) << point.plan();
  EXPECT_FALSE(point.work().development);
  EXPECT_NE(many.plan().find("3 techniques, 240 bytes of sums a pixel"), std::string::npos) << many.plan();
}

}  // namespace
}  // namespace candela::statistical
