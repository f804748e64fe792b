// Integrators with a radius for each pixel, unit by unit: settings, plans, maps of levels, statistics.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/adaptive/channels.h"
#include "common/stages/decision.h"
#include "common/stats/inner_merges.h"
#include "tests/integrators.h"
#include "tests/replay.h"
#include "tests/unit/scene_fixture.h"
#include "worker/render/renderer.h"

namespace candela::render {
namespace {

constexpr std::uint32_t kSize = 24;

// A lit box with a glass ball in it.
const std::string kBox =
    "<shape type=\"cube\"><bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf></shape>"
    "<shape type=\"sphere\"><point name=\"center\" x=\"0.3\" y=\"-0.4\" z=\"0.4\"/><float name=\"radius\" "
    "value=\"0.3\"/><bsdf type=\"dielectric\"/></shape>"
    "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"0.3\"/><rotate x=\"1\" "
    "angle=\"90\"/><translate y=\"0.99\"/></transform><emitter type=\"area\"/></shape>";

const std::vector<std::string> kAdaptive = {"fppm", "cppm", "appm", "vcmplus"};

std::unique_ptr<Renderer> make(const std::string& integrator, const std::string& body,
                               const SettingsMap& chosen = {}, const std::string& filter = "box") {
  const test::TextFiles files(
      {{"scene.xml", "<scene version=\"3.0.0\"><integrator type=\"path\"/><sensor type=\"perspective\"/>" +
                         body + "</scene>"}});
  JobSettings job;
  job.integrator = integrator;
  job.width = job.height = kSize;
  job.seed = 3;
  job.filter = filter;
  const auto settings = complete_integrator_settings(integrator, {}, chosen);
  if (!settings.ok()) throw std::runtime_error(settings.error().to_string());
  job.integrator_settings = *settings;
  auto renderer = Renderer::create(files, "scene.xml", {}, job, 1);
  if (!renderer.ok()) throw std::runtime_error(renderer.error().to_string());
  return std::move(*renderer);
}

PilotResult pilot(const Renderer& renderer) {
  const auto result = renderer.pilot({});
  if (!result.ok()) throw std::runtime_error(result.error().to_string());
  return *result;
}

UnitOutput run(const Renderer& renderer, const std::string& map, const Unit& unit,
               const RunContext& context = {}) {
  const PilotResult asked = pilot(renderer);
  UnitOutput output = renderer.make_output(asked.state);
  UnitInput input{asked.state, {}, {}};
  if (asked.work.epochs) input.states[asked.work.epochs->rule] = map;
  const auto done = renderer.run(unit, input, output, context);
  if (!done.ok()) throw std::runtime_error(done.error().to_string());
  return output;
}

std::string constant_map() {
  return std::string(kSize * kSize, '\0');
}
// Levels 0 to 5 side by side.
std::string mixed_map() {
  std::string map = constant_map();
  for (std::size_t i = 0; i < map.size(); ++i) map[i] = static_cast<char>((i + i / kSize) % 6);
  return map;
}

std::vector<std::int64_t> sums(const film::UnitFilm& film) {
  return {film.sums(), film.sums() + film.layout().pixel_count() * film.layout().layers * film::kChannels};
}
std::vector<std::int64_t> sums(const film::UnitAccumulator& sums) {
  return {sums.sums(), sums.sums() + std::size_t{kSize} * kSize * sums.spec().channels};
}

// Claim: with one level for all pixels, vcmplus renders the film of vcm with the same alpha, and fppm, cppm
// and appm that of ppm at a constant radius, bit for bit: with any filter, in media, with any kernel.
TEST(Adaptive, OneLevelIsTheIntegratorWithoutTests) {
  const std::string fog =
      "<shape type=\"sphere\"><float name=\"radius\" value=\"0.9\"/><bsdf type=\"null\"/><medium "
      "name=\"interior\" type=\"homogeneous\"><float name=\"sigma_t\" value=\"1\"/><rgb name=\"albedo\" "
      "value=\"0.5, 0.5, 0.5\"/></medium></shape>";
  for (const std::string& integrator : kAdaptive) {
    const bool plus = integrator == "vcmplus";
    std::vector<std::pair<std::string, SettingsMap>> cases = {
        {kBox, {{"radius", "0.03"}}}, {kBox + fog, {{"radius", "0.03"}, {"kernel", "epanechnikov"}}}};
    if (plus) cases.push_back({kBox + fog, {{"radius", "0.003"}, {"merge_media", "true"}}});
    for (const auto& [body, settings] : cases) {
      SettingsMap of_adaptive = settings, of_plain = settings;
      if (plus) of_adaptive["alpha"] = "0.8";
      of_plain["alpha"] = plus ? "0.8" : "1";
      const auto adaptive = make(integrator, body, of_adaptive, "gaussian");
      const auto plain = make(plus ? "vcm" : "ppm", body, of_plain, "gaussian");
      const Unit unit{Unit::Kind::iterations, 1, 2, 4};
      const auto one = run(*adaptive, constant_map(), unit), other = run(*plain, "", unit);
      // The search for appm's stencil reaches further and finds photons in another order.
      if (integrator != "appm") {
        EXPECT_EQ(sums(*one.film), sums(*other.film)) << integrator;
      }
      film::SampleCounts sample_counts = one.film->sample_counts();
      // Only integrators that decide radii count these.
      sample_counts.sampled_merges = sample_counts.repeated_merges = 0;
      EXPECT_EQ(sample_counts, other.film->sample_counts()) << integrator;
    }
  }
}

// Claim: a unit with a mixed map is a pure function of its indices, not of threads or cuts, statistics
// included; every sum collects something, and nothing is rejected.
TEST(Adaptive, ThreadsAndCutsChangeNothing) {
  for (const std::string& integrator : kAdaptive) {
    const auto renderer = make(integrator, kBox, {{"radius", "0.02"}}, "gaussian");
    const PilotResult asked = pilot(*renderer);
    ASSERT_TRUE(asked.work.epochs);
    UnitInput input{asked.state, {}, {}};
    const std::string map = mixed_map();
    input.states[asked.work.epochs->rule] = map;
    auto one = renderer->make_output(asked.state), cut = renderer->make_output(asked.state);
    ASSERT_TRUE(renderer->run({Unit::Kind::iterations, 1, 1, 4}, input, one, {1}).ok());
    ASSERT_TRUE(renderer->run({Unit::Kind::iterations, 1, 2, 4}, input, cut, {4}).ok());
    ASSERT_TRUE(renderer->run({Unit::Kind::iterations, 1, 1, 2}, input, cut, {3}).ok());
    EXPECT_EQ(sums(*one.film), sums(*cut.film)) << integrator;
    EXPECT_EQ(one.film->sample_counts(), cut.film->sample_counts()) << integrator;
    EXPECT_GT(one.film->sample_counts().sampled_merges, 0U) << integrator;
    ASSERT_EQ(one.accumulators.size(), asked.work.accumulators.size());
    for (std::size_t i = 0; i < one.accumulators.size(); ++i) {
      EXPECT_EQ(one.accumulators[i]->spec(), asked.work.accumulators[i]) << integrator;
      const auto values = sums(*one.accumulators[i]);
      EXPECT_EQ(values, sums(*cut.accumulators[i])) << integrator;
      EXPECT_NE(std::accumulate(values.begin(), values.end(), std::int64_t{0}), 0) << integrator;
    }
    for (const std::uint64_t count : one.film->sample_counts().rejected) EXPECT_EQ(count, 0U) << integrator;
  }
}

// Claim: with the constant kernel, one level and a box filter, the sectors of fppm add up to the light of the
// pixels that see no light by themselves, at the first radius: phi has the unit of the film.
TEST(Adaptive, SectorsAddUpToTheFilm) {
  const auto renderer = make("fppm", kBox, {{"radius", "0.05"}, {"hide_emitters", "true"}});
  const auto output = run(*renderer, constant_map(), {Unit::Kind::iterations, 0, 0, 2});
  const auto film = sums(*output.film), sectors = sums(*output.accumulators[0]);
  const double film_scale = std::ldexp(1.0, -output.film->scale_log2());
  const double sector_scale = std::ldexp(1.0, -output.accumulators[0]->spec().scale_log2);
  double largest = 0;
  for (std::size_t p = 0; p < constant_map().size(); ++p) {
    double light = 0;
    const double weights[] = {0.212671, 0.715160, 0.072169};
    for (std::size_t c = 0; c < 3; ++c)
      light += weights[c] * static_cast<double>(film[3 * p + c]) * film_scale;
    double sum = 0;
    for (std::size_t s = 0; s < 12; ++s) sum += static_cast<double>(sectors[12 * p + s]) * sector_scale;
    EXPECT_NEAR(sum, light, 1e-4 * light + 20 * sector_scale) << p;
    largest = std::max(largest, light);
  }
  EXPECT_GT(largest, 0);
}

// Claim: a sample's statistics go to the pixel that its place on the film is in, whose radius it has, though
// it was drawn for another pixel and adds to that one's light.
TEST(Adaptive, StatisticsFollowTheFilmPosition) {
  // The wall covers one half of the film: its edge is between columns 11 and 12.
  const auto renderer = make("fppm",
                             "<shape type=\"rectangle\"><transform name=\"to_world\"><rotate y=\"1\" "
                             "angle=\"180\"/><translate x=\"1\"/><scale value=\"9\"/><translate "
                             "z=\"5\"/></transform></shape><emitter type=\"point\"/>",
                             {{"radius", "0.2"}}, "gaussian");
  const auto output = run(*renderer, constant_map(), {Unit::Kind::iterations, 0, 0, 4});
  std::array<std::int64_t, kSize> light{}, statistics{};
  const auto film = sums(*output.film), sectors = sums(*output.accumulators[0]);
  for (std::size_t p = 0; p < constant_map().size(); ++p) {
    for (std::size_t c = 0; c < 3; ++c) light[p % kSize] += film[3 * p + c];
    for (std::size_t s = 0; s < 12; ++s) statistics[p % kSize] += sectors[12 * p + s];
  }
  const bool left = light[0] > 0;
  EXPECT_GT(statistics[left ? 11 : 12], 0);
  EXPECT_GT(light[left ? 12 : 11], 0);  // through the filter
  for (std::size_t x = 0; x < kSize / 2; ++x) EXPECT_EQ(statistics[left ? x + kSize / 2 : x], 0) << x;
}

// Claim: where nothing can be merged no epochs are asked for, and black pixels bring no statistics.
TEST(Adaptive, NothingToMergeIsNothingToDecide) {
  const std::string mirrors =
      "<shape type=\"sphere\"><bsdf type=\"conductor\"/></shape><shape type=\"sphere\"><float "
      "name=\"radius\" "
      "value=\"0.1\"/><emitter type=\"area\"/></shape>";
  for (const std::string& integrator : kAdaptive) {
    for (const std::string& body : {std::string(), mirrors}) {
      const auto renderer = make(integrator, body);
      EXPECT_FALSE(pilot(*renderer).work.epochs) << integrator;
      EXPECT_TRUE(pilot(*renderer).work.accumulators.empty()) << integrator;
      run(*renderer, "", {Unit::Kind::iterations, 0, 0, 1});
    }
    // A light that shines the other way.
    const std::string dark =
        "<shape type=\"sphere\"><bsdf type=\"dielectric\"/></shape><shape type=\"rectangle\"><transform "
        "name=\"to_world\"><translate z=\"-5\"/></transform><bsdf type=\"diffuse\"/></shape><shape "
        "type=\"rectangle\"><transform name=\"to_world\"><rotate y=\"1\" angle=\"180\"/><translate "
        "z=\"-9\"/></transform><emitter type=\"area\"/></shape>";
    const auto renderer = make(integrator, dark);
    ASSERT_TRUE(pilot(*renderer).work.epochs) << integrator;
    const auto output = run(*renderer, mixed_map(), {Unit::Kind::iterations, 0, 0, 1});
    for (const auto& accumulator : output.accumulators)
      for (const std::int64_t value : sums(*accumulator)) EXPECT_EQ(value, 0) << integrator;
  }
}

// Claim: a sample that the film refuses adds no statistics.
TEST(Adaptive, QuarantinedSamplesBringNoStatistics) {
  for (const std::string& integrator : kAdaptive) {
    const auto renderer = make(integrator, kBox, {{"radius", "0.05"}});
    RunContext context;
    context.fault = [](std::uint64_t, float* rgb) { rgb[1] = std::numeric_limits<float>::quiet_NaN(); };
    const auto output = run(*renderer, constant_map(), {Unit::Kind::iterations, 0, 0, 1}, context);
    for (const auto& accumulator : output.accumulators)
      for (const std::int64_t value : sums(*accumulator)) EXPECT_EQ(value, 0) << integrator;
  }
}

// Claim: a unit is refused without a state, with one of another film, or with a level that the job has not.
TEST(Adaptive, OtherStatesAreRefused) {
  for (const std::string& integrator : kAdaptive) {
    const auto renderer = make(integrator, kBox, {{"r_min", "0.5"}});
    const PilotResult asked = pilot(*renderer);
    std::string deep = constant_map();
    deep.back() = '\xff';
    for (const std::string& map : {std::string(), constant_map() + '\0', deep}) {
      if (integrator == "appm" && map == deep) continue;  // has all levels
      UnitOutput output = renderer->make_output(asked.state);
      UnitInput input{asked.state, {}, {}};
      if (!map.empty()) input.states[asked.work.epochs->rule] = map;
      const auto done = renderer->run({Unit::Kind::iterations, 0, 0, 1}, input, output, {});
      ASSERT_FALSE(done.ok()) << integrator;
      EXPECT_EQ(done.error().kind, ErrorKind::input);
      EXPECT_EQ(done.error().field, "states");
    }
  }
}

// Claim: appm has sums of media where media merge, and with pilot=reference sums of light and a plane of
// pilots, whose levels are checked; the statistics follow the pilots, the film does not.
TEST(Adaptive, PilotsAreAPlaneOfTheState) {
  const std::string fog =
      "<shape type=\"sphere\"><float name=\"radius\" value=\"0.9\"/><bsdf type=\"null\"/><medium "
      "name=\"interior\" type=\"homogeneous\"><float name=\"sigma_t\" value=\"1\"/><rgb name=\"albedo\" "
      "value=\"0.5, 0.5, 0.5\"/></medium></shape>";
  const SettingsMap reference = {{"radius", "0.03"}, {"pilot", "reference"}};
  for (const bool medium : {false, true}) {
    const auto renderer = make("appm", medium ? kBox + fog : kBox, reference);
    const auto asked = pilot(*renderer);
    ASSERT_EQ(asked.work.accumulators.size(), 4U);  // the last measures the bias
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_EQ(asked.work.accumulators[i].channels, medium && i < 2 ? 2U : 1U) << i;
    const Unit unit{Unit::Kind::iterations, 0, 0, 2};
    const auto wide = run(*renderer, constant_map() + constant_map(), unit);
    std::string narrow_pilots = constant_map();
    std::fill(narrow_pilots.begin(), narrow_pilots.end(), '\x20');
    const auto narrow = run(*renderer, constant_map() + narrow_pilots, unit);
    EXPECT_EQ(sums(*wide.accumulators[0]), sums(*narrow.accumulators[0]));
    EXPECT_NE(sums(*wide.accumulators[1]), sums(*narrow.accumulators[1]));
    const auto means = sums(*wide.accumulators[2]);
    EXPECT_GT(std::accumulate(means.begin(), means.end(), std::int64_t{0}), 0);
    for (const std::string& pilots : {std::string(), std::string(kSize * kSize, '\x4b')}) {
      UnitOutput output = renderer->make_output(asked.state);
      UnitInput input{asked.state, {}, {}};
      const std::string map = constant_map() + pilots;
      input.states["appm"] = map;
      const auto done = renderer->run(unit, input, output, {});
      ASSERT_FALSE(done.ok());
      EXPECT_EQ(done.error().field, "states");
    }
  }
}

// Claim: photons alone measure their bias, and others do not. In even light, on surfaces and in a medium, the
// photons within half of the radius bring the same image with each kernel: the sums are within 15 % of the
// film's of zero, where a wrong norm is off by half.
TEST(Adaptive, PhotonsAloneMeasureTheirBias) {
  for (const char* integrator : {"ppm", "bpm", "fppm", "cppm", "appm", "mcppm", "vcm", "vcmplus", "upbp"}) {
    const auto specs = pilot(*make(integrator, kBox)).work.accumulators;
    const std::string name = integrator;
    const bool alone = !name.starts_with("vcm") && name != "upbp";
    EXPECT_EQ(!specs.empty() && specs.back().name == stats::kInnerMerges, alone) << name;
  }
  const std::string furnace =
      "<shape type=\"sphere\"><float name=\"radius\" value=\"9\"/><boolean name=\"flip_normals\" "
      "value=\"true\"/><bsdf type=\"diffuse\"/><emitter type=\"area\"/></shape>";
  const std::string fog =
      "<shape type=\"sphere\"><float name=\"radius\" value=\"8.9\"/><bsdf type=\"null\"/><medium "
      "name=\"interior\" type=\"homogeneous\"><float name=\"sigma_t\" value=\"0.05\"/><rgb name=\"albedo\" "
      "value=\"0.9, 0.9, 0.9\"/></medium></shape>";
  for (const char* kernel : {"constant", "epanechnikov", "perlin"})
    for (const std::string& body : {furnace, furnace + fog}) {
      const auto renderer =
          make("ppm", body,
               {{"radius", "0.1"}, {"kernel", kernel}, {"light_paths", "8"}, {"hide_emitters", "true"}});
      const auto output = run(*renderer, "", {Unit::Kind::iterations, 0, 0, 4});
      const auto film = sums(*output.film), less = sums(*output.accumulators.at(0));
      const auto total = [](const auto& values) {
        return static_cast<double>(std::accumulate(values.begin(), values.end(), std::int64_t{0}));
      };
      EXPECT_GT(total(film), 0);
      EXPECT_NE(total(less), 0);
      EXPECT_LT(std::abs(total(less)), 0.15 * total(film)) << kernel << ' ' << body.size();
    }
}

// Claim: bad settings are errors that name the setting.
TEST(Adaptive, BadSettingsAreNamed) {
  const std::vector<std::array<std::string, 3>> bad = {
      {"fppm", "alpha_f", "0"},      {"fppm", "alpha_f", "1"},
      {"vcmplus", "alpha_f", "1.5"}, {"fppm", "k", "1"},
      {"vcmplus", "k", "0"},         {"fppm", "r_min", "0"},
      {"fppm", "test", "nested"},    {"fppm", "epoch_min", "7"},
      {"vcmplus", "epoch_min", "0"}, {"cppm", "epoch_min", "9"},
      {"appm", "growth", "0"},       {"fppm", "lag", "65"},
      {"cppm", "alpha_chi", "1"},    {"cppm", "batch_growth", "0.9"},
      {"cppm", "first_batch", "0"},  {"appm", "pilot", "seventh"},
      {"appm", "r_max", "0.0001"},   {"appm", "recursive_correction", "2"},
      {"fppm", "alpha", "0.5"},      {"vcmplus", "layers", "weighted"},
      {"fppm", "alpha_f", "-0.1"},   {"vcmplus", "alpha_f", "nan"},
      {"cppm", "alpha_chi", "0"},    {"fppm", "k", "-0.5"},
      {"vcmplus", "k", "1.2"},       {"vcmplus", "test", "nested"},
      {"fppm", "rings", "true"},     {"fppm", "kappa", "2"},
      {"appm", "epoch_min", "-2"},   {"vcmplus", "epoch_min", "2.5"},
      {"fppm", "floor_alpha", "1"},  {"vcmplus", "floor_alpha", "0"},
  };
  for (const auto& [integrator, name, value] : bad) {
    const auto refused = complete_integrator_settings(integrator, {}, {{name, value}});
    ASSERT_FALSE(refused.ok()) << integrator << ' ' << name << '=' << value;
    EXPECT_EQ(refused.error().field, name) << refused.error().to_string();
  }
}

// Claim: the layer `merging` of vcm and vcmplus is what merging adds to the image: with all other techniques
// the image, and nothing where the plan merges nothing.
TEST(Adaptive, MergingIsALayer) {
  for (const std::string integrator : {"vcm", "vcmplus"}) {
    const auto with = make(integrator, kBox, {{"layers", "merging"}, {"radius", "0.05"}}),
               without = make(integrator, kBox, {{"radius", "0.05"}});
    EXPECT_EQ(pilot(*with).work.layers, std::vector<std::string>{"merging"});
    const Unit unit{Unit::Kind::iterations, 0, 0, 2};
    const auto layered = sums(*run(*with, constant_map(), unit).film),
               plain = sums(*run(*without, constant_map(), unit).film);
    ASSERT_EQ(layered.size(), 2 * plain.size());
    EXPECT_TRUE(std::equal(plain.begin(), plain.end(), layered.begin()));
    std::int64_t merged = 0, all = 0;
    for (std::size_t i = 0; i < plain.size(); ++i) {
      merged += layered[plain.size() + i];
      all += plain[i];
    }
    EXPECT_GT(merged, 0);
    EXPECT_LT(merged, all);
  }
}

// Claim: what a job of some settings may ask for at most is known without its scene: no scene makes more
// statistics of them, and a plain one as many.
TEST(Adaptive, LargestWorkIsThatOfSomeScene) {
  const std::string lamp =
      "<shape type=\"sphere\"><point name=\"center\" x=\"0\" y=\"0.5\" z=\"0\"/><float name=\"radius\" "
      "value=\"0.1\"/><emitter type=\"area\"/></shape>";
  const std::string mirrors = "<shape type=\"sphere\"><bsdf type=\"conductor\"/></shape>";
  const std::string fog =
      "<shape type=\"sphere\"><float name=\"radius\" value=\"0.9\"/><bsdf type=\"null\"/><medium "
      "name=\"interior\" type=\"homogeneous\"><float name=\"sigma_t\" value=\"1\"/></medium></shape>";
  const auto bytes = [](const WorkPlan& work) { return statistics_bytes(work, kSize, kSize); };
  for (const std::string& integrator : integrator_names())
    for (const char* plan : {"auto", "full"}) {
      SCOPED_TRACE(integrator + " " + plan);
      const bool radii = std::count(kAdaptive.begin(), kAdaptive.end(), integrator) != 0;
      JobSettings job;
      job.integrator = integrator;
      job.width = job.height = kSize;
      job.integrator_settings = *complete_integrator_settings(integrator, {}, {{"plan", plan}});
      const auto largest = largest_work(job);
      ASSERT_TRUE(largest.ok()) << largest.error().to_string();
      if (bytes(*largest) == 0 && std::string(plan) == "full") continue;  // one plan is enough
      std::uint64_t most = 0;
      for (const std::string& body : {std::string(), kBox, kBox + lamp, kBox + lamp + fog, mirrors + lamp,
                                      kBox + lamp + "<emitter type=\"constant\"/>"}) {
        if (!test::integrator_row(integrator).everything && body.find("medium") != body.npos)
          continue;  // refused
        SettingsMap chosen = {{"plan", plan}};
        if (test::has_chains(integrator)) chosen["bootstrap"] = "1000";  // its pilot goes by it
        const std::uint64_t needed = bytes(pilot(*make(integrator, body, chosen)).work);
        EXPECT_LE(needed, bytes(*largest)) << body;
        most = std::max(most, needed);
      }
      EXPECT_EQ(most, bytes(*largest));
      // erpt's are the counts of its mutations, those of photons alone measure their bias.
      const std::vector<std::string> others = {"optimis", "ppm", "bpm", "mcppm", "erpt"};
      EXPECT_EQ(most > 0, radii || std::count(others.begin(), others.end(), integrator) != 0);
    }
}

// Claim: what a rule says of its memo's size is the size of its memo.
TEST(Adaptive, MemosHaveTheStatedSize) {
  for (const std::string integrator : {"fppm", "cppm", "appm", "vcmplus"}) {
    JobSettings job;
    job.integrator = integrator;
    job.width = job.height = kSize;
    job.integrator_settings = *complete_integrator_settings(integrator, {}, {});
    WorkPlan work = *largest_work(job);
    ASSERT_TRUE(work.epochs) << integrator;
    const auto first = replay(*work.epochs, work.accumulators, 1, kSize, kSize,
                              [](auto...) { return static_cast<const film::MergedAccumulator*>(nullptr); });
    ASSERT_TRUE(first.ok()) << first.error().to_string();
    const std::uint64_t with_memo = statistics_bytes(work, kSize, kSize);
    work.epochs->rule = "none";
    EXPECT_EQ(with_memo - statistics_bytes(work, kSize, kSize), first->carry.memo.size()) << integrator;
  }
}

// Claim: a job that needs more memory than there is is refused with the film, the bytes, the setting and what
// to do; one that needs just as much is not.
TEST(Adaptive, TooLargeFilmsAreRefused) {
  JobSettings job;
  job.integrator = "fppm";
  job.width = 1920;
  job.height = 1080;
  job.integrator_settings = *complete_integrator_settings("fppm", {}, {});
  const WorkPlan work = *largest_work(job);
  const std::uint64_t needed = std::uint64_t{1920} * 1080 * (13 * 8 * 3 + 1) +
                               2 * film::sums_bytes(work.accumulators.back(), 1920, 1080);
  EXPECT_TRUE(check_statistics(work, job, needed).ok());
  const auto refused = check_statistics(work, job, needed - 1);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().kind, ErrorKind::input);
  for (const char* word : {"fppm", "1920 x 1080", "651 MB", "--statistics-memory", "smaller image"})
    EXPECT_NE(refused.error().to_string().find(word), std::string::npos) << refused.error().to_string();
}

// Claim: the plan says what statistics cost in memory and on the wire.
TEST(Adaptive, PlansSayWhatStatisticsCost) {
  for (const auto& [integrator, bytes] : std::map<std::string, std::string>{
           {"fppm", "104 bytes"}, {"vcmplus", "104 bytes"}, {"cppm", "96 bytes"}, {"appm", "16 bytes"}}) {
    const std::string text = make(integrator, kBox)->plan_text().value();
    EXPECT_NE(text.find(bytes), std::string::npos) << text;
    EXPECT_NE(text.find("1 byte a pixel"), std::string::npos) << text;
  }
}

}  // namespace
}  // namespace candela::render
