// Chains and epochs in one job, on farms of real processes: whatever dies, and when, the film, the records of
// all chains and every learnt state come out as the same bytes, which a loop in this process makes without a
// farm.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <thread>

#include "tests/farm/farm.h"
#include "tests/farm/local_job.h"
#include "tests/farm/toy/chain_toy.h"
#include "tests/unit/farm_calls.h"
#include "tests/unit/toy_chains.h"

namespace candela::farm {
namespace {

// A shape, a light and a camera, which the toy ignores.
const std::string kToyScene =
    "<scene version='3.0.0'><sensor type='perspective'/><shape type='sphere'><emitter "
    "type='area'/></shape></scene>";

JobSettings settings_of(int pause_microseconds = 0) {
  toy::Toy toy;
  toy.plan = {20, 500, 100};
  toy.direct = true;
  JobSettings settings;
  settings.integrator = toy::kChainsName;
  settings.integrator_settings = toy.settings();
  settings.integrator_settings["pause"] = std::to_string(pause_microseconds);
  settings.width = 40;
  settings.height = 33;
  settings.seed = 11;
  return settings;
}

// The job without a farm: each half of each epoch from its first chain to its last.
LocalJob truth_of(std::uint64_t rounds) {
  const JobSettings settings = settings_of();
  const toy::ToyRenderer renderer(settings);
  const ChainPlan plan = toy::Toy::from(settings.integrator_settings).plan;
  const WorkPlan work = toy::chain_work_plan(plan);
  std::vector<std::uint64_t> samples;
  toy::Expected chains = toy::expect_bootstrap(settings, samples);
  const film::Layout layout{settings.width, settings.height, 3};
  LocalJob job =
      local_job(work, layout, chains.state.film_scale_log2, rounds * plan.chains,
                [&](const Unit& unit, std::string_view step) {
                  integrators::UnitOutput output = renderer.make_output(chains.state);
                  output.accumulators.push_back(std::make_unique<film::UnitAccumulator>(
                      layout.width, layout.height, work.accumulators[0]));
                  for (std::uint64_t i = unit.begin; i < unit.end; ++i) {
                    const std::uint64_t chain = chains::chain_of(unit.half, i, plan.chains);
                    const std::vector<chains::ChainStart> start{{samples[chain], chains.records[chain]}};
                    integrators::UnitInput input{chains.state, {{toy::kStepRule, step}}, start};
                    EXPECT_TRUE(renderer.run({unit.kind, unit.half, i, i + 1}, input, output, {}).ok());
                    chains.records[chain] = output.records.back();
                  }
                  return output;
                });
  job.records = std::move(chains.records);
  return job;
}

class ChainToyFarm : public testing::Test {
 protected:
  ChainToyFarm() { farm.set_programs("toy-master", "toy-worker"); }
  void start(int workers, std::vector<std::string> more = {}) {
    std::vector<std::string> options = {"--unit-time", "0.02",         "--checkpoint-interval",
                                        "0.05",        "--lease-time", "1.5"};
    options.insert(options.end(), more.begin(), more.end());
    farm.start_master(options);
    for (int i = 0; i < workers; ++i) processes.push_back(&farm.start_worker(fmt::format("w{}", i)));
  }
  std::string submit(std::uint64_t rounds, int pause_microseconds = 300) {
    return test::submit(farm.stub(), kToyScene,
                        test::submission(kToyScene, settings_of(pause_microseconds), rounds));
  }
  void check(const std::string& id, std::uint64_t rounds) {
    const v1::JobStatus status = farm.wait_for(id, v1::JOB_STATE_DONE);
    ASSERT_EQ(status.iterations(), rounds);
    expect_checkpoint(farm.folder().path() / "data" / "jobs" / id /
                          fmt::format("film.{}.ckpt", status.checkpoint_generation()),
                      truth_of(rounds));
    farm.audit(id, rounds);
  }

  Farm farm;
  std::vector<Process*> processes;
  const std::uint64_t whole = std::getenv("CANDELA_TOY_LONG") != nullptr ? 240 : 20;
};

// Claim: the chains learn: small steps of the first epoch are accepted less often than is wished for, those
// of the last as often, and the states in between differ.
TEST(ChainToy, StepsAreLearnt) {
  const LocalJob job = truth_of(120);
  const double first = toy::acceptance(*job.accumulators.begin()->second),
               last = toy::acceptance(*std::prev(job.accumulators.end())->second);
  EXPECT_LT(first, toy::kTargetAcceptance - 0.05);
  EXPECT_NEAR(last, toy::kTargetAcceptance, 0.02);
  EXPECT_NE(job.states.front(), job.states.back());
}

// Claim: film, records and states do not depend on the number of workers, or on audits of every unit.
TEST_F(ChainToyFarm, OneWorker) {
  start(1);
  check(submit(whole), whole);
}
TEST_F(ChainToyFarm, AuditedWorkers) {
  start(3, {"--audit", "100%"});
  check(submit(whole), whole);
  for (const v1::Event& event : farm.events("")) EXPECT_NE(event.kind(), "distrusted") << event.message();
}

// Claim: SIGKILL of the master and of workers, at times all over the job, changes no byte; nor does an
// extension amid an epoch.
TEST_F(ChainToyFarm, KillsAndExtensionsChangeNothing) {
  start(3);
  const std::uint64_t first = whole * 2 / 3;
  const std::string id = submit(first, 4000);
  const int kills = std::getenv("CANDELA_TOY_LONG") != nullptr ? 40 : 6;
  for (int k = 0; k < kills; ++k) {
    farm.wait_for_iterations(id, first * static_cast<std::uint64_t>(k) / static_cast<std::uint64_t>(kills));
    std::this_thread::sleep_for(std::chrono::milliseconds(7 * k));
    if (k % 2 == 0) {
      farm.kill_master();
      farm.restart_master();
    } else {
      const auto w = static_cast<std::size_t>(k) % processes.size();
      farm.forget_worker(*processes[w]);
      processes[w] = &farm.start_worker(fmt::format("again{}", k));
    }
  }
  check(id, first);
  farm.extend(id, whole - first);
  check(id, whole);
}

// Claim: a master that lost its newest checkpoint, while its store tells of later states, renders what is
// lost with the same states.
TEST_F(ChainToyFarm, ALostCheckpointChangesNoState) {
  start(2);
  const std::string id = submit(whole, 4000);
  farm.wait_for_iterations(id, whole / 2);
  farm.kill_master();
  for (const auto& e : std::filesystem::directory_iterator(farm.folder().path() / "data" / "jobs" / id))
    if (e.path().extension() == ".ckpt") std::filesystem::remove(e.path());
  farm.restart_master();
  check(id, whole);
}

}  // namespace
}  // namespace candela::farm
