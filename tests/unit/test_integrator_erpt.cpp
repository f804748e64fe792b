// erpt unit by unit: what its pilot decides, what its plan says, and what it refuses.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "common/chains/mutation_sums.h"
#include "tests/unit/renderer_fixture.h"
#include "worker/integrators/erpt/pilot.h"

namespace candela::erpt_units {
namespace {

using integrators::ErptSettings;
using integrators::Plan;
using namespace integrators::erpt;  // NOLINT(google-build-using-namespace)

constexpr std::uint32_t kSize = 16;

// A lit room with a ball of glass.
const std::string kRoom =
    R"(<shape type="cube"><transform name="to_world"><scale value="2"/></transform>
      <bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="0" y="0" z="1.2"/><float name="radius" value="0.4"/>
      <bsdf type="dielectric"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.3"/><rotate x="1" angle="90"/>
      <translate y="1.9"/></transform><emitter type="area"/></shape>)";
// Its lamp shines on nothing that the camera sees.
const std::string kDark =
    R"(<shape type="rectangle"><transform name="to_world"><rotate y="1" angle="180"/><translate z="3"/></transform></shape>
    <shape type="rectangle"><transform name="to_world"><translate z="2"/></transform><emitter type="area"/></shape>
    <shape type="sphere"><point name="center" x="30" y="0" z="0"/></shape>)";

std::unique_ptr<render::Renderer> make(const std::string& body, const SettingsMap& chosen = {}) {
  const test::TextFiles files(
      {{"scene.xml", "<scene version=\"3.0.0\"><integrator type=\"path\"/><sensor type=\"perspective\"/>" +
                         body + "</scene>"}});
  JobSettings job;
  job.integrator = "erpt";
  job.width = job.height = kSize;
  job.seed = 3;
  SettingsMap settings{{"bootstrap", "500"}};
  for (const auto& [name, value] : chosen) settings[name] = value;
  return test::make_renderer(files, job, settings);
}

PilotResult pilot_of(const render::Renderer& renderer) {
  const auto pilot = renderer.pilot({});
  if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
  return *pilot;
}

std::vector<std::int64_t> sums(const render::Renderer& renderer, std::vector<Unit> units,
                               unsigned threads = 1) {
  const PilotResult pilot = pilot_of(renderer);
  std::vector<std::int64_t> all(std::size_t{kSize} * kSize * film::kChannels);
  for (const Unit& unit : units) {
    render::UnitOutput output = renderer.make_output(pilot.state);
    const auto done = renderer.run(unit, {pilot.state, {}, {}}, output, {threads});
    if (!done.ok()) throw std::runtime_error(done.error().to_string());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] += output.film->sums()[i];
  }
  return all;
}

constexpr auto kIterations = Unit::Kind::iterations;

// Claim: e_d = (1 + rho^2) b0 / 2 and M = m (1 + rho^2) / 2 [metropolis-photons note, section 4]; settings
// take the place of either. Bytes keep both.
TEST(ErptPilot, ChoosesEnergyAndLength) {
  const SeedStatistics statistics{0.25, 2.5, 1000, 500};  // 1 + rho^2 = 40
  Plan plan;
  ErptSettings settings;
  Energies energies = choose_energies(statistics, settings, plan);
  EXPECT_DOUBLE_EQ(energies.energy, 5);
  EXPECT_EQ(energies.mutations, 40u);
  EXPECT_NE(plan.to_text().find("0.05 chains a seed on average, of 40 mutations each"), std::string::npos)
      << plan.to_text();
  EXPECT_EQ(plan.to_text().find("note"), std::string::npos);
  settings.mutations_per_seed = 0.01;
  EXPECT_EQ(choose_energies(statistics, settings, plan).mutations, 1u);
  settings.chain_length = 7;
  settings.chains_per_seed = 0.5;
  energies = choose_energies(statistics, settings, plan);
  EXPECT_DOUBLE_EQ(energies.energy, 0.5);
  EXPECT_EQ(energies.mutations, 7u);
  const mcmc::CoarseGrid grid(12, 8);
  const mcmc::ImageImportance importance(grid, {0, 1, 2, 254, 128, 60});
  for (const mcmc::ImageImportance& one : {mcmc::ImageImportance(), importance}) {
    const auto read = decided_of(to_bytes({energies, one}), 12, 8);
    ASSERT_TRUE(read.ok());
    EXPECT_EQ(read->energies.energy, energies.energy);
    EXPECT_EQ(read->energies.mutations, energies.mutations);
    EXPECT_TRUE(std::ranges::equal(read->importance.levels(), one.levels()));
  }
  EXPECT_FALSE(decided_of(to_bytes({energies, importance}), 64, 64).ok()) << "of another film";
}

// Claim: seeds without light, and without variance, have an energy too; few lit seeds are told.
TEST(ErptPilot, DarkAndEvenSeeds) {
  Plan plan;
  const Energies dark = choose_energies({0, 0, 1000, 0}, {}, plan);
  EXPECT_EQ(dark.energy, std::numeric_limits<double>::min()) << "a seed that has light starts all its chains";
  EXPECT_EQ(dark.mutations, 1u);
  EXPECT_NE(plan.to_text().find("note seeds: only 0 of the pilot's 1000 seeds carry light"),
            std::string::npos)
      << plan.to_text();
  const Energies even = choose_energies({2, 4, 1000, 1000}, {}, plan);
  EXPECT_EQ(even.energy, 1);
  EXPECT_EQ(even.mutations, 1u);
}

// Claim: units, their cuts and threads leave no trace; halves and seeds of a job differ.
TEST(Erpt, UnitsAndThreadsChangeNothing) {
  const auto renderer = make(kRoom, {{"direct_samples", "2"}});
  const auto whole = sums(*renderer, {{kIterations, 0, 1, 4}});
  EXPECT_EQ(whole, sums(*renderer, {{kIterations, 0, 1, 4}}, 3));
  EXPECT_EQ(whole, sums(*renderer, {{kIterations, 0, 3, 4}, {kIterations, 0, 1, 3}}, 2));
  EXPECT_NE(whole, sums(*renderer, {{kIterations, 1, 1, 4}}));
  EXPECT_NE(whole, sums(*renderer, {{kIterations, 0, 4, 7}}));
}

// Counts of mutations of one unit, by mutation.
std::vector<chains::MutationCounts> counts_of_unit(const render::Renderer& renderer, const Unit& unit,
                                                   unsigned threads) {
  const PilotResult pilot = pilot_of(renderer);
  render::UnitOutput output = renderer.make_output(pilot.state);
  const auto done = renderer.run(unit, {pilot.state, {}, {}}, output, {threads});
  if (!done.ok()) throw std::runtime_error(done.error().to_string());
  std::vector<chains::MutationCounts> out;
  for (const auto& of_unit : output.accumulators) {
    film::MergedAccumulator merged(kSize, kSize, of_unit->spec());
    merged.set_pixel(0, 0,
                     std::vector<film::Int128>(of_unit->sums(), of_unit->sums() + of_unit->spec().channels));
    out.push_back(*chains::counts_of(merged));
  }
  return out;
}

// Claim: proposals, accepted ones, failures and rays of each mutation are counted, whatever the threads; a
// path that no mutation suits stays as it is.
TEST(Erpt, CountsMutations) {
  const auto renderer = make(kRoom, {{"chain_length", "10"}, {"bidirectional", "1"}});
  const auto counts = counts_of_unit(*renderer, {kIterations, 0, 0, 2}, 1);
  EXPECT_EQ(counts, counts_of_unit(*renderer, {kIterations, 0, 0, 2}, 3));
  ASSERT_EQ(counts.size(), 4u);
  EXPECT_EQ(counts[0].name, "bidirectional");
  EXPECT_EQ(counts[1].name, "lens");
  std::uint64_t proposed = 0;
  for (const chains::MutationCounts& one : counts) {
    std::uint64_t failed = 0;
    for (const std::uint64_t count : one.failed) failed += count;
    EXPECT_LE(one.accepted + failed, one.proposed) << one.name;
    EXPECT_GE(one.rays, one.accepted) << one.name;
    proposed += one.proposed;
  }
  EXPECT_GT(counts[0].accepted, 0u);
  EXPECT_GT(counts[1].accepted, 0u);
  EXPECT_EQ(proposed % 10, 0u) << "bidirectional suits all paths";
  const auto direct = make(kRoom, {{"max_depth", "2"}});
  EXPECT_TRUE(counts_of_unit(*direct, {kIterations, 0, 0, 1}, 1).empty());
}

// Claim: the plan has the mutations with their shares, the energies, and what is left to path tracing.
TEST(Erpt, PlanSaysWhatRuns) {
  const std::string plan = pilot_of(*make(kRoom, {{"manifold", "0.5"}, {"caustic", "0"}})).plan;
  for (const char* line : {"use  path tracing beside the chains", "use  lens: share 1", "use  multichain",
                           "use  manifold: share 0.5", "use  energy redistribution", "from 3 to 1000 edges"})
    EXPECT_NE(plan.find(line), std::string::npos) << plan;
  for (const char* line : {"caustic", "bidirectional:", "half_vector"})
    EXPECT_EQ(plan.find(line), std::string::npos) << plan;
  const std::string mept = pilot_of(*make(kRoom, {{"preset", "mept"}})).plan;
  EXPECT_NE(mept.find("use  manifold: share 1"), std::string::npos) << mept;
  EXPECT_EQ(mept.find("use  lens"), std::string::npos) << mept;
}

// Claim: a scene without light is black, and one whose paths are all short needs no pilot.
TEST(Erpt, NothingToSpread) {
  for (const std::int64_t sum : sums(*make(kDark), {{kIterations, 0, 0, 2}})) ASSERT_EQ(sum, 0);
  const auto renderer = make(kRoom, {{"max_depth", "2"}});
  EXPECT_EQ(pilot_of(*renderer).state.decided, "");
  EXPECT_NE(pilot_of(*renderer).plan.find("skip chains: max_depth leaves nothing to them"),
            std::string::npos);
  const auto film = sums(*renderer, {{kIterations, 0, 0, 1}});
  EXPECT_NE(film, std::vector<std::int64_t>(film.size()));
}

// Claim: settings out of their ranges, media and irradiance meters are one error that names the field.
TEST(Erpt, OthersAreRefused) {
  for (const auto& [name, value] : {std::pair{"seeds", "0"},
                                    {"seeds", "65"},
                                    {"max_chains", "0"},
                                    {"chain_length", "-1"},
                                    {"mutations_per_seed", "0"},
                                    {"chains_per_seed", "-1"},
                                    {"manifold", "2"},
                                    {"direct", "none"},
                                    {"regularise", "some"}}) {
    const auto refused =
        render::complete_integrator_settings("erpt", {}, {{std::string(name), std::string(value)}});
    ASSERT_FALSE(refused.ok()) << name << '=' << value;
    EXPECT_EQ(refused.error().field, name);
  }
  const auto none = render::complete_integrator_settings(
      "erpt", {}, {{"lens", "0"}, {"caustic", "0"}, {"multichain", "0"}});
  ASSERT_FALSE(none.ok());
  EXPECT_NE(none.error().to_string().find("no mutation has a share"), std::string::npos);
  const auto both = render::complete_integrator_settings("erpt", {}, {{"preset", "mept"}, {"lens", "0.5"}});
  ASSERT_FALSE(both.ok());
  EXPECT_EQ(both.error().field, "lens");
  const std::string text = R"(<scene version="3.0.0"><integrator type="path"/><emitter type="constant"/>
    <shape type="sphere"><sensor type="irradiancemeter"/></shape></scene>)";
  const test::TextFiles meter({{"scene.xml", text}});
  JobSettings job;
  job.integrator = "erpt";
  job.width = job.height = kSize;
  const auto pilot = test::make_renderer(meter, job, {})->pilot({});
  ASSERT_FALSE(pilot.ok());
  EXPECT_NE(pilot.error().to_string().find("erpt has no paths to an irradiance meter"), std::string::npos);
}

}  // namespace
}  // namespace candela::erpt_units
