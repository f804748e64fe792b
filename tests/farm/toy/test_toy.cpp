// Epochs on farms, most of real processes: whatever dies, and when, the film, the accumulators and every
// decided state of the toy come out as the same bytes, which a loop in this process makes without a farm.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <memory>
#include <optional>
#include <ostream>
#include <thread>

#include "common/base/files.h"
#include "common/base/hash.h"
#include "common/base/version.h"
#include "common/rng/stream.h"
#include "common/stages/epochs.h"
#include "master/merge/checkpoint.h"
#include "tests/farm/farm.h"
#include "tests/farm/local_job.h"
#include "tests/farm/toy/toy.h"
#include "tests/token_channel.h"
#include "tests/unit/farm_calls.h"
#include "tests/unit/hand_worker.h"

namespace candela::farm {
namespace {

constexpr std::uint32_t kToyWidth = 40, kToyHeight = 33;
constexpr std::uint64_t kSeed = 11;
// A shape, a light and a camera, which the toy ignores.
const std::string kToyScene =
    "<scene version='3.0.0'><sensor type='perspective'/><shape type='sphere'><emitter "
    "type='area'/></shape></scene>";

std::uint64_t iterations_of_the_form() {
  return std::getenv("CANDELA_TOY_LONG") != nullptr ? 1201 : 161;
}

// The toy's job without a farm.
LocalJob truth_of(std::uint64_t iterations, int scale_log2) {
  return local_job(toy::work_plan(), {kToyWidth, kToyHeight, 1}, scale_log2, iterations,
                   [&](const Unit& unit, std::string_view state) {
                     integrators::UnitOutput output = toy::make_output(kToyWidth, kToyHeight, scale_log2);
                     EXPECT_TRUE(toy::render(unit, state, kToyWidth, kToyHeight, kSeed, output).ok());
                     return output;
                   });
}

class ToyFarm : public testing::Test {
 protected:
  ToyFarm() { farm.set_programs("toy-master", "toy-worker"); }
  void start_master(const std::string& checkpoint_seconds = "0.05", std::vector<std::string> more = {}) {
    std::vector<std::string> options = {"--unit-time",      "0.02",         "--checkpoint-interval",
                                        checkpoint_seconds, "--lease-time", "1.5"};
    options.insert(options.end(), more.begin(), more.end());
    farm.start_master(options);
  }
  std::size_t decided(const std::string& id) {
    std::size_t count = 0;
    for (const v1::Event& event : farm.events(id)) count += event.kind() == "decided" ? 1 : 0;
    return count;
  }
  std::string submit(std::uint64_t iterations, int pause_microseconds = 400) {
    JobSettings settings;
    settings.integrator = toy::kName;
    settings.integrator_settings = {{"pause", std::to_string(pause_microseconds)}};
    settings.width = kToyWidth;
    settings.height = kToyHeight;
    settings.seed = kSeed;
    return test::submit(farm.stub(), kToyScene, test::submission(kToyScene, settings, iterations));
  }
  void start_master_here(std::vector<std::string> more = {}) {
    std::vector<std::string> options = {"--unit-time", "0.02",         "--checkpoint-interval",
                                        "0.05",        "--lease-time", "1.5"};
    options.insert(options.end(), more.begin(), more.end());
    farm.start_master_here(options);
  }
  // A worker in the test's hands, which answers the pilot of the job.
  std::unique_ptr<test::HandWorker> hand_worker() {
    auto hand = std::make_unique<test::HandWorker>(test::token_channel_by_environment(farm.address()));
    EXPECT_TRUE(hand->enrol().ok());
    const auto lease = hand->acquire_soon();
    EXPECT_TRUE(lease);
    if (!lease) return hand;
    v1::CompletePilotRequest pilot;
    hand->sign(pilot, *lease);
    pilot.mutable_named_state()->set_film_scale_log2(toy::kFilmScale);
    pilot.set_seconds_per_iteration(0.002);
    wire::to_proto(toy::work_plan(), *pilot.mutable_work());
    hand->complete(pilot);
    return hand;
  }
  // The delta of a lease, `epoch_offset` epochs from the true one.
  static std::string delta_of(test::HandWorker& hand, const v1::Lease& lease,
                              std::uint64_t epoch_offset = 0) {
    const Unit unit = *wire::from_proto(lease.unit());
    EXPECT_EQ(lease.states_size(), 1);
    integrators::UnitOutput output = toy::make_output(kToyWidth, kToyHeight, toy::kFilmScale);
    const WorkPlan work = toy::work_plan();
    output.epoch = Epochs(work.epochs->first, work.epochs->growth).of_index(unit.begin) + epoch_offset;
    const std::string state = hand.fetch_blob(lease.states(0).sha256(), lease.states(0).size_bytes());
    EXPECT_EQ(sha256_hex(state), lease.states(0).sha256());
    EXPECT_TRUE(toy::render(unit, state, kToyWidth, kToyHeight, kSeed, output).ok());
    film::DeltaInfo info;
    info.unit = unit;
    info.job_id = lease.job_id();
    info.build_id = std::string(build_id());
    return integrators::encode_delta(info, output);
  }
  // Renders what is left of the job; of every third unit, if `cuts`, only a part.
  void work(test::HandWorker& hand, const std::string& id, bool cuts = false) {
    unsigned units = 0;
    while (farm.job(id).state() < v1::JOB_STATE_DONE) {
      const auto lease = hand.acquire();
      ASSERT_TRUE(hand.status.ok()) << hand.status.error_message();
      if (!lease) {
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
        continue;
      }
      v1::Lease part = *lease;
      v1::Unit& unit = *part.mutable_unit();
      if (cuts && ++units % 3 == 0) unit.set_end(unit.begin() + 1 + units % (unit.end() - unit.begin()));
      const std::string bytes = delta_of(hand, part);
      hand.push(hand.header(part, bytes), bytes);
    }
  }
  // The whole of a finished job against the loop without a farm.
  void check(const std::string& id, std::uint64_t iterations) {
    const v1::JobStatus status = farm.wait_for(id, v1::JOB_STATE_DONE);
    ASSERT_EQ(status.iterations(), iterations);
    expect_checkpoint(farm.folder().path() / "data" / "jobs" / id /
                          fmt::format("film.{}.ckpt", status.checkpoint_generation()),
                      truth_of(iterations, status.named_state().film_scale_log2()));
    farm.audit(id, iterations);
  }

  Farm farm;
  const std::uint64_t whole = iterations_of_the_form();
};

// Claim: audits of every unit change neither film, accumulators nor states.
TEST_F(ToyFarm, AuditsChangeNothing) {
  start_master("0.05", {"--audit", "100%"});
  for (int i = 0; i < 3; ++i) farm.start_worker("w" + std::to_string(i));
  const std::string id = submit(whole);
  check(id, whole);
  for (const v1::Event& event : farm.events("")) EXPECT_NE(event.kind(), "distrusted") << event.message();
}

class ToyFleets : public ToyFarm, public testing::WithParamInterface<int> {};

// Claim: film, accumulators and states do not depend on the number of workers.
TEST_P(ToyFleets, SameBytes) {
  start_master();
  for (int i = 0; i < GetParam(); ++i) farm.start_worker("w" + std::to_string(i));
  check(submit(whole), whole);
}
INSTANTIATE_TEST_SUITE_P(Workers, ToyFleets, testing::Values(1, 4, 16),
                         [](const auto& test) { return std::to_string(test.param); });

// Claim: SIGKILL of the master and of workers, at times all over the job, changes no byte.
TEST_F(ToyFarm, KillsChangeNothing) {
  start_master();
  std::vector<Process*> workers;
  for (int i = 0; i < 3; ++i) workers.push_back(&farm.start_worker("w" + std::to_string(i)));
  const std::string id = submit(whole);
  rng::Stream stream(rng::key(3, 5));
  const int kills = std::getenv("CANDELA_TOY_LONG") != nullptr ? 60 : 8;
  for (int k = 0; k < kills; ++k) {
    // Progress in between, so that the deaths fall all over the job.
    const std::uint64_t next = whole * static_cast<std::uint64_t>(k) / static_cast<std::uint64_t>(kills + 1);
    farm.wait_for_iterations(id, next);
    std::this_thread::sleep_for(std::chrono::milliseconds(static_cast<int>(stream.next_double() * 60)));
    if (k % 2 == 0) {
      farm.kill_master();
      farm.restart_master();
    } else {
      const std::size_t w = static_cast<std::size_t>(stream.next_double() * 3);
      farm.forget_worker(*workers[w]);
      workers[w] = &farm.start_worker(fmt::format("again{}", k));
    }
  }
  check(id, whole);
}

// Claim: a master that lost its newest checkpoint between epochs, while its store tells of later states,
// decides nothing anew, renders what is lost and ends with the same bytes.
TEST_F(ToyFarm, ALostCheckpointChangesNoState) {
  start_master();
  farm.start_worker("a");
  farm.start_worker("b");
  const std::string id = submit(whole);
  for (int k = 1; k <= 2; ++k) {
    farm.wait_for_iterations(id, whole * static_cast<std::uint64_t>(k) / 3);
    farm.kill_master();
    const auto folder = farm.folder().path() / "data" / "jobs" / id;
    std::vector<std::pair<std::uint64_t, std::filesystem::path>> generations;
    for (const auto& e : std::filesystem::directory_iterator(folder))
      if (const std::string n = e.path().filename().string(); n.starts_with("film.") && n.ends_with(".ckpt"))
        generations.emplace_back(std::stoull(n.substr(5)), e.path());
    for (const auto& [generation, path] : generations)
      if (k == 1 || generation == std::max_element(generations.begin(), generations.end())->first)
        std::filesystem::remove(path);  // all of them once: the film begins again, the states do not
    farm.restart_master();
  }
  check(id, whole);
}

// Claim: a master that dies after a decision, before a checkpoint has it, makes the decision again from an
// older checkpoint and ends with the same bytes.
TEST_F(ToyFarm, DeathsBetweenDecisionAndCheckpoint) {
  start_master("0.4");
  farm.start_worker("a");
  farm.start_worker("b");
  const std::string id = submit(whole, 2000);
  for (std::size_t k = 1; k <= 4; ++k) {
    const std::size_t before = decided(id);
    for (int i = 0; i < 4000 && decided(id) == before && farm.job(id).state() != v1::JOB_STATE_DONE; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    farm.kill_master();
    farm.restart_master();
  }
  check(id, whole);
}

// Claim: a job whose checkpoint is of the form before carries, with the sums of all its epochs, goes on: the
// sums are folded again and give the same states.
TEST_F(ToyFarm, AnOldCheckpointGoesOn) {
  start_master();
  farm.start_worker("a");
  const std::uint64_t first = whole / 2;
  const std::string id = submit(first);
  check(id, first);
  const v1::JobStatus status = farm.job(id);
  farm.kill_master();
  const LocalJob truth = truth_of(first, status.named_state().film_scale_log2());
  master::Decisions decisions;
  for (std::size_t e = 0; e < truth.states.size(); ++e)
    decisions.states.push_back({toy::kRule, e, sha256_hex(truth.states[e]), 0});
  const auto folder = farm.folder().path() / "data" / "jobs" / id;
  for (const auto& e : std::filesystem::directory_iterator(folder))
    if (e.path().extension() == ".ckpt") std::filesystem::remove(e.path());
  ASSERT_TRUE(write_file_atomically(folder / fmt::format("film.{}.ckpt", status.checkpoint_generation()),
                                    master::encode_checkpoint(truth.film, {}, truth.accumulators, decisions))
                  .ok());
  farm.restart_master();
  farm.extend(id, whole - first);
  check(id, whole);
}

// Claim: a blob of a state that is lost, or damaged, is decided again as the same bytes.
TEST_F(ToyFarm, ALostStateIsDecidedAgain) {
  start_master();
  Process& first = farm.start_worker("a");
  const std::string id = submit(whole, 4000);
  farm.wait_for_iterations(id, whole / 3);
  farm.forget_worker(first);
  std::size_t spoiled = 0;
  const WorkPlan work = toy::work_plan();
  for (const v1::Event& event : farm.events(id)) {
    if (event.kind() != "decided") continue;
    const std::string sha256 = event.message().substr(event.message().size() - 64);
    for (const auto& e :
         std::filesystem::recursive_directory_iterator(farm.folder().path() / "data" / "blobs"))
      if (e.path().filename().string().find(sha256) != std::string::npos && e.is_regular_file()) {
        if (spoiled++ % 2 == 0)
          std::filesystem::remove(e.path());
        else
          std::filesystem::resize_file(e.path(), 5);
        break;
      }
  }
  EXPECT_GT(spoiled, 1U);
  farm.start_worker("fresh");  // its cache is empty
  check(id, whole);
}

// Claim: units that are cut short, at any iteration, change no byte of film, accumulators and states.
TEST_F(ToyFarm, CutUnitsChangeNothing) {
  start_master_here({"--unit-time", "1"});
  const std::string id = submit(whole);
  work(*hand_worker(), id, true);
  check(id, whole);
}

// Claim: a worker whose renderer does not stop when its job is cancelled begins again in the same process, is
// leased nothing before, and renders the next job.
TEST_F(ToyFarm, AWorkerThatDoesNotStopBeginsAgain) {
  if (std::getenv("CANDELA_TOY_LONG") == nullptr) GTEST_SKIP() << "ten seconds of waiting: the long form";
  start_master();
  Process& worker = farm.start_worker("deaf");
  const std::string deaf = submit(whole, 600'000'000);
  ASSERT_TRUE(
      eventually(20, [&] { return farm.job(deaf).units_leased() > 0 && !farm.job(deaf).plan().empty(); }));
  const std::string before = farm.worker("deaf").id();
  std::this_thread::sleep_for(std::chrono::seconds(1));
  ASSERT_EQ(farm.candela({"cancel", deaf}).exit_code, 0);
  const std::string next = submit(whole);
  EXPECT_EQ(farm.worker("deaf").state(), "busy");
  ASSERT_TRUE(eventually(60, [&] { return farm.worker("deaf").id() != before; }));
  EXPECT_EQ(farm.job(next).iterations(), 0U);
  check(next, whole);
  EXPECT_FALSE(worker.wait(0)) << "the process is the same";
}

// Claim: the status of a job tells the newest decided state by the rule's figures and the memory of its
// statistics; an image has them as attributes, and layers when asked.
TEST_F(ToyFarm, ReportsTellOfTheState) {
  start_master_here();
  const std::string id = submit(whole);
  work(*hand_worker(), id);
  const v1::EpochStatus epochs = farm.wait_for(id, v1::JOB_STATE_DONE).epochs();
  const LocalJob truth = truth_of(whole, 20);
  EXPECT_EQ(epochs.epoch(), truth.states.size() - 1);
  double doublings = 0;
  for (const char level : truth.states.back()) doublings += level;
  ASSERT_EQ(epochs.figures_size(), 2);
  EXPECT_EQ(epochs.figures(0).name(), "doublings");
  EXPECT_EQ(epochs.figures(0).value(), doublings);
  EXPECT_GT(epochs.statistics_bytes(), kToyWidth * kToyHeight * 8U);
  EXPECT_LT(epochs.statistics_bytes(), kToyWidth * kToyHeight * 8U * 6);
  EXPECT_GT(epochs.received_bytes(), 0U);
  for (const bool layers : {false, true}) {
    v1::FetchImageRequest request;
    request.set_job_id(id);
    request.set_state_layers(layers);
    grpc::ClientContext context;
    const auto reader = farm.stub().FetchImage(&context, request);
    std::string bytes;
    for (v1::FetchImageChunk chunk; reader->Read(&chunk);) bytes += chunk.data();
    ASSERT_TRUE(reader->Finish().ok());
    const auto path = farm.folder().path() / "image.exr";
    ASSERT_TRUE(write_file_atomically(path, bytes).ok());
    EXPECT_EQ(image::read_layer(path, "level").ok(), layers);
    EXPECT_EQ(image::read_image(path)->metadata.at("candela:run:doublings"),
              fmt::format("{:.6g}", doublings));
  }
}

// Claim: a job whose statistics do not fit into the master's memory fails when its plan of work is known, and
// says how much is needed.
TEST_F(ToyFarm, StatisticsThatDoNotFitAreRefused) {
  start_master_here({"--statistics-memory", "30K"});
  const std::string id = submit(whole);
  hand_worker();
  const v1::JobStatus status = farm.wait_for(id, v1::JOB_STATE_FAILED);
  EXPECT_NE(status.message().find("--statistics-memory"), std::string::npos) << status.message();
  EXPECT_EQ(status.iterations(), 0U);
}

// Claim: a job of which only its folder is left, without a store and without the blobs of its states, is
// taken in and extended to the same bytes.
TEST_F(ToyFarm, AFolderAloneGoesOn) {
  start_master();
  Process& worker = farm.start_worker("a");
  const std::uint64_t first = whole / 2;
  const std::string id = submit(first);
  check(id, first);
  std::vector<std::string> states;
  for (const v1::Event& event : farm.events(id))
    if (event.kind() == "decided") states.push_back(event.message().substr(event.message().size() - 64));
  farm.forget_worker(worker);
  farm.kill_master();
  const auto data = farm.folder().path() / "data";
  for (const char* file : {"master.sqlite", "master.sqlite-wal", "master.sqlite-shm"})
    std::filesystem::remove(data / file);
  std::vector<std::filesystem::path> blobs;
  for (const auto& e : std::filesystem::recursive_directory_iterator(data / "blobs"))
    for (const std::string& sha256 : states)
      if (e.path().filename().string().find(sha256) != std::string::npos) blobs.push_back(e.path());
  EXPECT_FALSE(blobs.empty());
  for (const auto& blob : blobs) std::filesystem::remove(blob);
  farm.restart_master();
  farm.repair(id);
  farm.start_worker("b");  // its cache is empty
  farm.extend(id, whole - first);
  check(id, whole);
}

// Claim: a worker that sleeps past its lease and wakes delivers nothing twice.
TEST_F(ToyFarm, AZombieChangesNothing) {
  start_master();
  Process& zombie = farm.start_worker("zombie");
  const std::string id = submit(whole, 4000);
  farm.wait_for_iterations(id, whole / 4);
  zombie.signal(SIGSTOP);
  farm.start_worker("b");
  farm.wait_for_iterations(id, whole * 3 / 4);
  zombie.signal(SIGCONT);
  check(id, whole);
}

// Claim: a job that is extended, amid an epoch and by a master that was restarted since, is the job that
// asked for all of it at once.
TEST_F(ToyFarm, ExtensionsContinue) {
  start_master();
  farm.start_worker("a");
  farm.start_worker("b");
  const std::string id = submit(whole / 3);
  check(id, whole / 3);
  farm.extend(id, 7);
  check(id, whole / 3 + 7);
  farm.kill_master();
  farm.restart_master();
  farm.extend(id, whole - whole / 3 - 7);
  check(id, whole);
}

// Claim: a replayed delta is a duplicate, one of a lease that is over is stale, and one whose accumulator is
// of another epoch is refused; none of them changes a byte.
TEST_F(ToyFarm, ReplaysChangeNothing) {
  start_master_here();
  const std::string id = submit(whole);
  const auto worker = hand_worker();
  test::HandWorker& hand = *worker;
  std::optional<v1::Lease> lease;
  for (int i = 0; i < 3; ++i) {
    lease = hand.acquire_soon();
    ASSERT_TRUE(lease);
    const std::string bytes = delta_of(hand, *lease);
    EXPECT_EQ(hand.push(hand.header(*lease, bytes), bytes).verdict(), v1::DELTA_VERDICT_MERGED);
    EXPECT_EQ(hand.push(hand.header(*lease, bytes), bytes).verdict(), v1::DELTA_VERDICT_DUPLICATE);
  }
  lease = hand.acquire_soon();
  ASSERT_TRUE(lease);
  const std::string wrong = delta_of(hand, *lease, 1);
  EXPECT_EQ(hand.push(hand.header(*lease, wrong), wrong).verdict(), v1::DELTA_VERDICT_CORRUPT);
  const std::string late = delta_of(hand, *lease);
  work(hand, id);
  check(id, whole);
  const auto verdict = hand.push(hand.header(*lease, late), late).verdict();
  EXPECT_TRUE(verdict == v1::DELTA_VERDICT_DUPLICATE || verdict == v1::DELTA_VERDICT_STALE ||
              verdict == v1::DELTA_VERDICT_JOB_ENDED)
      << verdict;
  check(id, whole);
}

}  // namespace
}  // namespace candela::farm
