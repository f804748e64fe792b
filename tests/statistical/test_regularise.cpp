// Jobs that mollify: chains in a scene of mollified light alone against a closed form; the radius that falls
// over a job, in scenes of any size and place; rooms against merging.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <sstream>
#include <string>

#include "tests/paths.h"
#include "tests/proofs/proofs.h"
#include "tests/regularised_scenes.h"
#include "tests/statistical/block_tests.h"
#include "tests/statistical/chain_driver.h"
#include "tests/statistical/moments.h"
#include "worker/scene/features.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h. (Not those of chains, whose b is of counts.)
const proofs::FilmsDecide kFilms({"Regularised"});

struct Method {
  std::string integrator;
  SettingsMap settings;
  double length;  // of the edge whose end is mollified
};

// Claim: chains over a lamp that is seen over two mirrors, for which no technique has a path, show the flux
// of the lamp's image: path tracing mollifies the mirror at the lamp, bidirectional path tracing and mmlt
// that at the eye. b is the mean of the image. The bias is a quarter of (r / l)^2, and the disc's spread over
// the flat film at most one per cent more.
TEST(RegularisedChains, LampOverTwoMirrors) {
  constexpr double r = 0.15;
  const double half = std::tan(15 * std::numbers::pi / 180);
  const test::SceneText text = test::scene_t(30);
  const TestScene plain = scene_from_xml(
      "<scene version=\"3.0.0\"><integrator type=\"path\"/>" + text.sensor + text.body + "</scene>", 16, 16);
  const double radius = static_cast<double>(make_renderer(plain)->features()->radius);
  for (const Method& method :
       {Method{"pssmlt", {}, test::SceneT::kBeforeA},
        Method{"pssmlt", {{"over", "path"}}, test::SceneT::kBeforeB},
        // Most states have another length or technique.
        Method{"mmlt", {{"bootstrap", "100000"}, {"mutations", "256"}}, test::SceneT::kBeforeA}}) {
    SettingsMap settings = method.settings;
    settings.insert({{"regularise", "on"},
                     {"regularise_radius", std::to_string(r / radius)},
                     {"regularise_exponent", "0"},
                     {"max_depth", "3"},
                     {"chains", "40"},
                     {"bootstrap", "20000"},
                     {"mutations", "64"}});  // a method's own win
    ChainJob job;
    job.scene = with_integrator(plain, method.integrator, settings);
    job.rounds = 2;
    Moments image, b;
    for (std::uint64_t seed = 0; seed < 8; ++seed) {
      const ChainImage one = render_chains(job, 45 + seed);
      double sum = 0;
      for (std::size_t i = 0; i < one.image.size(); i += 3) sum += one.image[i + 1];
      image.add(sum / (static_cast<double>(one.width) * one.height));
      b.add(one.b.b);
    }
    const double q = r * r / (method.length * method.length), flux = 5 / (3.4 * 3.4) * (1 - q / 4);
    const double expected = flux / (4 * half * half);
    EXPECT_NEAR(image.mean(), expected, 6 * image.error() + 0.015 * expected)
        << method.integrator << " +- " << image.error();
    EXPECT_LT(image.error(), 0.06 * expected) << method.integrator;
    EXPECT_NEAR(image.mean() / b.mean(), 1, 0.02) << method.integrator;
  }
}

// Claim: chains over paths show mollified light as bidirectional path tracing does, which knows nothing of
// the literal formulas and the mutations of mlt: over mirrors and through glass from either side, of lamps,
// of directions and beside regular light, at one radius.
TEST(RegularisedChains, MltAgreesWithBdpt) {
  struct Scene {
    const char* name;
    const char* depth;
    const char* radius;
  };
  constexpr std::uint32_t kExtent = 16;
  const Regions regions(kExtent, kExtent, 8);
  std::uint64_t seed = 4700;
  std::vector<Scene> scenes{{"directional-caustic", "4", "0.3"}};
  if (long_form()) scenes.insert(scenes.end(), {{"point-sds", "5", "0.3"}, {"bulb-room", "5", "0.3"}});
  for (const Scene& one : scenes) {
    SCOPED_TRACE(one.name);
    const SettingsMap of_both{{"regularise", "on"},
                              {"regularise_exponent", "0"},
                              {"regularise_radius", one.radius},
                              {"max_depth", one.depth}};
    TestScene scene = scene_from_transport(one.name, kExtent, kExtent);
    use_own_filter(scene);
    BatchPlan plan;
    plan.seed = seed << 32;
    plan.iterations = long_form() ? 512 : 64;
    const Estimator right =
        cached(make_estimator("bdpt", {{1.0, with_integrator(scene, "bdpt", of_both)}}, plan, regions));
    SettingsMap settings = of_both;
    settings.insert({{"direct", "chain"},
                     {"chains", "64"},
                     {"bootstrap", "8192"},
                     {"mutations", "16"},
                     {"large_step", "0.3"}});
    ChainJob job;
    job.scene = with_integrator(scene, "mlt", settings);
    job.rounds = long_form() ? 64 : 4;
    const Estimator tested = make_chain_estimator("mlt", job, (seed + 1) << 32, 16, regions);
    BlockTest test;
    test.decide = 0.2;
    const Verdict verdict = compare(tested, right, regions, test);
    std::printf("%s: %s\n", one.name, verdict.report.c_str());
    EXPECT_TRUE(verdict.agree) << verdict.report;
    EXPECT_GT(verdict.tested * 2, verdict.values) << verdict.report;
    seed += 2;
  }
}

// Claim: scenes that the plan leaves as they are have the same film with the option on, to the bit, and the
// plan says why: of area lamps alone, without specular surfaces, and with a lens that has an area.
TEST(Regularised, ScenesThatArePassedOverStayAsTheyAre) {
  constexpr const char *kNoPoint = "no light is a point or a direction",
                       *kNoMirror = "no surface is specular", *kLens = "the lens has an area";
  // A lamp behind a ball of glass, seen by a wide lens: path alone lacks it.
  const char* const wide =
      R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="4"/>
    </integrator><sensor type="thinlens"><float name="aperture_radius" value="0.2"/><float name="focus_distance"
    value="3"/><transform name="to_world"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform></sensor>
    <shape type="rectangle"><transform name="to_world"><scale value="3"/><translate z="-1"/></transform></shape>
    <shape type="sphere"><float name="radius" value="0.8"/><bsdf type="dielectric"/></shape>
    <emitter type="point"><point name="position" x="0" y="0" z="2"/></emitter></scene>)";
  std::vector<std::pair<TestScene, const char*>> all;
  for (const auto& [name, why] : {std::pair{"box-diffuse", kNoPoint},
                                  {"caustic", kNoPoint},
                                  {"mirror-room", kNoPoint},
                                  {"rough-glass", kNoPoint},
                                  {"point", kNoMirror}})
    all.emplace_back(scene_from_transport(name, 8, 8), why);
  all.emplace_back(scene_from_xml(wide, 8, 8), kLens);
  for (const auto& [scene, why] : all) {
    for (const std::string integrator : {"path", "bdpt", "pssmlt", "mmlt", "mlt", "erpt"}) {
      SCOPED_TRACE(fmt::format("{} {}", why, integrator));
      const bool chains = integrator.ends_with("mlt");
      const auto with = [&](const char* choice) {
        SettingsMap settings{{"regularise", choice}, {"regularise_layer", "true"}};
        if (integrator == "mlt" || integrator == "erpt") settings["direct"] = "chain";
        if (chains) settings.insert({{"chains", "4"}, {"bootstrap", "2000"}, {"mutations", "4"}});
        return with_integrator(scene, integrator, settings);
      };
      const auto plan = make_renderer(with("on"))->plan_text();
      ASSERT_TRUE(plan.ok()) << plan.error().to_string();
      const bool skips = plan->find(std::string("skip mollified connections: ") + why) != std::string::npos;
      if (integrator == "path" && why == kLens) {
        EXPECT_FALSE(skips) << *plan;
        continue;
      }
      EXPECT_TRUE(skips) << *plan;
      if (chains) {
        ChainJob on{with("on")}, off{with("off")};
        const ChainImage with_it = render_chains(on, 3), without = render_chains(off, 3);
        EXPECT_EQ(with_it.sums, without.sums);
        EXPECT_EQ(with_it.records, without.records);
      } else {
        EXPECT_EQ(render_batches(with("on"), 3, 1, 4), render_batches(with("off"), 3, 1, 4));
      }
    }
  }
}

// Claim: the layer of mollified light has what the option adds, for every integrator that has it: in a scene
// of such light alone all of the image.
TEST(Regularised, LayerHasWhatIsMollified) {
  const test::SceneText text = test::scene_t(30);
  const TestScene plain = scene_from_xml(
      "<scene version=\"3.0.0\"><integrator type=\"path\"/>" + text.sensor + text.body + "</scene>", 8, 8);
  for (const auto& [integrator, over] :
       {std::pair{"pssmlt", "bdpt"}, {"pssmlt", "path"}, {"mmlt", ""}, {"mlt", ""}}) {
    SCOPED_TRACE(fmt::format("{} {}", integrator, over));
    SettingsMap settings{{"regularise", "on"},
                         {"regularise_radius", "0.2"},
                         {"regularise_layer", "true"},
                         {"max_depth", "3"},
                         {"chains", "4"},
                         {"bootstrap", "30000"},
                         {"mutations", "64"},
                         {"direct", "chain"}};
    if (*over != 0) settings["over"] = over;
    ChainJob job{with_integrator(plain, integrator, settings)};
    const ChainImage one = render_chains(job, 9);
    const std::size_t layer = 8 * 8 * 3;
    ASSERT_EQ(one.sums.size(), 4 * layer);
    double image = 0, mollified = 0;
    for (std::size_t i = 0; i < 2 * layer; ++i) {
      image += static_cast<double>(one.sums[i]);
      mollified += static_cast<double>(one.sums[2 * layer + i]);
    }
    EXPECT_GT(image, 0);
    EXPECT_NEAR(mollified / image, 1, 1e-6);
    for (const chains::ChainRecord& record : one.records) {
      ASSERT_TRUE(record.counts.mollified.has_value());
      EXPECT_NEAR(record.counts.mollified->start_share, 1, 1e-6);
      EXPECT_NEAR(record.counts.mollified->large_sum, record.counts.large_sum,
                  1e-6 * record.counts.large_sum);
    }
  }
}

// Scene T, by each integrator: a job whose radius falls.
struct FallingCase {
  const char* integrator;
  double size = 1;
  Vec3d moved = {};
  double first = 0.2;  // radius of the first sample, over the size
};

// Claim: with a radius that falls as n^-1/6 the mean of N samples has the bias of the theory, that of one
// sample times the mean of n^-1/3, for scenes of all sizes, and far from the origin. The first radius may be
// longer than all edges: the mean is then finite, and ends near the light there is.
// [regularisation note, sections 6, 13, 17]
TEST(Regularised, RadiusThatFallsConverges) {
  const double half = std::tan(30 * std::numbers::pi / 180);
  constexpr std::uint64_t kIterations = 128, kBatches = 12;
  constexpr std::uint32_t kSide = 24;
  for (const FallingCase& one :
       {FallingCase{"path"}, FallingCase{"bdpt"}, FallingCase{"bdpt", 1e-4}, FallingCase{"bdpt", 1e6},
        FallingCase{"path", 1e-4}, FallingCase{"erpt"}, FallingCase{"bdpt", 1, {3000, -2000, 1000}},
        FallingCase{"path", 1, {3000, -2000, 1000}}, FallingCase{"bdpt", 1, {}, 4}}) {
    SCOPED_TRACE(fmt::format("{} size {} at {} radius {}", one.integrator, one.size, one.moved.x, one.first));
    const test::SceneText text = test::scene_t(60, one.size, one.moved);
    const TestScene plain = scene_from_xml(
        "<scene version=\"3.0.0\"><integrator type=\"path\"/>" + text.sensor + text.body + "</scene>", 24,
        24);
    const double bound = static_cast<double>(make_renderer(plain)->features()->radius);
    SettingsMap settings{
        {"regularise", "on"},
        {"regularise_radius", fmt::format("{}", std::min(1.0, one.first * one.size / bound))},
        {"max_depth", "3"}};
    if (std::string(one.integrator) == "erpt") settings["direct"] = "chain";
    const TestScene scene = with_integrator(plain, one.integrator, settings);
    Moments mean;
    for (const auto& image : render_batches(scene, 4500, kBatches, kIterations)) {
      double sum = 0;  // over directions: a pixel of the flat film has the solid angle area cos^3
      for (std::size_t i = 0; i < kSide * kSide; ++i) {
        const auto at = [&](std::size_t k) {
          return (2 * (static_cast<double>(k) + 0.5) / kSide - 1) * half;
        };
        const double x = at(i % kSide), y = at(i / kSide);
        sum += static_cast<double>(image[3 * i + 1]) * std::pow(1 + x * x + y * y, -1.5);
      }
      mean.add(sum / (kSide * kSide));
    }
    const double length =
        std::string(one.integrator) == "path" ? test::SceneT::kBeforeB : test::SceneT::kBeforeA;
    double squares = 0;  // mean of (r / l)^2; batches are of halves, whose samples are every other one
    for (std::uint64_t n = 1; n <= 2 * kIterations; ++n)
      squares += std::pow(static_cast<double>(n), -1.0 / 3) * one.first * one.first / (length * length) /
                 (2 * kIterations);
    const double exact = 5 / (3.4 * 3.4) / (4 * half * half);
    if (one.first > 1) {
      EXPECT_GT(mean.mean(), 0.2 * exact);
      EXPECT_LT(mean.mean(), 1.2 * exact);
      continue;
    }
    const double expected = exact * (1 - squares / 4);
    EXPECT_NEAR(mean.mean(), expected, 5 * mean.error() + 0.01 * expected) << mean.error();
    // Seeds of erpt choose among lengths and techniques.
    EXPECT_LT(mean.error(), (std::string(one.integrator) == "erpt" ? 0.08 : 0.03) * expected);
  }
}

// The mean over pixels (x, y) with x in [4, 10] and y in [4, 9], which see the room in the mirror, without
// its frame and without the lamp of the bulb.
double in_the_mirror(const std::vector<float>& image, std::size_t channel) {
  double sum = 0;
  for (std::size_t y = 4; y <= 9; ++y)
    for (std::size_t x = 4; x <= 10; ++x) sum += static_cast<double>(image[(y * 16 + x) * 3 + channel]);
  return sum / 42;
}

// Compares the room, lit by point lamps behind glass and seen in a mirror, of mollified connections with that
// of an integrator that merges, and asks that connections alone have at most the share `connected` of it.
void is_that_of_merging(const TestScene& room, const std::string& merging, std::uint64_t merging_iterations,
                        const SettingsMap& all, std::uint64_t seed, double connected) {
  // The brightest paths are rare: sixteen times as many left an error of 3.6 %.
  const std::uint64_t effort = long_form() ? 32 : 1;
  const auto measure = [&](const std::string& integrator, SettingsMap settings, std::uint64_t iterations) {
    settings.insert(all.begin(), all.end());
    std::array<Moments, 3> channels;
    for (const auto& image :
         render_batches(with_integrator(room, integrator, settings), seed, 24, iterations * effort))
      for (std::size_t c = 0; c < 3; ++c) channels[c].add(in_the_mirror(image, c));
    return channels;
  };
  const auto blurred = measure("bdpt", {{"regularise", "on"}, {"regularise_radius", "0.15"}}, 64);
  const auto plain = measure("bdpt", {}, 8);
  const auto merged = measure(merging, {{"radius", "0.02"}, {"light_paths", "8"}}, merging_iterations);
  for (std::size_t c = 0; c < 3; ++c) {
    const double error = std::hypot(blurred[c].error(), merged[c].error());
    std::printf("channel %zu: regularised %.4f +- %.4f, merged %.4f +- %.4f, connections alone %.4f\n", c,
                blurred[c].mean(), blurred[c].error(), merged[c].mean(), merged[c].error(), plain[c].mean());
    EXPECT_NEAR(blurred[c].mean(), merged[c].mean(), 5 * error + 0.005 * merged[c].mean());
    EXPECT_LT(error, (long_form() ? 0.03 : 0.12) * merged[c].mean());
    EXPECT_LT(plain[c].mean(), connected * merged[c].mean());
  }
}

// Claim: a room lit by point lamps behind glass, seen in a mirror, of which bidirectional path tracing alone
// shows nothing but light of more bounces, converges to the picture of vertex connection and merging. The
// bias of the theory is below a thousandth here: the shortest edge that is mollified is 1.9 long.
TEST(Regularised, RoomInAMirrorIsThatOfMerging) {
  is_that_of_merging(scene_from_transport("bulb-room", 16, 16), "vcm", 16, {}, 4600, 0.7);
}

// The room with a bulb, full of fog; glass keeps it out.
std::string foggy_bulb_room() {
  std::ifstream file(test::source_path("tests/statistical/transport/bulb-room.xml"));
  std::stringstream all;
  all << file.rdbuf();
  std::string text = all.str();
  const auto insert = [&](const std::string& after, const std::string& more) {
    const std::size_t at = text.find(after);
    ASSERT_NE(at, std::string::npos) << after;
    text.insert(at + after.size(), more);
  };
  insert("<integer name=\"max_depth\" value=\"7\"/>\n  </integrator>",
         "<medium type=\"homogeneous\" id=\"fog\"><rgb name=\"sigma_t\" value=\"0.2, 0.3, 0.45\"/><rgb "
         "name=\"albedo\" value=\"0.9, 0.8, 0.7\"/></medium>");
  insert("<float name=\"fov\" value=\"$fov\"/>", "<ref id=\"fog\"/>");
  insert("<float name=\"radius\" value=\"0.13\"/>", "<ref name=\"exterior\" id=\"fog\"/>");
  insert("<translate x=\"0.62\" y=\"-0.66\" z=\"-0.55\"/></transform>",
         "<ref name=\"exterior\" id=\"fog\"/>");
  insert("value=\"0.25, 0.4, 0.8\"/>", "<ref id=\"fog\"/>");
  return text;
}

// Claim: a room full of fog, lit by point lamps behind glass and seen in a mirror, is for mollified
// bidirectional path tracing as bright as for upbp, which merges and has beams. The bias of the theory is
// below 0.005: the shortest edge that is mollified is 1.9 long, the radius 0.26. [regularisation note,
// section 10]
TEST(Regularised, RoomInFogIsThatOfMerging) {
  is_that_of_merging(scene_from_xml(foggy_bulb_room(), 16, 16), "upbp", 8, {{"max_depth", "5"}}, 4800, 0.9);
}

}  // namespace
}  // namespace candela::statistical
