// Groups of lights of optimis in the full renderer: controls, the image against that of one group, and bytes.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "tests/proofs/proofs.h"
#include "tests/statistical/optimis_job.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"OptimisGroups.ControlsHaveExpectationOne", "OptimisGroups.AgreeWithPath"});

// Matt and rough things under two lamps, one of them hidden from most points, a sun and an uneven sky. A
// mirror and glass stand before some first vertices.
const std::string kManyKinds =
    R"(<scene version="3.0.0"><integrator type="path"/>
    <sensor type="perspective"><float name="fov" value="40"/><transform name="to_world"><lookat origin="0,-3,3" target="0,0,0" up="0,0,1"/></transform></sensor>
    <shape type="rectangle"><transform name="to_world"><scale value="2"/></transform><bsdf type="diffuse"/></shape>
    <shape type="sphere"><point name="center" x="-0.6" y="-0.4" z="0.3"/><float name="radius" value="0.3"/><bsdf type="roughconductor"/></shape>
    <shape type="sphere"><point name="center" x="0.1" y="-0.5" z="0.3"/><float name="radius" value="0.25"/><bsdf type="conductor"/></shape>
    <shape type="sphere"><point name="center" x="0.7" y="-0.4" z="0.3"/><float name="radius" value="0.25"/><bsdf type="dielectric"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.3"/><rotate x="1" angle="180"/><translate x="-0.7" y="0.3" z="1.5"/></transform><emitter type="area"><rgb name="radiance" value="3, 2, 1"/></emitter></shape>
    <shape type="sphere"><point name="center" x="0.7" y="0.3" z="1.5"/><float name="radius" value="0.1"/><emitter type="area"><rgb name="radiance" value="10, 30, 60"/></emitter></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.5"/><translate x="0.7" y="0.3" z="1.3"/></transform></shape>
    <emitter type="directional"><vector name="direction" x="0.6" y="0.3" z="-1"/><rgb name="irradiance" value="0.3"/></emitter>
    <emitter type="sky"><float name="turbidity" value="3"/></emitter></scene>)";

Job job_of(const SettingsMap& settings) {
  TestScene scene = scene_from_xml(kManyKinds, kExtent, kExtent);
  scene.settings.sampler = "independent";
  SettingsMap all = {{"max_depth", "4"}, {"weights", "optimal"}};
  for (const auto& [name, value] : settings) all[name] = value;
  return Job(with_integrator(std::move(scene), "optimis", all));
}

// Claim: in each group each control has the expectation 1 for each batch, and all groups count the same
// batches. t tests of 16 batches at 6e-7 (t > 8.25 with 15 degrees of freedom), 34 of them: a false alarm for
// other seeds with at most 2e-5.
TEST(OptimisGroups, ControlsHaveExpectationOne) {
  struct Case {
    SettingsMap settings;
    std::size_t groups;
  };
  const Case cases[] = {{{{"light_groups", "infinite"}}, 2},
                        {{{"light_groups", "infinite"}, {"plan", "full"}, {"selection", "uniform,power"}}, 2},
                        {{{"light_groups", "each"}}, 4},
                        {{{"light_groups", "each"}, {"techniques", "bsdf,area,parallel"}}, 4}};
  std::size_t compared = 0;
  for (const Case& c : cases) {
    Job job = job_of(c.settings);
    ASSERT_EQ(job.work().accumulators.size(), 2 * c.groups) << job.plan();
    std::vector<std::vector<std::vector<double>>> values(c.groups);  // [group][batch][technique]
    for (std::size_t b = 0; b < kBatches; ++b) {
      Merged m = job.empty();
      job.merge(m, 0, b * 2, (b + 1) * 2);
      const double samples = controls_of(job, m).samples;
      for (std::size_t g = 0; g < c.groups; ++g) {
        const Controls controls = controls_of(job, m, g);
        EXPECT_NEAR(controls.samples, std::nearbyint(controls.samples), 1e-4);
        EXPECT_NEAR(controls.samples, samples, 1e-4) << g;
        values[g].push_back(controls.excess);
      }
    }
    for (std::size_t g = 0; g < c.groups; ++g)
      compared += expect_zero_means(values[g], fmt::format("group {}", g));
  }
  EXPECT_LE(compared, 34U) << "the false alarms above are for so many";
  EXPECT_GE(compared, 20U);
}

// Claim: with groups of lights the image is that of `path`, by optimal weights and by the balance heuristic.
// Six images, each at 1e-6 over its values: a false alarm over seeds with at most 6e-6.
TEST(OptimisGroups, AgreeWithPath) {
  const Regions regions(kExtent, kExtent, 16);
  TestScene scene = scene_from_xml(kManyKinds, kExtent, kExtent);
  scene.settings.sampler = "independent";
  Job path(with_integrator(std::move(scene), "path", {{"max_depth", "4"}}));
  const std::uint64_t iterations = long_form() ? 16 : 4;  // of a half
  const Rows expected = path.rows({}, iterations, regions);
  for (const SettingsMap& settings :
       {SettingsMap{{"light_groups", "infinite"}}, SettingsMap{{"light_groups", "each"}},
        SettingsMap{{"light_groups", "infinite"}, {"plan", "full"}}}) {
    Job groups = job_of(settings);
    for (const char* estimator : {"crossfit", "balance"}) {
      const Rows rows = groups.rows(estimator, iterations, regions);
      EXPECT_GT(expect_same_means(rows, expected, regions, estimator), regions.values() / 2);
    }
  }
}

// Claim: the image is the film and the sum of the corrections of all groups, each by its own slopes.
TEST(OptimisGroups, CorrectionsAreTheSumOverGroups) {
  Job job = job_of({{"light_groups", "each"}});
  Merged m = job.empty();
  for (const std::uint32_t half : {0U, 1U}) job.merge(m, half, 0, 8);
  std::vector<double> sum(std::size_t{kExtent} * kExtent * 3);
  constexpr std::size_t kSun = 2;
  double largest = 0;
  DevelopmentPlan one = *job.work().development;
  one.constants.erase("groups");
  for (std::size_t g = 0; g < 4; ++g) {
    const auto corrections =
        correct({one, "crossfit", kExtent, kExtent, [&](std::string_view name, std::uint32_t half) {
                   return m.find(pixel_sums::name_of(name, g), half);
                 }});
    ASSERT_TRUE(corrections.ok());
    double of_group = 0;
    for (const auto& half : *corrections)
      for (std::size_t i = 0; i < sum.size(); ++i) {
        sum[i] += static_cast<double>(half[i]);
        of_group = std::max(of_group, std::abs(static_cast<double>(half[i])));
      }
    // One technique alone finds the sun: no slopes change it.
    EXPECT_EQ(of_group > 0, g != kSun) << "group " << g;
    largest = std::max(largest, of_group);
  }
  const auto all = correct({*job.work().development, "crossfit", kExtent, kExtent,
                            [&](std::string_view name, std::uint32_t half) { return m.find(name, half); }});
  ASSERT_TRUE(all.ok());
  for (std::size_t i = 0; i < sum.size(); ++i)
    ASSERT_NEAR(static_cast<double>((*all)[0][i]) + static_cast<double>((*all)[1][i]), sum[i],
                1e-5 * largest);
}

// Claim: threads and the grouping into units change no bit of film and sums.
TEST(OptimisGroups, UnitsAndThreadsChangeNothing) {
  Job job = job_of({{"light_groups", "infinite"}});
  Merged whole = job.empty(), parts = job.empty();
  job.merge(whole, 1, 4, 10, 4);
  for (const auto& [begin, end] : {std::pair{7, 10}, {4, 5}, {5, 7}})
    job.merge(parts, 1, static_cast<std::uint64_t>(begin), static_cast<std::uint64_t>(end), 1);
  EXPECT_EQ(whole.film.develop(0), parts.film.develop(0));
  ASSERT_EQ(whole.sums[1].size(), 4U);
  for (std::size_t i = 0; i < whole.sums[1].size(); ++i)
    EXPECT_EQ(whole.sums[1][i].serialise(), parts.sums[1][i].serialise()) << i;
}

// Claim: the plan says how many groups there are, and what their sums take; a scene whose lights are in one
// group has none; more lights than can be groups of their own are refused.
TEST(OptimisGroups, ThePlanSaysWhatTheyTake) {
  EXPECT_NE(job_of({{"light_groups", "infinite"}}).plan().find("2 groups"), std::string::npos);
  // 4 groups of 2 techniques: 4 * 9 sums of 16 bytes.
  const Job each = job_of({{"light_groups", "each"}});
  EXPECT_NE(each.plan().find("2 techniques, 576 bytes of sums a pixel"), std::string::npos) << each.plan();
  const Job one("box-diffuse", "optimis", {{"light_groups", "each"}, {"weights", "optimal"}});
  EXPECT_NE(one.plan().find("in one group"), std::string::npos) << one.plan();
  EXPECT_EQ(one.work().accumulators.size(), 2U);
  TestScene many = load("many-lamps", "optimis", {{"light_groups", "each"}});
  const auto refused = render::Renderer::create(*many.files, many.main_key, {}, many.settings, 1);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().field, "light_groups") << refused.error().to_string();
}

}  // namespace
}  // namespace candela::statistical
