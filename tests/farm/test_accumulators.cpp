// Jobs whose units bring more than a film, of every integrator that has such: radii that are decided between
// epochs, and the sums of optimal weights. Film, accumulators and every decided state are the bytes that a
// loop in this process makes without a farm, for any number of workers, whatever dies, and when.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "common/base/files.h"
#include "common/rng/stream.h"
#include "common/stages/epochs.h"
#include "common/stats/error_context.h"
#include "common/stats/error_interval.h"
#include "common/stats/inner_merges.h"
#include "tests/farm/farm.h"
#include "tests/farm/hand_worker.h"
#include "tests/farm/local_job.h"
#include "tests/integrators.h"
#include "tests/unit/farm_calls.h"
#include "tests/unit/scene_fixture.h"
#include "worker/render/renderer.h"

namespace candela::farm {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kSide = 16;  // pixels

// A box with a glass ball and two lamps: pixels shrink, and the lights are worth a choice. A ball hides one
// of them from parts of a wall.
const std::string kLitBox =
    "<scene version=\"3.0.0\"><integrator type=\"path\"/><sensor type=\"perspective\"/>"
    "<shape type=\"cube\"><bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf></shape>"
    "<shape type=\"sphere\"><point name=\"center\" x=\"0.3\" y=\"-0.4\" z=\"0.4\"/><float name=\"radius\" "
    "value=\"0.3\"/><bsdf type=\"dielectric\"/></shape>"
    "<shape type=\"sphere\"><point name=\"center\" x=\"-0.3\" y=\"-0.3\" z=\"0.85\"/><float name=\"radius\" "
    "value=\"0.1\"/></shape>"
    "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"0.3\"/><rotate x=\"1\" "
    "angle=\"90\"/><translate y=\"0.99\"/></transform><emitter type=\"area\"/></shape>"
    "<shape type=\"sphere\"><point name=\"center\" x=\"-0.7\" y=\"-0.5\" z=\"0.7\"/><float name=\"radius\" "
    "value=\"0.05\"/><emitter type=\"area\"><rgb name=\"radiance\" value=\"9\"/></emitter></shape></scene>";

struct JobKind {
  std::string name;
  JobSettings settings;
  bool epochs = false;
  std::string scene = kLitBox;
};

// A row for each integrator with accumulators, and for other rules of the same. The short form has one for
// each kind of them.
std::vector<JobKind> job_kinds() {
  std::vector<JobKind> all;
  const auto add = [&](const std::string& name, const std::string& integrator, const SettingsMap& chosen) {
    JobKind kind{.name = name, .settings = {}};
    kind.settings.integrator = integrator;
    kind.settings.width = kind.settings.height = kSide;
    kind.settings.seed = 5;
    const auto complete = render::complete_integrator_settings(integrator, {}, chosen);
    if (!complete.ok()) throw std::runtime_error(complete.error().to_string());
    kind.settings.integrator_settings = *complete;
    const auto work = render::largest_work(kind.settings);
    if (!work.ok()) throw std::runtime_error(work.error().to_string());
    kind.epochs = work->epochs.has_value();
    if (!work->accumulators.empty()) all.push_back(std::move(kind));
  };
  for (const test::IntegratorRow& row : test::integrators()) {
    SettingsMap chosen(row.small.begin(), row.small.end());
    add(row.name, row.name, chosen);
    if (row.name == "optimis")
      add("optimis, trained", row.name, {{"selection", "trained"}, {"epoch_min", "2"}, {"growth", "16"}});
  }
  // AOVs are accumulators beside the integrator's own; mattes have keys.
  for (const std::string integrator : {"path", "appm"}) {
    JobKind kind{.name = integrator + " with AOVs", .settings = {}};
    for (const JobKind& own : all)
      if (own.settings.integrator == integrator) {
        kind.settings = own.settings;
        kind.epochs = own.epochs;
      }
    kind.settings.integrator = integrator;
    kind.settings.width = kind.settings.height = kSide;
    kind.settings.seed = 5;
    if (integrator == "path")
      kind.settings.integrator_settings = *render::complete_integrator_settings(integrator, {}, {});
    kind.settings.aovs = "albedo:albedo,n:sh_normal,p:position,coverage:coverage,o:crypto_object";
    all.push_back(std::move(kind));
  }
  if (!long_form())  // sums of epochs that decide radii, and that train; by keys; that measure bias
    std::erase_if(all, [](const JobKind& kind) {
      return kind.name != "vcmplus" && kind.name != "optimis, trained" && kind.name != "path with AOVs" &&
             kind.name != "ppm";
    });
  return all;
}

class AccumulatorFarm : public testing::Test {
 protected:
  struct Job {
    const JobKind* kind;
    std::string id;
  };

  AccumulatorFarm() {
    if (!write_file_atomically(scene_file(), kLitBox)) throw std::runtime_error("no room for the scene");
  }
  std::string scene_file() const { return (folder_ / "scene.xml").string(); }
  void start_master(const std::string& checkpoint_seconds, const std::string& lease_seconds = "1.5") {
    farm.start_master(
        {"--unit-time", "0.01", "--checkpoint-interval", checkpoint_seconds, "--lease-time", lease_seconds});
  }
  std::string submit(const JobKind& kind, std::uint64_t iterations) {
    return test::submit(farm.stub(), kind.scene, test::submission(kind.scene, kind.settings, iterations));
  }
  std::vector<Job> submit_all(std::uint64_t iterations) {
    std::vector<Job> jobs;
    for (const JobKind& kind : kinds_) jobs.push_back({&kind, submit(kind, iterations)});
    return jobs;
  }
  std::size_t decided(const std::string& id) {
    const auto events = farm.events(id);
    return static_cast<std::size_t>(std::count_if(
        events.begin(), events.end(), [](const v1::Event& event) { return event.kind() == "decided"; }));
  }
  // The checkpoints of a job, oldest first; none before the first.
  std::vector<fs::path> checkpoints(const std::string& id) {
    std::map<std::uint64_t, fs::path> found;
    std::error_code none;
    for (const auto& e : fs::directory_iterator(farm.folder() / "data" / "jobs" / id, none))
      if (const std::string n = e.path().filename().string(); n.starts_with("film.") && n.ends_with(".ckpt"))
        found[std::stoull(n.substr(5))] = e.path();
    std::vector<fs::path> paths;
    for (const auto& [generation, path] : found) paths.push_back(path);
    return paths;
  }

  const LocalJob& truth(const JobKind& kind, std::uint64_t iterations) {
    const auto key = std::make_pair(kind.name, iterations);
    const auto known = truths_.find(key);
    if (known != truths_.end()) return known->second;
    const test::TextFiles files({{"scene.xml", kind.scene}});
    const auto renderer = render::Renderer::create(files, "scene.xml", {}, kind.settings, 1);
    if (!renderer.ok()) throw std::runtime_error(renderer.error().to_string());
    const auto pilot = (*renderer)->pilot({});
    if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
    const auto render = [&](const Unit& unit, std::string_view state) {
      render::UnitOutput output = (*renderer)->make_output(pilot->state);
      render::UnitInput input{pilot->state, {}, {}};
      if (pilot->work.epochs) input.states[pilot->work.epochs->rule] = state;
      const auto done = (*renderer)->run(unit, input, output, {});
      EXPECT_TRUE(done.ok()) << done.error().to_string();
      return output;
    };
    return truths_
        .emplace(key,
                 local_job(pilot->work, {kSide, kSide, 1}, pilot->state.film_scale_log2, iterations, render))
        .first->second;
  }
  void check(const Job& job, std::uint64_t iterations) {
    SCOPED_TRACE(job.kind->name + ", " + job.id);
    const v1::JobStatus status = farm.wait_for(job.id, v1::JOB_STATE_DONE);
    ASSERT_EQ(status.iterations(), iterations);
    const fs::path file = farm.folder() / "data" / "jobs" / job.id /
                          fmt::format("film.{}.ckpt", status.checkpoint_generation());
    expect_checkpoint(file, truth(*job.kind, iterations));
    farm.audit(job.id, iterations);
    check_error(job, file, truth(*job.kind, iterations));
  }
  // If photons measure their bias, `show` has the error that follows from these sums and the film; the
  // movement is the checkpoint's, as it needs each unit.
  void check_error(const Job& job, const fs::path& checkpoint, const LocalJob& local) {
    std::array<const film::MergedAccumulator*, 2> inner{};
    for (std::uint32_t i = 0; i < local.work.accumulators.size(); ++i)
      if (local.work.accumulators[i].name == stats::kInnerMerges)
        inner = {local.accumulators.at({i, 0}).get(), local.accumulators.at({i, 1}).get()};
    if (inner[0] == nullptr) return;
    const auto measured = stats::measured_bias(inner, kSide, kSide, double(local.film.merged(0).count()),
                                               double(local.film.merged(1).count()));
    stats::ErrorContext context =
        stats::context_of(job.kind->settings.integrator_settings, farm.job(job.id).plan());
    const auto bytes = read_file(checkpoint, 1 << 28);
    ASSERT_TRUE(bytes.ok()) << bytes.error().to_string();
    const auto kept =
        master::parse_checkpoint(*bytes, {0, local.work.accumulators, local.work.epochs, context.alpha});
    ASSERT_TRUE(kept.ok()) << kept.error().to_string();
    const stats::Movement movement = kept->movement.movement(local.film);
    context.movement = &movement;
    context.measured = &measured;
    const stats::ErrorInterval error = stats::error_interval(stats::halves_of(local.film, {}), context);
    EXPECT_GT(error.blur, 0.1 * error.noise) << "or the lines below prove little";
    const auto shown = nlohmann::json::parse(farm.candela({"show", job.id, "--json"}).out);
    EXPECT_DOUBLE_EQ(shown.at("error"), error.relmse);
    EXPECT_DOUBLE_EQ(shown.at("error_upper"), error.upper);
  }

  TempDir folder_;
  Farm farm;
  const std::vector<JobKind> kinds_ = job_kinds();
  std::map<std::pair<std::string, std::uint64_t>, LocalJob> truths_;
};

// Claim: film, accumulators, states, and the error by what photons measure do not depend on the number of
// workers.
TEST_F(AccumulatorFarm, SameBytesOfOneTwoAndEightWorkers) {
  const std::uint64_t iterations = long_form() ? 75 : 51;
  start_master("0.2");
  std::set<std::string> merged_by;
  int workers = 0;
  for (const int fleet : {1, 2, 8}) {
    for (; workers < fleet; ++workers) farm.start_worker(fmt::format("w{}", workers));
    ASSERT_TRUE(eventually(kPatienceSeconds, [&] { return farm.workers().size() == std::size_t(fleet); }));
    merged_by.clear();
    const std::vector<Job> jobs = submit_all(iterations);
    for (const Job& job : jobs) {
      check(job, iterations);
      const v1::GetLedgerResponse ledger = farm.ledger(job.id);
      for (const v1::LedgerRow& row : ledger.merged()) merged_by.insert(row.worker_id());
    }
    EXPECT_GE(merged_by.size(), std::min<std::size_t>(2, std::size_t(fleet)));
  }
  EXPECT_GT(merged_by.size(), 2U) << "eight workers, of which two did all the work";
}

// Claim: so do they if the training of light selection ends after epoch 0, with empty states, since all lamps
// are seen.
TEST_F(AccumulatorFarm, TrainingThatEndsHasEmptyStates) {
  constexpr std::uint64_t kIterations = 150;
  const auto trained = std::find_if(kinds_.begin(), kinds_.end(),
                                    [](const JobKind& kind) { return kind.name == "optimis, trained"; });
  ASSERT_NE(trained, kinds_.end());
  JobKind kind = *trained;
  kind.name = "optimis, trained in epoch 0";
  kind.settings.integrator_settings["epoch_min"] = "32";
  kind.settings.integrator_settings["growth"] = "1";
  kind.scene =
      "<scene version=\"3.0.0\"><sensor type=\"perspective\"><transform name=\"to_world\">"
      "<lookat origin=\"0,0,3\" target=\"0,0,0\" up=\"0,1,0\"/></transform></sensor>"
      "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"9\"/></transform></shape>"
      "<emitter type=\"point\"><point name=\"position\" x=\"-1\" y=\"0\" z=\"2\"/></emitter>"
      "<emitter type=\"point\"><point name=\"position\" x=\"1\" y=\"1\" z=\"2\"/></emitter></scene>";
  start_master("0.05");
  for (int i = 0; i < 2; ++i) farm.start_worker(fmt::format("w{}", i));
  check({&kind, submit(kind, kIterations)}, kIterations);
  const std::vector<std::string>& states = truth(kind, kIterations).states;
  ASSERT_GE(states.size(), 3U);
  EXPECT_FALSE(states[1].empty());
  for (std::size_t e = 2; e < states.size(); ++e) EXPECT_TRUE(states[e].empty()) << e;
}

// Claim: SIGKILL of the master and of workers, at times all over the jobs, with the newest checkpoints lost,
// and an extension of what has ended change no byte, nor the error that is shown.
TEST_F(AccumulatorFarm, DeathsChangeNothing) {
  const std::uint64_t first = long_form() ? 241 : 121, more = 38;
  constexpr int kDeaths = 6;
  start_master("0.05");
  std::vector<Process*> workers;
  for (int i = 0; i < 2; ++i) workers.push_back(&farm.start_worker(fmt::format("w{}", i)));
  const std::vector<Job> jobs = submit_all(first);
  rng::Stream stream(rng::key(7, 5));
  for (int death = 0; death < kDeaths; ++death) {
    const Job& job = jobs[static_cast<std::size_t>(death) % jobs.size()];
    farm.wait_for_iterations(job.id, first * static_cast<std::uint64_t>(death) / kDeaths + 1);
    std::this_thread::sleep_for(std::chrono::milliseconds(static_cast<int>(stream.next_double() * 40)));
    if (death % 2 == 1) {
      auto& worker = workers[static_cast<std::size_t>(death / 2) % workers.size()];
      farm.forget_worker(*worker);
      worker = &farm.start_worker(fmt::format("again{}", death));
      continue;
    }
    farm.kill_master();
    for (const Job& one : jobs)
      if (auto files = checkpoints(one.id); death == 2 && files.size() > 1) fs::remove(files.back());
    farm.restart_master();
  }
  for (const Job& job : jobs) farm.wait_for(job.id, v1::JOB_STATE_DONE);
  farm.kill_master();
  farm.restart_master();
  for (const Job& job : jobs) farm.extend(job.id, more);
  for (const Job& job : jobs) check(job, first + more);
  EXPECT_EQ(farm.candela({"verify"}).exit_code, 0);
}

// Claim: a master that dies within an epoch, or between the decision of an epoch and its first unit, deltas
// that are delivered backwards and twice, and an extension within an epoch change no byte.
TEST_F(AccumulatorFarm, EpochsOutliveTheMaster) {
  constexpr std::uint64_t kFirst = 11, kWhole = 19;  // epochs of two iterations: kFirst ends within one
  start_master("0.02", "600");
  std::size_t between = 0, within = 0;
  for (const JobKind& kind : kinds_) {
    SCOPED_TRACE(kind.name);
    const Job job{&kind, submit(kind, kFirst)};
    auto worker = std::make_unique<HandWorker>(farm.address(), kind.name);
    const auto prepare = [&] {
      worker->scene_file_for_pilots = scene_file();
      worker->told_seconds = 1;  // so that a unit is one iteration
    };
    prepare();
    bool extended = false;
    std::size_t delivered = 0, deaths = 0;
    // The first death waits for an odd number of iterations, which is within an epoch, and the second for an
    // even one whose next state is decided.
    const auto dies_at = [&](std::uint64_t done) {
      return deaths < 2 && delivered >= 3 && (done % 2 == 1) == (deaths == 0);
    };
    ASSERT_TRUE(eventually(kPatienceSeconds, [&] {
      // A master that decides late leases fewer than three units. One unit alone then brings the number that
      // the death waits for, whatever the times are.
      const bool one_brings_it = !dies_at(farm.job(job.id).iterations()) && deaths < 2 && delivered >= 3;
      std::vector<v1::Lease> leases;
      for (int i = 0; i < (one_brings_it ? 1 : 3); ++i)
        if (auto lease = worker->try_acquire()) leases.push_back(*lease);
      for (auto lease = leases.rbegin(); lease != leases.rend(); ++lease, ++delivered) {
        const Push push = worker->delta_for(*lease, scene_file());
        EXPECT_EQ(worker->push(push).verdict(), v1::DELTA_VERDICT_MERGED);
        EXPECT_EQ(worker->push(push).verdict(), v1::DELTA_VERDICT_DUPLICATE);
      }
      const v1::JobStatus status = farm.job(job.id);
      if (status.state() == v1::JOB_STATE_DONE) {
        if (extended) return true;
        farm.extend(job.id, kWhole - kFirst);
        extended = true;
        return false;
      }
      const std::uint64_t done = status.iterations();
      if (!dies_at(done)) return false;
      const bool odd = done % 2 == 1;
      if (!odd && kind.epochs) {
        const std::size_t needed = done / 2 + 1;
        EXPECT_TRUE(eventually(kPatienceSeconds, [&] { return decided(job.id) >= needed; }));
      }
      ++(odd ? within : between);
      ++deaths;
      farm.kill_master();
      farm.restart_master();
      worker = std::make_unique<HandWorker>(farm.address(), kind.name);
      prepare();
      return false;
    }));
    check(job, kWhole);
  }
  EXPECT_EQ(within, kinds_.size());
  EXPECT_EQ(between, kinds_.size());
}

}  // namespace
}  // namespace candela::farm
