// mcppm unit by unit: when it is ppm, what its plan says, what epochs count, and what it refuses.
#include <gtest/gtest.h>

#include <cmath>

#include "common/stages/photon_chains.h"
#include "tests/long_form.h"
#include "tests/statistical/moments.h"
#include "tests/unit/renderer_fixture.h"
#include "worker/integrators/mcppm/pilot.h"

namespace candela {
namespace {

constexpr std::uint32_t kSize = 16;

// A lit room. The camera is in it, and sees half of it: most light paths leave photons where eye paths
// gather.
const std::string kRoom =
    R"(<shape type="cube"><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.3"/><rotate x="1" angle="90"/><translate y="0.99"/></transform>
      <emitter type="area"/></shape>)";
// A floor below a sky, of which the camera sees one part in some thousands.
std::string patch(double floor) {
  return fmt::format(
      R"(<shape type="rectangle"><transform name="to_world"><scale value="{}"/><rotate y="1" angle="180"/><translate z="2"/></transform></shape>
      <emitter type="constant"/>)",
      floor);
}
// Its lamp shines the other way.
const std::string kDark =
    R"(<shape type="rectangle"><transform name="to_world"><rotate y="1" angle="180"/><translate z="3"/></transform></shape>
    <shape type="rectangle"><transform name="to_world"><translate z="2"/></transform><emitter type="area"/></shape>
    <shape type="sphere"><point name="center" x="30" y="0" z="0"/></shape>)";

std::unique_ptr<render::Renderer> make(const std::string& integrator, const std::string& body,
                                       const SettingsMap& chosen = {}) {
  const test::TextFiles files(
      {{"scene.xml", "<scene version=\"3.0.0\"><integrator type=\"path\"/><sensor type=\"perspective\"/>" +
                         body + "</scene>"}});
  JobSettings job;
  job.integrator = integrator;
  job.width = job.height = kSize;
  job.seed = 3;
  return test::make_renderer(files, job, chosen);
}

PilotResult pilot_of(const render::Renderer& renderer) {
  const auto pilot = renderer.pilot({});
  if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
  return *pilot;
}

render::UnitOutput run(const render::Renderer& renderer, const Unit& unit, double step = 1.0 / 64,
                       unsigned threads = 1) {
  const PilotResult pilot = pilot_of(renderer);
  render::UnitOutput output = renderer.make_output(pilot.state);
  render::UnitInput input{pilot.state, {}, {}};
  const std::string state = photon_chains::state_of(step);
  if (pilot.work.epochs) input.states[pilot.work.epochs->rule] = state;
  const auto done = renderer.run(unit, input, output, {threads});
  if (!done.ok()) throw std::runtime_error(done.error().to_string());
  return output;
}

std::vector<std::int64_t> sums(const render::UnitOutput& output) {
  return {output.film->sums(), output.film->sums() + std::size_t{kSize} * kSize * film::kChannels};
}

photon_chains::Counts counts_of(const render::UnitOutput& output) {
  const film::UnitAccumulator& unit = *output.accumulators.at(0);
  film::MergedAccumulator merged(kSize, kSize, unit.spec());
  for (std::uint32_t i = 0; i < kSize; ++i) {
    const film::Int128 value = unit.sums()[i];
    merged.set_pixel(i, 0, std::span(&value, 1));
  }
  return photon_chains::read(merged);
}

const Unit kUnit{Unit::Kind::iterations, 1, 1, 4};  // of the first epoch

// Claim: where more than a fifth of the light paths is visible, and where the settings want no mutations,
// mcppm is ppm bit for bit, sums no more beside the film, and says why.
TEST(Mcppm, IsPpmWhereChainsDoNotPay) {
  const SettingsMap radius = {{"radius", "0.3"}};
  const auto mcppm = make("mcppm", kRoom, radius), ppm = make("ppm", kRoom, radius);
  EXPECT_TRUE(pilot_of(*mcppm).work.epochs);
  EXPECT_EQ(pilot_of(*mcppm).work.accumulators, pilot_of(*ppm).work.accumulators);
  EXPECT_EQ(sums(run(*mcppm, kUnit)), sums(run(*ppm, kUnit)));
  const std::string plan = pilot_of(*mcppm).plan;
  EXPECT_NE(plan.find("skip chains of visible photons"), std::string::npos) << plan;
  EXPECT_NE(plan.find("above 20 % chains do not pay"), std::string::npos) << plan;

  const auto none = make("mcppm", patch(8), {{"radius", "0.01"}, {"mutations_per_path", "0"}});
  EXPECT_FALSE(pilot_of(*none).work.epochs);
  EXPECT_NE(pilot_of(*none).plan.find("mutations_per_path=0"), std::string::npos);
  EXPECT_EQ(sums(run(*none, kUnit)), sums(run(*make("ppm", patch(8), {{"radius", "0.01"}}), kUnit)));

  const auto full = make("mcppm", kRoom, {{"radius", "0.3"}, {"plan", "full"}});
  EXPECT_NE(sums(run(*full, kUnit)), sums(run(*ppm, kUnit)));
  EXPECT_NE(pilot_of(*full).plan.find("use  chains of visible photons"), std::string::npos)
      << pilot_of(*full).plan;
}

// Claim: few visible paths are spread over chains, and the plan warns if they are fewer than ten; epochs
// count whole iterations.
TEST(Mcppm, SpreadsFewVisiblePaths) {
  const auto renderer = make("mcppm", patch(8), {{"radius", "0.01"}, {"light_paths", "20"}});
  const PilotResult pilot = pilot_of(*renderer);
  EXPECT_NE(pilot.plan.find("use  chains of visible photons"), std::string::npos) << pilot.plan;
  EXPECT_NE(pilot.plan.find("an iteration has 5120 light paths and 5120 mutations"), std::string::npos)
      << pilot.plan;
  const auto output = run(*renderer, kUnit);
  const photon_chains::Counts counts = counts_of(output);
  EXPECT_EQ(counts.iterations, 3U);
  EXPECT_EQ(counts.light_paths, 3 * 5120U);
  EXPECT_GT(counts.visible_paths, 0U);
  EXPECT_LT(counts.visible_paths, counts.light_paths / 20);
  EXPECT_EQ(counts.mutations, 5120 * (3 - counts.black_iterations));
  EXPECT_GT(counts.accepted, 0U);
  EXPECT_LT(counts.accepted, counts.mutations);
  EXPECT_EQ(output.film->sample_counts().light_paths, counts.light_paths + counts.mutations);
  // The step matters to chains alone.
  EXPECT_LT(counts_of(run(*renderer, kUnit, 0.3)).accepted, counts.accepted);
  EXPECT_EQ(counts_of(run(*renderer, kUnit, 0.3)).visible_paths, counts.visible_paths);
  const std::string few =
      pilot_of(*make("mcppm", patch(300), {{"radius", "0.0001"}, {"light_paths", "0.5"}})).plan;
  EXPECT_NE(few.find("note visible light paths"), std::string::npos) << few;
}

// Claim: threads and cuts leave no trace in film, counts and sample counts, where chains are few and long.
TEST(Mcppm, ThreadsAndCutsChangeNothing) {
  const auto renderer =
      make("mcppm", patch(8), {{"radius", "0.01"}, {"light_paths", "20"}, {"mutations_per_path", "3"}});
  const auto one = run(*renderer, kUnit), other = run(*renderer, kUnit, 1.0 / 64, 5);
  EXPECT_EQ(sums(one), sums(other));
  EXPECT_EQ(counts_of(one), counts_of(other));
  EXPECT_EQ(one.film->sample_counts(), other.film->sample_counts());
}

// Claim: iterations without a visible path are black, and count.
TEST(Mcppm, BlackIterationsCount) {
  const auto renderer = make("mcppm", kDark, {{"radius", "0.01"}});
  const auto output = run(*renderer, kUnit);
  const photon_chains::Counts counts = counts_of(output);
  EXPECT_EQ(counts, (photon_chains::Counts{3, 3, 3 * kSize * kSize, 0, 0, 0, 0}));
  EXPECT_EQ(pilot_of(*renderer).plan.find("none of a pilot's") == std::string::npos, false);
  for (const std::int64_t sum : sums(output)) ASSERT_EQ(sum, 0);
}

// Claim: the pilot's split of an iteration keeps its sum, has the least variance of the formula, and leaves
// ten visible light paths, if the sum has room for them.
TEST(Mcppm, SplitHasTheLeastVariance) {
  using integrators::mcppm::IterationSize;
  const auto variance = [](double b, double paths, double all, double pixels) {
    return (1 - b) / (b * paths) + 10 * (pixels - 1) / (all - paths);
  };
  for (const double pixels : {4.0, 64.0, 4096.0})
    for (const std::uint64_t visible : {5ULL, 40ULL, 800ULL}) {
      const IterationSize before{100000, 300000};
      const IterationSize split = integrators::mcppm::split_by({visible, 10000}, before, pixels);
      const double b = static_cast<double>(visible) / 10000, paths = static_cast<double>(split.light_paths);
      EXPECT_EQ(split.light_paths + split.mutations, before.light_paths + before.mutations);
      EXPECT_GE(paths * b, 9.99);
      if (paths * b < 10.1) continue;
      for (const double other : {0.8, 1.25}) {
        if (other * paths >= 400000) continue;
        EXPECT_GT(variance(b, other * paths, 400000, pixels), variance(b, paths, 400000, pixels))
            << pixels << " " << visible;
      }
    }
  const IterationSize few = integrators::mcppm::split_by({0, 4096}, {50, 50}, 64);
  EXPECT_EQ(few.light_paths, 100U);
  EXPECT_EQ(few.mutations, 0U);
}

// Claim: split=pilot renders what the plan tells, with the same sum of light paths and mutations, on any
// number of threads.
TEST(Mcppm, PilotSplitsAnIteration) {
  const auto renderer =
      make("mcppm", patch(3), {{"radius", "0.02"}, {"light_paths", "20"}, {"split", "pilot"}});
  const auto one = run(*renderer, kUnit), other = run(*renderer, kUnit, 1.0 / 64, 5);
  EXPECT_EQ(sums(one), sums(other));
  const photon_chains::Counts counts = counts_of(one);
  EXPECT_EQ(counts.light_paths / 3 + counts.mutations / 3, 2 * 5120U);
  EXPECT_LT(counts.light_paths, 3 * 5120U);
  const std::string plan = pilot_of(*renderer).plan;
  EXPECT_NE(plan.find(fmt::format("an iteration has {} light paths and {} mutations", counts.light_paths / 3,
                                  counts.mutations / 3)),
            std::string::npos)
      << plan;
}

// Claim: an iteration of one light path is black, or has all mutations in one chain.
TEST(Mcppm, OneVisiblePathHasAllMutations) {
  const auto renderer = make(
      "mcppm", patch(8),
      {{"radius", "0.1"}, {"light_paths", "0.001"}, {"mutations_per_path", "40"}, {"epoch_min", "1024"}});
  const photon_chains::Counts counts = counts_of(run(*renderer, {Unit::Kind::iterations, 0, 0, 256}));
  EXPECT_EQ(counts.iterations, 256U);
  EXPECT_EQ(counts.light_paths, 256U);
  EXPECT_GT(counts.visible_paths, 0U);
  EXPECT_LT(counts.visible_paths, 256U);
  EXPECT_EQ(counts.visible_squares, counts.visible_paths);
  EXPECT_EQ(counts.mutations, 40 * counts.visible_paths);
  EXPECT_EQ(counts.black_iterations, 256 - counts.visible_paths);
}

// Claim: halves tell the error: the mean of (A - B)^2 / 4 over many jobs is the variance of the jobs' images,
// of single pixels and of the sum of all, whose flicker is common to the pixels of an iteration.
// [metropolis-photons note, section 7]
TEST(Mcppm, HalvesTellTheSpreadOfJobs) {
  const bool is_long = test::long_form();
  const std::uint64_t jobs = is_long ? 1000 : 250, iterations = 2;
  const auto renderer = make(
      "mcppm", patch(3),
      {{"radius", "0.02"}, {"alpha", "1"}, {"light_paths", "1"}, {"plan", "full"}, {"epoch_min", "4096"}});
  std::vector<statistical::Moments> image(std::size_t{kSize} * kSize + 1), estimate(image.size());
  for (std::uint64_t job = 0; job < jobs; ++job) {
    std::vector<std::int64_t> half[2];
    for (std::uint32_t h = 0; h < 2; ++h)
      half[h] = sums(run(*renderer, {Unit::Kind::iterations, h, job * iterations, (job + 1) * iterations}));
    double all[2] = {};
    const auto add = [&](std::size_t at, double a, double b) {
      image[at].add((a + b) / 2);
      estimate[at].add((a - b) * (a - b) / 4);
    };
    for (std::size_t p = 0; p + 1 < image.size(); ++p) {
      const double a = std::ldexp(static_cast<double>(half[0][p * film::kChannels]), -20),
                   b = std::ldexp(static_cast<double>(half[1][p * film::kChannels]), -20);
      add(p, a, b);
      all[0] += a;
      all[1] += b;
    }
    add(image.size() - 1, all[0], all[1]);
  }
  double spread = 0, told = 0;
  for (std::size_t p = 0; p + 1 < image.size(); ++p) {
    spread += image[p].variance();
    told += estimate[p].mean();
  }
  ASSERT_GT(spread, 0);
  EXPECT_NEAR(told / spread, 1, is_long ? 0.1 : 0.2);
  EXPECT_NEAR(estimate.back().mean() / image.back().variance(), 1, is_long ? 0.25 : 0.5);
}

// Claim: a unit without the state of its epoch, or with other bytes, fails and names the field; so do bad
// settings.
TEST(Mcppm, OthersAreRefused) {
  const auto renderer = make("mcppm", patch(8), {{"radius", "0.01"}});
  const PilotResult pilot = pilot_of(*renderer);
  render::UnitOutput output = renderer->make_output(pilot.state);
  for (const std::string& bytes : {std::string(), std::string("none"), std::string(8, '\0')}) {
    render::UnitInput input{pilot.state, {}, {}};
    if (bytes != "none") input.states[pilot.work.epochs->rule] = bytes;
    const auto done = renderer->run(kUnit, input, output, {});
    ASSERT_FALSE(done.ok());
    EXPECT_EQ(done.error().field, "states");
  }
  render::UnitInput undecided{pilot.state, {}, {}};
  undecided.state.decided.clear();
  const auto done = renderer->run(kUnit, undecided, output, {});
  ASSERT_FALSE(done.ok());
  EXPECT_EQ(done.error().field, "named_state.decided");
  for (const auto& [name, value] : {std::pair{"mutations_per_path", "-1"},
                                    {"mutations_per_path", "2000"},
                                    {"split", "half"},
                                    {"step", "0"},
                                    {"step", "0.6"},
                                    {"epoch_min", "3"},
                                    {"photons", "some"}}) {
    const auto files =
        render::complete_integrator_settings("mcppm", {}, {{std::string(name), std::string(value)}});
    if (std::string(name) == "epoch_min") {
      EXPECT_THROW(make("mcppm", kRoom, {{"epoch_min", "3"}}), std::runtime_error);
      continue;
    }
    ASSERT_FALSE(files.ok()) << name << '=' << value;
    EXPECT_EQ(files.error().field, name);
  }
}

}  // namespace
}  // namespace candela
