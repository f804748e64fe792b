// One image, however the farm stands: number of workers and threads, sizes and order of units, deaths of
// workers and of the master. The reference of every case is `candela render` in a process of its own, so each
// case also proves that the embedded farm and a real one make the same pixels.
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <ostream>

#include "tests/farm/farm.h"
#include "tests/farm/hand_worker.h"
#include "tests/integrators.h"
#include "worker/render/renderer.h"

namespace candela::farm {
namespace {

// Units of this length are many in every job below.
const std::vector<std::string> kShortUnits = {"--unit-time", "0.05", "--checkpoint-interval", "0.2"};

struct Fleet {
  int workers;
  unsigned threads;
  std::string integrator = "path";
};

// Iterations that take as long as so many of path: an odd number.
std::uint64_t iterations_of(const std::string& integrator, std::uint64_t of_path = kJobIterations) {
  const double share = test::integrator_row(integrator).farm_share;
  return static_cast<std::uint64_t>(share * static_cast<double>(of_path)) | 1;
}

// One integrator for each kind of unit; with CANDELA_LONG=1 all.
std::vector<std::string> integrators_of_the_form() {
  return long_form() ? test::all_integrators() : test::kinds_of_units();
}

// Path on fleets of several sizes; the others on one worker of two threads, and on three workers.
std::vector<Fleet> fleets() {
  std::vector<Fleet> result = {{1, 1}, {1, 2}, {2, 1}, {5, 1}};
  for (const std::string& integrator : integrators_of_the_form()) {
    if (integrator == "path") continue;
    result.push_back({1, 2, integrator});
    result.push_back({3, 1, integrator});
  }
  return result;
}

bool built(const std::string& integrator) {
  const auto names = render::integrator_names();
  return std::find(names.begin(), names.end(), integrator) != names.end();
}
// In a box of matt walls a plan merges nothing beside connections, and decides no radius then.
std::vector<std::string> with(const std::string& integrator) {
  if (test::merges(integrator)) return {"--integrator", integrator, "--set", "plan=full"};
  return {"--integrator", integrator};
}

void PrintTo(const Fleet& fleet, std::ostream* out) {
  *out << fleet.integrator << " on " << fleet.workers << " workers of " << fleet.threads << " threads";
}

class Fleets : public testing::TestWithParam<Fleet> {};

// Claim: the pixels do not depend on how many workers there are, nor on their threads.
TEST_P(Fleets, SamePixels) {
  const auto& [worker_count, threads, integrator] = GetParam();
  const std::uint64_t iterations = iterations_of(integrator);
  ASSERT_TRUE(built(integrator)) << integrator;
  Farm farm;
  farm.start_master(kShortUnits);
  for (int i = 0; i < worker_count; ++i) farm.start_worker("w" + std::to_string(i), threads);
  const std::string id = farm.submit(iterations, "cornell", with(integrator));
  farm.wait_for(id, v1::JOB_STATE_DONE);
  expect_identical(farm.fetch(id), farm.render(iterations, "cornell", with(integrator)),
                   "farm and `candela render`");
  farm.audit(id, iterations);
}

INSTANTIATE_TEST_SUITE_P(, Fleets, testing::ValuesIn(fleets()), [](const testing::TestParamInfo<Fleet>& one) {
  const std::string name = one.param.integrator;
  return (name == "path" ? "" : name) + std::to_string(one.param.workers) + "Workers" +
         std::to_string(one.param.threads) + "Threads";
});

using UnitTime = std::pair<std::string, std::string>;  // seconds, integrator
std::vector<UnitTime> unit_times() {
  std::vector<UnitTime> result;
  for (const test::IntegratorRow& row : test::integrators())
    for (const std::string& seconds :
         long_form() ? std::vector<std::string>{"0.01", "0.3", "5"} : row.unit_times)
      result.emplace_back(seconds, row.name);
  return result;
}

class UnitTimes : public testing::TestWithParam<UnitTime> {};

// Claim: the pixels do not depend on how the iterations are cut into units.
TEST_P(UnitTimes, SamePixels) {
  const auto& [seconds, integrator] = GetParam();
  ASSERT_TRUE(built(integrator)) << integrator;
  const std::uint64_t iterations = iterations_of(integrator);
  Farm farm;
  farm.start_master({"--unit-time", seconds});
  for (const char* name : {"a", "b"}) farm.start_worker(name);
  const std::string id = farm.submit(iterations, "cornell", with(integrator));
  farm.wait_for(id, v1::JOB_STATE_DONE);
  expect_identical(farm.fetch(id), farm.render(iterations, "cornell", with(integrator)),
                   "farm and `candela render`");
  farm.audit(id, iterations);
}

INSTANTIATE_TEST_SUITE_P(, UnitTimes, testing::ValuesIn(unit_times()), [](const auto& one) {
  std::string name = one.param.first;
  std::replace(name.begin(), name.end(), '.', '_');
  const std::string& integrator = one.param.second;
  return (integrator == "path" ? "" : integrator) + "Seconds" + name;
});

// Claim: the pixels do not depend on the order in which units arrive. One worker takes up to five leases at a
// time and delivers them backwards.
class Order : public testing::TestWithParam<std::string> {};

TEST_P(Order, BackwardsInBatchesOfFive) {
  const std::string& integrator = GetParam();
  ASSERT_TRUE(built(integrator)) << integrator;
  const std::uint64_t iterations = test::has_chains(integrator) ? 4 : 40;
  // The hand worker's units are as small as can be: few chains keep their number small.
  std::vector<std::string> options = with(integrator);
  if (test::has_chains(integrator))
    options.insert(options.end(), {"--set", "chains=20", "--set", "bootstrap=200"});
  if (test::has_epochs(integrator))
    for (const auto& [name, value] : test::integrator_row(integrator).small)
      options.insert(options.end(), {"--set", name + "=" + value});
  Farm farm;
  farm.start_master_here({"--unit-time", "0.01"});
  const std::string id = farm.submit(iterations, "cornell", options);
  HandWorker worker(farm.address(), "backwards");
  worker.scene_file_for_pilots = scene_path("cornell");
  bool out_of_order = false;
  const bool done = eventually(kPatienceSeconds, [&] {
    std::vector<v1::Lease> leases;
    for (int i = 0; i < 8 && leases.size() < 5; ++i)
      if (auto lease = worker.try_acquire()) leases.push_back(*lease);
    out_of_order = out_of_order || leases.size() > 1;
    for (auto lease = leases.rbegin(); lease != leases.rend(); ++lease)
      EXPECT_EQ(worker.push(worker.delta_for(*lease, scene_path("cornell"))).verdict(),
                v1::DELTA_VERDICT_MERGED);
    return farm.job(id).state() == v1::JOB_STATE_DONE;
  });
  ASSERT_TRUE(done);
  EXPECT_TRUE(out_of_order) << "the master never gave two leases at a time: nothing was shuffled";
  expect_identical(farm.fetch(id), farm.render(iterations, "cornell", options), "farm and `candela render`");
  farm.audit(id, iterations);
}

INSTANTIATE_TEST_SUITE_P(, Order, testing::ValuesIn(integrators_of_the_form()),
                         [](const auto& one) { return one.param; });

// Claim: several jobs at once do not touch each other.
TEST(Jobs, ThreeAtOnce) {
  Farm farm;
  farm.start_master(kShortUnits);
  for (const char* name : {"a", "b"}) farm.start_worker(name);
  const std::vector<std::string> scenes = {"cornell", "lamp-over-plane", "furnace"};
  std::vector<std::string> ids;
  for (const std::string& scene : scenes) ids.push_back(farm.submit(101, scene));
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    farm.wait_for(ids[i], v1::JOB_STATE_DONE);
    expect_identical(farm.fetch(ids[i]), farm.render(101, scenes[i]), scenes[i]);
    farm.audit(ids[i], 101);
  }
}

// A job that lasts for the events of a death, given the iterations that `path` needs for that. The farm knows
// iterations and chains: one integrator of each kind goes through all deaths, and loses its master four
// times. The others lose it as often as their rows say; with CANDELA_LONG=1 all do as the two, and twenty
// times.
struct Work {
  std::string integrator;
  int short_deaths;
  int deaths() const { return long_form() ? 20 : std::min(short_deaths, 4); }
  std::uint64_t of(std::uint64_t iterations) const { return iterations_of(integrator, iterations); }
};
void PrintTo(const Work& work, std::ostream* out) {
  *out << work.integrator;
}

constexpr std::uint64_t kLongJob = 601;  // twice as long as others

class Deaths : public testing::TestWithParam<Work> {
 protected:
  static bool left_to_the_long_form() { return GetParam().short_deaths < 20 && !long_form(); }
  void SetUp() override { ASSERT_TRUE(built(GetParam().integrator)) << GetParam().integrator; }
};

// Claim: a worker killed in the midst of a unit costs that unit's time and nothing else.
TEST_P(Deaths, WorkerKilledMidUnit) {
  if (left_to_the_long_form()) GTEST_SKIP() << "only with CANDELA_LONG=1";
  const std::uint64_t iterations = GetParam().of(kJobIterations);
  Farm farm;
  farm.start_master({"--unit-time", "0.5", "--lease-time", "1"});
  Process& victim = farm.start_worker("victim");
  const std::string id = farm.submit(iterations, "cornell", with(GetParam().integrator));
  farm.wait_for_iterations(id, 1);
  ASSERT_TRUE(eventually(kPatienceSeconds, [&] { return farm.job(id).units_leased() > 0; }));
  victim.kill();
  const v1::JobStatus at_death = farm.job(id);
  ASSERT_EQ(at_death.state(), v1::JOB_STATE_RUNNING)
      << "the job ended before the worker was killed: make it longer";
  ASSERT_GT(at_death.units_leased(), 0U) << "the worker had no unit when it was killed";
  farm.start_worker("heir", 2);
  farm.wait_for(id, v1::JOB_STATE_DONE);
  expect_identical(farm.fetch(id), farm.render(iterations, "cornell", with(GetParam().integrator)),
                   "after the death of a worker");
  farm.audit(id, iterations);
}

// Claim: SIGTERM makes a worker hand its unit back and leave in good order; nobody waits for its lease to
// expire.
TEST_P(Deaths, WorkerTerminated) {
  if (left_to_the_long_form()) GTEST_SKIP() << "only with CANDELA_LONG=1";
  const std::uint64_t iterations = GetParam().of(kJobIterations);
  Farm farm;
  farm.start_master({"--unit-time", "2", "--lease-time", "600"});
  Process& leaving = farm.start_worker("leaving");
  const std::string id = farm.submit(iterations, "cornell", with(GetParam().integrator));
  ASSERT_TRUE(eventually(kPatienceSeconds, [&] {
    const v1::JobStatus status = farm.job(id);
    return status.units_leased() > 0 && status.has_named_state();
  }));
  leaving.signal(SIGTERM);
  const auto exit_code = leaving.wait(30);
  ASSERT_TRUE(exit_code.has_value()) << "the worker did not leave";
  EXPECT_TRUE(*exit_code == 0 || *exit_code == 128 + SIGTERM) << *exit_code;
  EXPECT_TRUE(eventually(5, [&] { return farm.job(id).units_leased() == 0; }))
      << "a lease is still out: with --lease-time 600 the job would hang";
  farm.start_worker("heir", 2);
  farm.wait_for(id, v1::JOB_STATE_DONE);
  expect_identical(farm.fetch(id), farm.render(iterations, "cornell", with(GetParam().integrator)),
                   "after a worker left");
  farm.audit(id, iterations);
}

// Claim: a master killed many times in one job and restarted loses nothing that its checkpoints have and
// counts nothing twice.
TEST_P(Deaths, MasterKilledManyTimes) {
  const std::uint64_t iterations = GetParam().of(long_form() ? 9000 : kLongJob);
  Farm farm;
  farm.start_master({"--unit-time", "0.05", "--checkpoint-interval", "0.05", "--lease-time", "2"});
  for (const char* name : {"a", "b"}) farm.start_worker(name);
  const std::string id = farm.submit(iterations, "cornell", with(GetParam().integrator));
  std::uint64_t seen = 0;
  for (int deaths = 0; deaths < GetParam().deaths(); ++deaths) {
    // Each life merges something new, so that each death comes at another point of the work.
    v1::JobStatus status;
    ASSERT_TRUE(eventually(kPatienceSeconds,
                           [&] {
                             status = farm.job(id);
                             return status.iterations() > seen || status.state() == v1::JOB_STATE_DONE;
                           }))
        << "no progress after death " << deaths;
    ASSERT_EQ(status.state(), v1::JOB_STATE_RUNNING)
        << "the job ended after " << deaths << " deaths: make it longer";
    farm.kill_master();
    farm.restart_master();
    const std::uint64_t kept = farm.job(id).iterations();
    EXPECT_GE(kept + 1, status.checkpoint_iterations()) << "a checkpoint that was on disk is lost";
    seen = kept;
  }
  farm.wait_for(id, v1::JOB_STATE_DONE);
  expect_identical(farm.fetch(id), farm.render(iterations, "cornell", with(GetParam().integrator)),
                   "after the deaths of the master");
  farm.audit(id, iterations);
}

// Claim: a worker stopped with SIGSTOP past its lease and continued finds its unit given to another; its
// delta is refused and the unit counted once.
TEST_P(Deaths, WorkerStoppedPastItsLease) {
  if (left_to_the_long_form()) GTEST_SKIP() << "only with CANDELA_LONG=1";
  const std::uint64_t iterations = GetParam().of(kLongJob);
  Farm farm;
  farm.start_master({"--unit-time", "0.5", "--lease-time", "1"});
  Process& sleeper = farm.start_worker("sleeper");
  const std::string id = farm.submit(iterations, "cornell", with(GetParam().integrator));
  farm.wait_for_iterations(id, 1);
  ASSERT_TRUE(eventually(kPatienceSeconds, [&] { return farm.job(id).units_leased() > 0; }));
  sleeper.signal(SIGSTOP);
  const v1::JobStatus at_stop = farm.job(id);
  ASSERT_EQ(at_stop.state(), v1::JOB_STATE_RUNNING) << "the job ended too soon: make it longer";
  ASSERT_GT(at_stop.units_leased(), 0U);
  // The sleeper is alone: its leases run out with nobody to take them over, then another comes.
  ASSERT_TRUE(eventually(20, [&] { return farm.job(id).units_leased() == 0; })) << "its lease never expired";
  farm.start_worker("other");
  farm.wait_for_iterations(id, at_stop.iterations() + 1);
  sleeper.signal(SIGCONT);
  farm.wait_for(id, v1::JOB_STATE_DONE);
  EXPECT_TRUE(sleeper.running()) << "the worker did not survive its sleep: exit " << *sleeper.wait(0);
  expect_identical(farm.fetch(id), farm.render(iterations, "cornell", with(GetParam().integrator)),
                   "after a worker's sleep");
  farm.audit(id, iterations);
}

struct Goal {
  std::string integrator, relmse;
};
void PrintTo(const Goal& goal, std::ostream* out) {
  *out << goal.integrator;
}
class Goals : public testing::TestWithParam<Goal> {};

// Claim: a job that ends by its error ends at the same iterations, with the same pixels and metadata, on any
// workers, also when workers and the master die on the way. Attributes "candela:run:*" may differ: a master
// may decide the state of an epoch of which the image has no iteration.
TEST_P(Goals, SameStopSamePixels) {
  constexpr std::uint64_t kMax =
      50'000;  // iterations, which no job here has before its error is small enough
  std::vector<std::string> options = with(GetParam().integrator);
  options.insert(options.end(), {"--until", "relmse=" + GetParam().relmse});
  Farm farm;
  farm.start_master({"--unit-time", "0.1", "--checkpoint-interval", "0.1", "--lease-time", "2"});
  std::vector<Process*> workers;
  for (const char* name : {"a", "b", "c", "d", "e"}) workers.push_back(&farm.start_worker(name));
  const std::string id = farm.submit(kMax, "cornell", options);
  farm.wait_for_iterations(id, 4);  // fewer than any of these jobs has
  farm.forget_worker(*workers[0]);
  farm.kill_master();
  farm.restart_master();
  const v1::JobStatus done = farm.wait_for(id, v1::JOB_STATE_DONE);
  EXPECT_LE(done.relmse_upper(), std::stod(GetParam().relmse));
  const image::Image fetched = farm.fetch(id), rendered = farm.render(kMax, "cornell", options);
  EXPECT_EQ(fetched.metadata.at("candela:run:stop_reason"), "relmse");
  expect_identical(fetched, rendered, "farm and `candela render`");
  for (const auto& [name, value] : fetched.metadata)
    if (name != "candela:job" && !name.starts_with("candela:run:")) {
      EXPECT_EQ(value, rendered.metadata.contains(name) ? rendered.metadata.at(name) : "-") << name;
    }
  farm.audit(id, done.iterations());
}

INSTANTIATE_TEST_SUITE_P(, Goals,
                         testing::Values(Goal{"path", "0.006"}, Goal{"vcm", "0.1"}, Goal{"fppm", "0.03"},
                                         Goal{"pssmlt", "0.04"}),
                         [](const auto& one) { return one.param.integrator; });

std::vector<Work> works() {
  std::vector<Work> result;
  for (const test::IntegratorRow& row : test::integrators())
    if (row.deaths > 0 || long_form()) result.push_back({row.name, row.deaths});
  return result;
}
INSTANTIATE_TEST_SUITE_P(, Deaths, testing::ValuesIn(works()),
                         [](const auto& one) { return one.param.integrator; });

// Claim: a job that mollifies has one picture: on one machine, and on a farm whose master and worker are
// killed. Its radii are functions of the numbers of samples and mutations in the job, never of a worker's.
class Regularised : public testing::TestWithParam<std::string> {};

TEST_P(Regularised, SamePixelsWithDeaths) {
  const std::string scene = "tests/statistical/transport/bulb-room.xml", &integrator = GetParam();
  const bool chains = test::has_chains(integrator);
  std::vector<std::string> options = {"--integrator", integrator,      "--set", "max_depth=5",
                                      "--set",        "regularise=on", "--set", "regularise_radius=0.1"};
  if (integrator == "mlt" || integrator == "erpt") options.insert(options.end(), {"--set", "direct=chain"});
  const std::uint64_t iterations = chains ? 30 : long_form() ? 301 : 101;
  Farm farm;
  farm.start_master({"--unit-time", "0.05", "--checkpoint-interval", "0.05", "--lease-time", "2"});
  Process& victim = farm.start_worker("victim");
  const std::string id = farm.submit(iterations, scene, options);
  farm.wait_for_iterations(id, 1);
  victim.kill();
  for (int i = 0; i < (long_form() ? 8 : 2); ++i) farm.start_worker("heir" + std::to_string(i));
  farm.kill_master();
  farm.restart_master();
  farm.wait_for(id, v1::JOB_STATE_DONE);
  const image::Image picture = farm.fetch(id);
  expect_identical(picture, farm.render(iterations, scene, options), "with deaths");
  farm.audit(id, iterations);
  if (!long_form()) return;
  std::vector<std::string> off = options;
  off[5] = "regularise=off";
  EXPECT_NE(picture.rgb, farm.render(iterations, scene, off).rgb);
}
INSTANTIATE_TEST_SUITE_P(, Regularised,
                         testing::ValuesIn(long_form() ? std::vector<std::string>{"path", "bdpt", "pssmlt",
                                                                                  "mmlt", "mlt", "erpt"}
                                                       : std::vector<std::string>{"bdpt"}),
                         [](const auto& one) { return one.param; });

}  // namespace
}  // namespace candela::farm
