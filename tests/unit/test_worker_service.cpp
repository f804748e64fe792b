// The worker service against a scripted master, with a scripted renderer: the normal flow, and each thing
// that goes wrong.
#include <gtest/gtest.h>

#include <filesystem>

#include "common/base/version.h"
#include "tests/unit/worker_service_fixture.h"

namespace candela::worker {
namespace {

namespace fs = std::filesystem;
using grpc::Status;
using grpc::StatusCode;

// Claim: the whole line works: registration says who and what, the pilot's result arrives, every unit's delta
// arrives whole, decodes to what was rendered, and the scene is compiled once; drained at the end, the worker
// says goodbye.
TEST_F(WorkerServiceTest, NormalFlow) {
  const std::uint64_t pilot = master_.add_lease(0, 0, true);
  std::vector<std::uint64_t> tokens;
  for (std::uint64_t i = 0; i < 5; ++i) tokens.push_back(master_.add_lease(2 * i, 2 * i + 2));
  start();
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 5 && master_.leases.empty(); }));
  worker_->drain();
  EXPECT_TRUE(worker_->wait().ok());

  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.registered.protocol(), kProtocol);
  EXPECT_EQ(master_.registered.build_id(), build_id());
  EXPECT_EQ(master_.registered.name(), "tester");
  EXPECT_EQ(master_.registered.threads(), 1U);
  EXPECT_EQ(master_.registered.isas_size(), 2);
  EXPECT_GT(master_.registered.memory_bytes(), 0U);
  ASSERT_EQ(master_.pilots.size(), 1U);
  EXPECT_EQ(master_.pilots[0].token(), pilot);
  EXPECT_EQ(master_.pilots[0].named_state().film_scale_log2(), 12);
  EXPECT_EQ(master_.pilots[0].plan(), "a plan");
  EXPECT_EQ(master_.pilots[0].seconds_per_iteration(), 0.25);
  EXPECT_EQ(master_.merged, tokens);
  EXPECT_EQ(master_.warm, std::vector<std::string>{master_.bundle_hash()});
  EXPECT_EQ(master_.deregistrations, 1);
  EXPECT_TRUE(master_.failures.empty());
  EXPECT_TRUE(master_.returned.empty());
  EXPECT_EQ(renderer_.created, 1);
  EXPECT_EQ(renderer_.files["scene.xml"], "the scene");
  EXPECT_EQ(renderer_.files["../textures/a.bin"], "the texture");
  EXPECT_FALSE(fs::exists(folder_.parent_path() / "textures")) << "keys are no paths";

  const film::Layout layout{40, 8, 1};
  film::MergedFilm merged(layout, 12);
  for (const auto& [token, bytes] : master_.deltas) {
    const v1::DeltaHeader& header = master_.headers[token];
    EXPECT_EQ(header.size_bytes(), bytes.size());
    EXPECT_EQ(header.sha256(), sha256_hex(bytes));
    EXPECT_EQ(header.build_id(), build_id());
    EXPECT_EQ(header.job_id(), "job1");
    const auto delta = film::Delta::decode(bytes, layout);
    ASSERT_TRUE(delta.ok()) << delta.error().to_string();
    EXPECT_EQ(delta->info().job_id, "job1");
    EXPECT_EQ(delta->info().unit.begin, header.unit().begin());
    EXPECT_TRUE(merged.merge(*delta).ok());
  }
  EXPECT_EQ(merged.iterations(), 10U);
  EXPECT_EQ(merged.sample_counts(0).eye_samples, 10U * 40 * 8);
  // x and y are integers, exact at any scale: films that were not cleared between units would show here.
  EXPECT_EQ(merged.develop(0, film::MergedFilm::Which::half0)[(3 * 40 + 17) * 3], 17.0F);
  EXPECT_EQ(merged.develop(0, film::MergedFilm::Which::half0)[(3 * 40 + 17) * 3 + 1], 3.0F);
}

// Claim: where the renderer has layers, the pilot says their names, and deltas hold the layers.
TEST_F(WorkerServiceTest, LayersGoWithPilotAndDeltas) {
  renderer_.layers = {"s2.t3", "s3.t2"};
  master_.add_lease(0, 0, true);
  const std::uint64_t token = master_.add_lease(0, 4);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 1 && master_.pilots.size() == 1; }));
  const std::lock_guard lock(master_.mutex);
  const auto& said = master_.pilots[0].work().layers();
  EXPECT_EQ(std::vector<std::string>(said.begin(), said.end()), renderer_.layers);
  const film::Layout layout{40, 8, 3};
  const auto delta = film::Delta::decode(master_.deltas[token], layout);
  ASSERT_TRUE(delta.ok()) << delta.error().to_string();
  EXPECT_EQ(delta->sample_counts().light_paths, 2U * 4 * 40 * 8);
  film::MergedFilm merged(layout, 12);
  ASSERT_TRUE(merged.merge(*delta).ok());
  for (std::uint32_t layer = 0; layer < 3; ++layer)
    EXPECT_EQ(merged.develop(layer)[(3 * 40 + 17) * 3], 17.0F * static_cast<float>(std::max(layer, 1U)));
}

// Claim: what a job sums beside its film goes with the pilot's plan and with each delta, exact and cleared
// between units; states that a lease names reach the renderer as bytes, fetched once.
TEST_F(WorkerServiceTest, AccumulatorsAndStatesGoWithUnits) {
  renderer_.accumulators = {{"moments", 2, 4, film::AccumulatorSpec::Per::job}};
  const std::string radius(5000, 'r');
  master_.add_lease(0, 0, true);
  std::vector<std::uint64_t> tokens;
  for (const std::uint64_t begin : {0, 3}) {
    tokens.push_back(master_.add_lease(begin, begin + 3));
    master_.add_state("radius", radius);
  }
  start();
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 2 && master_.pilots.size() == 1; }));
  const std::lock_guard lock(master_.mutex);
  const auto plan = wire::from_proto(master_.pilots[0].work());
  ASSERT_TRUE(plan.ok()) << plan.error().to_string();
  EXPECT_EQ(plan->accumulators, renderer_.accumulators);
  film::MergedAccumulator sums(40, 8, plan->accumulators[0]);
  for (const std::uint64_t token : tokens) {
    const auto delta =
        film::Delta::decode(master_.deltas[token], {film::Layout{40, 8, 1}, plan->accumulators});
    ASSERT_TRUE(delta.ok()) << delta.error().to_string();
    sums.merge(delta->accumulators().at(0).sums);
  }
  EXPECT_TRUE(sums.sum(17, 3, 0) == 6 * 16);
  EXPECT_TRUE(sums.sum(17, 3, 1) == 6 * 16 * 17);
  {
    const std::lock_guard renderer_lock(renderer_.mutex);
    EXPECT_EQ(renderer_.states, (std::map<std::string, std::string>{{"radius", radius}}));
  }
  EXPECT_EQ(master_.blob_fetches, 3) << "scene, texture, and the state once";
}

// Claim: a state that is not named by a hash, or that the master lacks, fails its unit by the right cause,
// and nothing is delivered.
TEST_F(WorkerServiceTest, StatesThatCannotBeHadFailTheUnit) {
  for (const std::uint64_t begin : {0, 1}) {
    master_.add_lease(begin, begin + 1);
    const std::lock_guard lock(master_.mutex);
    v1::DecidedState& state = *master_.leases.back().add_states();
    state.set_name("radius");
    state.set_sha256(begin == 0 ? "../../etc/passwd" : std::string(64, '0'));
    state.set_size_bytes(5);
  }
  start();
  ASSERT_TRUE(master_.wait_for([&] { return master_.failures.size() == 2; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.failures[0].cause(), v1::FAILURE_CAUSE_WORKER);
  EXPECT_EQ(master_.failures[1].cause(), v1::FAILURE_CAUSE_MASTER);
  for (const auto& failure : master_.failures)
    EXPECT_NE(failure.message().find("radius"), std::string::npos) << failure.message();
  EXPECT_EQ(merged_count(), 0U);
}

// Claim: a unit of bootstrap samples needs no named state, and its delta is a table with its counts.
TEST_F(WorkerServiceTest, TablesGoAsDeltas) {
  const std::uint64_t token = master_.add_lease(40, 50);
  {
    const std::lock_guard lock(master_.mutex);
    master_.leases.back().clear_named_state();
    master_.leases.back().mutable_unit()->set_kind(v1::Unit::KIND_BOOTSTRAP);
  }
  start();
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
  const std::lock_guard lock(master_.mutex);
  const auto delta = film::Delta::decode(master_.deltas[token], film::Layout{40, 8, 1});
  ASSERT_TRUE(delta.ok()) << delta.error().to_string();
  EXPECT_EQ(delta->info().unit.begin, 40U);
  ASSERT_EQ(delta->table().size(), 10U);
  EXPECT_EQ(delta->table()[3], 43.0F);
  EXPECT_EQ(delta->sample_counts().rejected[0], 1U);
}

// Claim: a master of another protocol or build ends the worker with the master's own words, and is not asked
// twice.
TEST_F(WorkerServiceTest, RefusedRegistrationEndsTheWorker) {
  master_.register_script.push_back(wire::to_status(refused_error("the build differs")));
  start();
  const auto end = worker_->wait();
  ASSERT_FALSE(end.ok());
  EXPECT_NE(end.error().message.find("the build differs"), std::string::npos);
  EXPECT_EQ(end.error().exit_code(), 1);
  EXPECT_EQ(master_.registrations, 1);
}

// Claim: a master that is not there yet is asked again until it is.
TEST_F(WorkerServiceTest, RegistrationIsRetried) {
  for (int i = 0; i < 4; ++i) master_.register_script.push_back(Status(StatusCode::UNAVAILABLE, "starting"));
  master_.add_lease(0, 1);
  start();
  EXPECT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
  EXPECT_EQ(master_.registrations, 5);
}

// Claim: with give_up_seconds a worker ends as unreachable (exit 3), not before that time.
TEST_F(WorkerServiceTest, GivesUp) {
  for (int i = 0; i < 1000; ++i) master_.register_script.push_back(Status(StatusCode::UNAVAILABLE, "gone"));
  options_.give_up_seconds = 0.3;
  const auto begin = std::chrono::steady_clock::now();
  start();
  const auto end = worker_->wait();
  ASSERT_FALSE(end.ok());
  EXPECT_EQ(end.error().exit_code(), 3);
  EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(300));
}

// Claim: a revoked unit is stopped in the middle, not delivered, not reported; the worker goes on with the
// next.
TEST_F(WorkerServiceTest, RevokedLeaseIsStopped) {
  renderer_.close_gate(0.5F);
  const std::uint64_t first = master_.add_lease(0, 1), second = master_.add_lease(1, 2);
  start();
  ASSERT_TRUE(wait_until_rendering());
  ASSERT_TRUE(
      master_.wait_for([&] { return master_.fractions.contains(first) && master_.fractions[first] == 0.5; }));
  {
    const std::lock_guard lock(master_.mutex);
    master_.revoked.insert(first);
  }
  ASSERT_TRUE(master_.wait_for(
      [&] { return !master_.fractions.contains(first) && master_.fractions.contains(second); }));
  renderer_.open_gate();
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.merged, std::vector<std::uint64_t>{second});
  EXPECT_TRUE(master_.returned.empty());
  EXPECT_TRUE(master_.failures.empty());
}

// Claim: the next lease is asked for, as a prefetch, while a unit is rendered; and only one.
TEST_F(WorkerServiceTest, PrefetchesOneLease) {
  renderer_.close_gate(0);
  for (std::uint64_t i = 0; i < 4; ++i) master_.add_lease(i, i + 1);
  start();
  ASSERT_TRUE(wait_until_rendering());
  ASSERT_TRUE(master_.wait_for([&] { return master_.fractions.size() == 2; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(60));
  {
    const std::lock_guard lock(master_.mutex);
    EXPECT_TRUE(master_.saw_prefetch);
    EXPECT_EQ(master_.leases.size(), 2U);
  }
  renderer_.open_gate();
  EXPECT_TRUE(master_.wait_for([&] { return merged_count() == 4; }));
}

// Claim: any verdict is final: the delta is not sent again and the unit not reported as failed.
TEST_F(WorkerServiceTest, VerdictsAreFinal) {
  master_.verdicts = {v1::DELTA_VERDICT_STALE, v1::DELTA_VERDICT_DUPLICATE, v1::DELTA_VERDICT_JOB_ENDED,
                      v1::DELTA_VERDICT_CORRUPT};
  for (std::uint64_t i = 0; i < 5; ++i) master_.add_lease(i, i + 1);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.pushes, 5);
  EXPECT_TRUE(master_.failures.empty());
}

// Claim: a full merge queue and a master that is away delay a delta, and no more: the same bytes come again
// until they are taken, and the wait that the master names is kept.
TEST_F(WorkerServiceTest, PushIsRetried) {
  master_.push_script = {wire::to_status_with_retry(resource_error("the merge queue is full"), 150),
                         Status(StatusCode::UNAVAILABLE, "restarting"),
                         Status(StatusCode::UNAVAILABLE, "restarting"),
                         Status(StatusCode::UNKNOWN, "stream broken")};
  const std::uint64_t token = master_.add_lease(0, 3);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return master_.pushes == 1; }));
  const auto first = std::chrono::steady_clock::now();
  ASSERT_TRUE(master_.wait_for([&] { return master_.pushes == 2; }));
  EXPECT_GE(std::chrono::steady_clock::now() - first, std::chrono::milliseconds(100));
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.pushes, 5);
  EXPECT_EQ(master_.headers[token].sha256(), sha256_hex(master_.deltas[token]));
  EXPECT_TRUE(master_.failures.empty());
}

// Claim: a delta for which the master has no place lets the next one pass, which may have a place: of a more
// urgent job, say.
TEST_F(WorkerServiceTest, AFullQueueLetsOthersPass) {
  master_.push_script = {wire::to_status_with_retry(resource_error("the merge queue is full"), 400)};
  const std::uint64_t first = master_.add_lease(0, 3), second = master_.add_lease(3, 6);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 2; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.merged, (std::vector<std::uint64_t>{second, first}));
  EXPECT_EQ(master_.headers[first].sha256(), sha256_hex(master_.deltas[first]));
}

// Claim: a worker whose deltas all wait for the merge queue takes a unit of an urgent job, delivers it before
// them, and takes no other; when there is a place again all are merged, each once.
TEST_F(WorkerServiceTest, AFullWorkerTakesAnUrgentUnit) {
  const std::uint64_t first = master_.add_lease(0, 3), second = master_.add_lease(3, 6);
  master_.no_place = {first, second};
  start();
  ASSERT_TRUE(master_.wait_for([&] { return master_.saw_full; }));
  std::uint64_t urgent = 0, later = 0;
  {
    const std::lock_guard lock(master_.mutex);
    urgent = master_.add_lease_unlocked(6, 9);
    later = master_.add_lease_unlocked(9, 12);
    master_.urgent = {urgent};
  }
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  {
    const std::lock_guard lock(master_.mutex);
    EXPECT_EQ(master_.merged, std::vector<std::uint64_t>{urgent});
    EXPECT_EQ(master_.leases.size(), 1U) << "a full worker has another unit that is not urgent";
    master_.no_place.clear();
  }
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 4; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(std::set<std::uint64_t>(master_.merged.begin(), master_.merged.end()),
            (std::set<std::uint64_t>{first, second, urgent, later}));
  EXPECT_TRUE(master_.returned.empty());
}

// Claim: of a delta that the master has no place for, no byte but the header's goes over the network, however
// slowly the master says so: a thousand workers that wait would fill it.
TEST_F(WorkerServiceTest, RefusedDeltasSendNoBytes) {
  MasterLink link(master_.channel());
  v1::RegisterRequest request;
  v1::RegisterResponse registered;
  ASSERT_TRUE(link.unary(MasterLink::Lane::registration, &v1::WorkerService::Stub::Register, request,
                         registered, Milliseconds(5000))
                  .ok());
  v1::DeltaHeader header;
  header.set_session(registered.session());
  header.set_token(7);
  const std::string bytes(1 << 20, 'x');
  const auto push = [&] {
    v1::PushDeltaResponse response;
    std::atomic<std::uint64_t> steps{0};
    const Status status = link.push_delta(header, bytes, 4096, response, steps);
    return std::pair(status.error_code(), steps.load());
  };
  EXPECT_EQ(push(), std::pair(StatusCode::OK, std::uint64_t{256}));
  {
    const std::lock_guard lock(master_.mutex);
    master_.no_place = {7};
    master_.refuse_after_ms = 50;
  }
  EXPECT_EQ(push(), std::pair(StatusCode::RESOURCE_EXHAUSTED, std::uint64_t{0}));
}

// Claim: a delta that the master will never take (a malformed request by its reckoning) fails the unit
// instead of being sent for ever.
TEST_F(WorkerServiceTest, PushThatCannotSucceedFailsTheUnit) {
  master_.push_script = {wire::to_status(input_error("too large"))};
  const std::uint64_t token = master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return master_.failures.size() == 1; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.failures[0].token(), token);
  EXPECT_EQ(master_.failures[0].cause(), v1::FAILURE_CAUSE_WORKER);
  EXPECT_NE(master_.failures[0].message().find("too large"), std::string::npos);
}

// Claim: while one unit's push waits, the next unit is rendered (and no third: films are bounded).
TEST_F(WorkerServiceTest, RendersWhileAPushWaits) {
  for (int i = 0; i < 1000; ++i) master_.push_script.push_back(Status(StatusCode::UNAVAILABLE, "away"));
  for (std::uint64_t i = 0; i < 5; ++i) master_.add_lease(i, i + 1);
  start();
  ASSERT_TRUE(master_.wait_for([&] {
    int finished = 0;
    for (const auto& [token, fraction] : master_.fractions) finished += fraction == 1;
    return finished == 2;
  }));
  std::this_thread::sleep_for(std::chrono::milliseconds(60));
  {
    const std::lock_guard lock(master_.mutex);
    EXPECT_LE(master_.fractions.size(), 3U);
    EXPECT_GE(master_.leases.size(), 2U);
    master_.push_script.clear();
  }
  EXPECT_TRUE(master_.wait_for([&] { return merged_count() == 5; }));
}

// Claim: a session that the master does not know is given up with all its leases and deltas, and another is
// opened.
TEST_F(WorkerServiceTest, UnauthenticatedMeansRegisterAgain) {
  renderer_.close_gate(0.2F);
  const std::uint64_t lost = master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(wait_until_rendering());
  {
    const std::lock_guard lock(master_.mutex);
    master_.forget_session();
  }
  ASSERT_TRUE(master_.wait_for([&] { return master_.registrations == 2; }));
  renderer_.open_gate();
  const std::uint64_t kept = master_.add_lease(1, 2);
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.merged, std::vector<std::uint64_t>{kept});
  EXPECT_FALSE(master_.deltas.contains(lost));
  EXPECT_TRUE(master_.failures.empty());
}

// Claim: the same holds where the push is what learns of it: the delta is not sent under the new session.
TEST_F(WorkerServiceTest, UnauthenticatedPushDropsTheDelta) {
  master_.push_script = {Status(StatusCode::UNAUTHENTICATED, "register again")};
  master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return master_.registrations == 2; }));
  const std::uint64_t kept = master_.add_lease(1, 2);
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
  EXPECT_EQ(master_.merged, std::vector<std::uint64_t>{kept});
}

// Claim: a drain (SIGTERM) hands back the unit that is far from its end and the one that waits, at once, and
// says goodbye.
TEST_F(WorkerServiceTest, DrainHandsBack) {
  renderer_.close_gate(0);
  const std::uint64_t first = master_.add_lease(0, 1), second = master_.add_lease(1, 2);
  start();
  ASSERT_TRUE(wait_until_rendering());
  ASSERT_TRUE(master_.wait_for([&] { return master_.fractions.size() == 2; }));
  const auto begin = std::chrono::steady_clock::now();
  worker_->drain();
  worker_->drain();  // idempotent
  EXPECT_TRUE(worker_->wait().ok());
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(1000));
  const std::lock_guard lock(master_.mutex);
  std::vector<std::uint64_t> returned = master_.returned;
  std::sort(returned.begin(), returned.end());
  EXPECT_EQ(returned, (std::vector<std::uint64_t>{first, second}));
  EXPECT_EQ(master_.deregistrations, 1);
  EXPECT_TRUE(master_.merged.empty());
}

// Claim: a unit close to its end is finished and delivered before the worker leaves.
TEST_F(WorkerServiceTest, DrainFinishesAnAlmostFinishedUnit) {
  renderer_.close_gate(0.999F);
  const std::uint64_t token = master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(wait_until_rendering());
  worker_->drain();
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  renderer_.open_gate();
  EXPECT_TRUE(worker_->wait().ok());
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.merged, std::vector<std::uint64_t>{token});
  EXPECT_TRUE(master_.returned.empty());
  EXPECT_EQ(master_.deregistrations, 1);
}

// Claim: a unit that promised to end soon and does not is handed back after all: a drain is bounded.
TEST_F(WorkerServiceTest, DrainDoesNotBelieveForEver) {
  renderer_.close_gate(0.999F);
  const std::uint64_t token = master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(wait_until_rendering());
  worker_->drain();
  EXPECT_TRUE(worker_->wait().ok());
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.returned, std::vector<std::uint64_t>{token});
}

// Claim: drain ends in bounded time where the master has gone, with a delta still undelivered.
TEST_F(WorkerServiceTest, DrainIsBoundedWithoutAMaster) {
  for (int i = 0; i < 10000; ++i) master_.push_script.push_back(Status(StatusCode::UNAVAILABLE, "away"));
  master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return master_.pushes >= 1; }));
  const auto begin = std::chrono::steady_clock::now();
  worker_->drain();
  EXPECT_TRUE(worker_->wait().ok());
  EXPECT_LT(std::chrono::steady_clock::now() - begin, tuning_.drain_limit + std::chrono::milliseconds(1500));
}

// Claim: drained by the master, the worker finishes what it renders, however long that takes, delivers it,
// and leaves.
TEST_F(WorkerServiceTest, MasterDrainFinishesTheUnit) {
  renderer_.close_gate(0);
  const std::uint64_t token = master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(wait_until_rendering());
  {
    const std::lock_guard lock(master_.mutex);
    master_.drain = true;
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  renderer_.open_gate();
  EXPECT_TRUE(worker_->wait().ok());
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.merged, std::vector<std::uint64_t>{token});
  EXPECT_EQ(master_.deregistrations, 1);
}

// Claim: heartbeats go on while a unit renders and while a push is stuck.
TEST_F(WorkerServiceTest, HeartbeatsNeverStop) {
  renderer_.close_gate(0);
  master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(wait_until_rendering());
  int before = 0;
  {
    const std::lock_guard lock(master_.mutex);
    before = master_.heartbeats;
  }
  EXPECT_TRUE(master_.wait_for([&] { return master_.heartbeats >= before + 5; }));
}

// Claim: a scene that cannot be used fails the unit by cause scene; the worker lives on.
TEST_F(WorkerServiceTest, SceneErrorsFailTheUnitAsInput) {
  renderer_.create_error = input_error("unknown plugin 'difuse'").at("scene.xml", 12);
  const std::uint64_t token = master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return master_.failures.size() == 1; }));
  {
    const std::lock_guard lock(master_.mutex);
    EXPECT_EQ(master_.failures[0].token(), token);
    EXPECT_EQ(master_.failures[0].cause(), v1::FAILURE_CAUSE_SCENE);
    EXPECT_EQ(master_.failures[0].message(), "scene.xml:12: unknown plugin 'difuse'");
  }
  {
    const std::lock_guard lock(renderer_.mutex);
    renderer_.create_error.reset();
  }
  master_.add_lease(1, 2);
  EXPECT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
}

// Claim: failures of this machine (errors, exceptions of the renderer) fail the unit by cause worker; the
// worker lives on.
TEST_F(WorkerServiceTest, RenderFailuresFailTheUnit) {
  renderer_.throw_bad_alloc = true;
  master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return master_.failures.size() == 1; }));
  {
    const std::lock_guard lock(renderer_.mutex);
    renderer_.throw_bad_alloc = false;
    renderer_.run_error = failed_error("a device is lost");
  }
  master_.add_lease(1, 2);
  ASSERT_TRUE(master_.wait_for([&] { return master_.failures.size() == 2; }));
  {
    const std::lock_guard lock(renderer_.mutex);
    renderer_.run_error.reset();
  }
  master_.add_lease(2, 3);
  EXPECT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_NE(master_.failures[0].message().find("out of memory"), std::string::npos);
  EXPECT_EQ(master_.failures[0].cause(), v1::FAILURE_CAUSE_WORKER);
  EXPECT_NE(master_.failures[1].message().find("a device is lost"), std::string::npos);
  EXPECT_EQ(master_.failures[1].cause(), v1::FAILURE_CAUSE_WORKER);
}

// Claim: a film whose sums wrapped is never delivered: the unit fails by the scene, as it would anywhere, and
// says why; the next film starts clean.
TEST_F(WorkerServiceTest, OverflowFailsTheUnit) {
  {
    const std::lock_guard lock(renderer_.mutex);
    renderer_.overflow = true;
  }
  master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return master_.failures.size() == 1; }));
  {
    const std::lock_guard lock(renderer_.mutex);
    renderer_.overflow = false;
  }
  master_.add_lease(1, 2);
  EXPECT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_NE(master_.failures[0].message().find("overflowed"), std::string::npos);
  EXPECT_EQ(master_.failures[0].cause(), v1::FAILURE_CAUSE_SCENE);
}

}  // namespace
}  // namespace candela::worker
