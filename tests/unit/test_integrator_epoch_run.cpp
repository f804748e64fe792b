// Jobs with epochs inside a test process (tests/epoch_run.h), with a renderer whose photons are made up.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <map>

#include "common/rng/stream.h"
#include "tests/adaptive_toy.h"
#include "tests/epoch_run.h"
#include "tests/replay.h"

namespace candela::test {
namespace {

constexpr std::uint32_t kWidth = 37, kHeight = 5;

// A sample adds a level's number to the film, and photons to sectors that are the more uneven, the farther
// right the pixel is.
class MadeUpPhotons final : public render::Renderer {
 public:
  MadeUpPhotons()
      : plan_(fppm_plan(toy_epochs("fppm", 4, 16, 1), 0.01, 0.7)),
        epochs_(plan_.epochs.first, plan_.epochs.growth) {}

  Result<PilotResult> pilot(const render::RunContext&) const override {
    return PilotResult{{kToyFilmScale}, "", 1, {.accumulators = plan_.accumulators, .epochs = plan_.epochs}};
  }
  render::UnitOutput make_output(const NamedState& state) const override {
    render::UnitOutput output;
    output.film = std::make_unique<film::UnitFilm>(film::Layout{kWidth, kHeight, 1}, state.film_scale_log2);
    for (const film::AccumulatorSpec& spec : plan_.accumulators)
      output.accumulators.push_back(std::make_unique<film::UnitAccumulator>(kWidth, kHeight, spec));
    return output;
  }
  Result<void> run(const Unit& unit, const render::UnitInput& input, render::UnitOutput& output,
                   const render::RunContext&) const override {
    const auto state = input.states.find("fppm");
    if (state == input.states.end() || state->second.size() != kWidth * kHeight)
      return input_error("no state");
    if (epochs_.of_index(unit.begin) != epochs_.of_index(unit.end - 1))
      return input_error("a unit of two epochs");
    film::SampleCounts sample_counts;
    for (std::uint64_t i = unit.begin; i < unit.end; ++i)
      for (std::uint32_t p = 0; p < kWidth * kHeight; ++p) {
        const std::uint32_t x = p % kWidth, y = p / kWidth;
        const std::uint64_t key = rng::key(std::uint64_t{3}, unit.half, i, x, y);
        const auto level = static_cast<float>(state->second[p]);
        output.film->add(0, x, y, {1 + level, level, 1}, key, sample_counts);
        Draws draws(key);
        std::array<double, adaptive::kSectorChannels> sums{};
        double squares = 0;
        for (std::uint64_t n = draws.poisson(30); n > 0; --n) {
          const bool inner = draws.uniform() * kWidth < x;
          const double phi = draws.lognormal(1);
          sums[draws.below(inner ? 6 : 12)] += phi;
          squares += phi * phi;
        }
        output.accumulators[0]->add(x, y, 0, sums, key, sample_counts);
        output.accumulators[1]->add(x, y, 0, {&squares, 1}, key, sample_counts);
        ++sample_counts.eye_samples;
      }
    output.film->count(sample_counts);
    return {};
  }
  Result<std::string> plan_text() const override { return std::string(""); }
  const ToyPlan& plan() const { return plan_; }

 private:
  ToyPlan plan_;
  Epochs epochs_;
};

// All that a job has in the end.
struct Whole {
  std::vector<std::int64_t> film;
  std::string run;
  std::deque<std::string> states;
};
Whole render(const MadeUpPhotons& renderer, const std::vector<Unit>& units) {
  const PilotResult pilot = *renderer.pilot({});
  EpochRun run(renderer, pilot);
  Whole whole;
  whole.film.assign(kWidth * kHeight * 3, 0);
  for (const Unit& unit : run.cut(units)) {
    auto output = renderer.make_output(pilot.state);
    const auto done = run.run(unit, output, {});
    EXPECT_TRUE(done.ok()) << done.error().to_string();
    for (std::size_t i = 0; i < whole.film.size(); ++i) whole.film[i] += output.film->sums()[i];
  }
  whole.run = run.save();
  whole.states = run.states();
  return whole;
}
Unit unit(std::uint32_t half, std::uint64_t begin, std::uint64_t end) {
  return {Unit::Kind::iterations, half, begin, end};
}

// Claim: the way iterations are cut into units, and their order within an epoch, leave no trace in film,
// states and statistics; and pixels shrink, so that this is no comparison of zeros.
TEST(EpochRunTest, DependsOnTheJobAlone) {
  const MadeUpPhotons renderer;
  const Whole whole = render(renderer, {unit(0, 0, 21), unit(1, 0, 20)});
  const Whole parts =
      render(renderer, {unit(1, 7, 20), unit(0, 3, 4), unit(1, 0, 7), unit(0, 4, 21), unit(0, 0, 3)});
  EXPECT_EQ(whole.film, parts.film);
  EXPECT_EQ(whole.states, parts.states);
  EXPECT_EQ(whole.run, parts.run);
  ASSERT_EQ(whole.states.size(), 11U);  // epochs of 4 iterations
  EXPECT_EQ(whole.states[1], std::string(kWidth * kHeight, '\0'));
  EXPECT_GT(*std::max_element(whole.states[10].begin(), whole.states[10].end()), 2);
  // Flat pixels on the left, uneven ones on the right.
  EXPECT_EQ(whole.states[10][0], 0);
  EXPECT_GT(whole.states[10][kWidth - 1], 0);
}

// Claim: states are those that replay() finds from the sums of whole epochs, which were added up here by
// themselves.
TEST(EpochRunTest, DecidesAsReplayDoes) {
  const MadeUpPhotons renderer;
  const PilotResult pilot = *renderer.pilot({});
  const Whole whole = render(renderer, {unit(0, 0, 20), unit(1, 0, 20)});
  std::map<std::uint64_t, std::vector<film::MergedAccumulator>> sums;
  for (std::uint64_t epoch = 0; epoch < 10; ++epoch) {
    auto& of_epoch = sums[epoch] = empty_carry(pilot.work.accumulators, kWidth, kHeight).sums;
    for (std::uint32_t half = 0; half < 2; ++half) {
      auto output = renderer.make_output(pilot.state);
      render::UnitInput input;
      input.states.emplace("fppm", whole.states[epoch]);
      ASSERT_TRUE(renderer.run(unit(half, 2 * epoch, 2 * epoch + 2), input, output, {}).ok());
      for (std::size_t a = 0; a < of_epoch.size(); ++a) {
        std::string bytes;
        output.accumulators[a]->put_sums(bytes);
        film::Reader reader(bytes);
        of_epoch[a].merge(*film::SparseSums::read(reader, {kWidth, kHeight, 1}, of_epoch[a].spec().channels));
      }
    }
  }
  const auto again =
      replay(*pilot.work.epochs, pilot.work.accumulators, 10, kWidth, kHeight,
             [&](std::string_view name, std::uint64_t epoch) -> const film::MergedAccumulator* {
               for (const auto& of_epoch : sums.at(epoch))
                 if (of_epoch.spec().name == name) return &of_epoch;
               return nullptr;
             });
  ASSERT_TRUE(again.ok()) << again.error().to_string();
  EXPECT_TRUE(
      std::equal(again->states.begin(), again->states.end(), whole.states.begin(), whole.states.end()));
}

// Claim: render_job() is units of both halves, and its mean is over all iterations.
TEST(EpochRunTest, RendersAJob) {
  const MadeUpPhotons renderer;
  const auto job = render_job(renderer, *renderer.pilot({}), 41, {});
  ASSERT_TRUE(job.ok()) << job.error().to_string();
  const Whole whole = render(renderer, {unit(0, 0, 21), unit(1, 0, 20)});
  EXPECT_EQ(job->states, whole.states);
  EXPECT_EQ(job->halves[0].iterations, 21U);
  EXPECT_EQ(job->halves[1].iterations, 20U);
  EXPECT_EQ(job->sample_counts().eye_samples, std::uint64_t{41} * kWidth * kHeight);
  EXPECT_NEAR(job->mean(0)[2], 1, 1e-5);
}

// Claim: a run that is saved in the middle of an epoch and restored goes on to the same end.
TEST(EpochRunTest, GoesOnAfterARestore) {
  const MadeUpPhotons renderer;
  const PilotResult pilot = *renderer.pilot({});
  EpochRun first(renderer, pilot);
  const auto advance = [&](EpochRun& run, std::uint64_t from, std::uint64_t to) {
    for (const Unit& u : run.units(from, to)) {
      auto output = renderer.make_output(pilot.state);
      ASSERT_TRUE(run.run(u, output, {}).ok());
    }
  };
  advance(first, 0, 17);
  const std::string saved = first.save();
  EpochRun second(renderer, pilot);
  ASSERT_TRUE(second.restore(saved).ok());
  EXPECT_EQ(second.save(), saved);
  advance(first, 17, 41);
  advance(second, 17, 41);
  EXPECT_EQ(first.save(), second.save());
  EXPECT_EQ(first.states(), second.states());
  EXPECT_FALSE(second.restore(saved.substr(0, saved.size() - 3)).ok());
  EXPECT_FALSE(second.restore(saved + "x").ok());
  const auto report = first.describe(true);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->layers.size(), 3U);
}

// Claim: a state is not decided from an epoch of which a unit is missing, and no unit counts twice.
TEST(EpochRunTest, RefusesHolesAndRepeats) {
  const MadeUpPhotons renderer;
  const PilotResult pilot = *renderer.pilot({});
  EpochRun run(renderer, pilot);
  auto output = renderer.make_output(pilot.state);
  ASSERT_TRUE(run.run(unit(0, 0, 2), output, {}).ok());
  EXPECT_FALSE(run.add(unit(0, 1, 2), output).ok());
  EXPECT_TRUE(run.input(unit(0, 2, 4)).ok());   // epoch 1 depends on nothing yet
  EXPECT_FALSE(run.input(unit(0, 4, 6)).ok());  // epoch 2 depends on epoch 0, whose other half is missing
  output.clear();
  ASSERT_TRUE(run.run(unit(1, 0, 2), output, {}).ok());
  EXPECT_TRUE(run.input(unit(0, 4, 6)).ok());
}

}  // namespace
}  // namespace candela::test
