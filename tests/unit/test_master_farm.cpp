// The whole master in this process (master_fixture.h): submission, the cycle of units, bad deltas, restart,
// full disks.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <map>
#include <thread>

#include "common/image/image.h"
#include "master/farm.h"
#include "tests/unit/master_fixture.h"

namespace candela::master {
namespace {

namespace fs = std::filesystem;

// Claim: submit to done through two workers gives exactly the sums of the iterations, an image, and an
// agreeing ledger.
TEST_F(MasterTest, RendersAJobExactly) {
  TestWorker a(channel), b(channel);
  ASSERT_TRUE(a.enrol().ok());
  ASSERT_TRUE(b.enrol().ok());
  const std::string id = submit(9);
  for (int i = 0; i < 100 && show(id).iterations() < 9; ++i) (i % 2 == 0 ? a : b).step();
  const v1::JobStatus end = wait_end(id);
  EXPECT_EQ(end.state(), v1::JOB_STATE_DONE) << end.message();
  EXPECT_EQ(end.iterations(), 9U);
  EXPECT_EQ(end.checkpoint_iterations(), 9U);
  EXPECT_EQ(end.plan(), "the plan");
  EXPECT_GT(end.relmse_estimate(), 0);
  audit(id, 9);
  expect_same(checkpoint_of(id), expected_film(9));
  EXPECT_EQ(fetch(id).substr(0, 4), std::string("\x76\x2f\x31\x01", 4));  // OpenEXR's magic number
}

// Claim: the estimate of the error and the upper end of its interval are the same in the job's status and in
// its image, and survive a restart of the master.
TEST_F(MasterTest, TheErrorIsOneFigureEverywhere) {
  TestWorker a(channel);
  ASSERT_TRUE(a.enrol().ok());
  const std::string id = submit(40);
  for (int i = 0; i < 200 && show(id).iterations() < 40; ++i) a.step();
  const v1::JobStatus end = wait_end(id);
  EXPECT_GT(end.relmse_upper(), end.relmse_estimate());
  const auto picture = image::decode_exr(fetch(id));
  ASSERT_TRUE(picture.ok()) << picture.error().to_string();
  EXPECT_EQ(picture->metadata.at("candela:relmse_estimate"), fmt::format("{:.6g}", end.relmse_estimate()));
  EXPECT_EQ(picture->metadata.at("candela:relmse_upper"), fmt::format("{:.6g}", end.relmse_upper()));
  restart();
  EXPECT_EQ(show(id).relmse_estimate(), end.relmse_estimate());
  EXPECT_NEAR(show(id).relmse_upper() / end.relmse_upper(), 1, 1e-5);
}

// Claim: a repeated submission with one token is one job; with other content it is refused.
TEST_F(MasterTest, SubmissionIsIdempotent) {
  ASSERT_TRUE(upload(kScene, sha256_hex(kScene), kScene.size()).ok());
  v1::SubmitRequest r = submission(4);
  r.set_idempotency_token("once");
  const auto send = [&](v1::SubmitResponse& out) {
    grpc::ClientContext context;
    return farm->Submit(&context, r, &out);
  };
  v1::SubmitResponse first, second, third;
  ASSERT_TRUE(send(first).ok());
  EXPECT_FALSE(first.existed());
  restart();
  ASSERT_TRUE(send(second).ok());
  EXPECT_TRUE(second.existed());
  EXPECT_EQ(first.job_id(), second.job_id());
  r.mutable_stop()->set_iterations(5);
  EXPECT_EQ(send(third).error_code(), grpc::StatusCode::ALREADY_EXISTS);
}

// Claim: bad submissions and uploads each get one clear refusal, and nothing is stored.
TEST_F(MasterTest, RefusesBadInput) {
  const std::string hash = sha256_hex(kScene);
  EXPECT_EQ(upload(kScene + "x", hash, kScene.size() + 1).error_code(), grpc::StatusCode::DATA_LOSS);
  EXPECT_EQ(upload(kScene, hash, kScene.size() + 1).error_code(), grpc::StatusCode::DATA_LOSS);
  EXPECT_EQ(upload(kScene, "../../etc/passwd", 3).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  v1::FindMissingBlobsRequest missing;
  missing.add_sha256(hash);
  v1::FindMissingBlobsResponse found;
  grpc::ClientContext c0;
  ASSERT_TRUE(farm->FindMissingBlobs(&c0, missing, &found).ok());
  EXPECT_EQ(found.sha256_size(), 1);
  const auto code = [&](const v1::SubmitRequest& r) {
    grpc::ClientContext context;
    v1::SubmitResponse response;
    return farm->Submit(&context, r, &response).error_code();
  };
  EXPECT_EQ(code(submission(4)), grpc::StatusCode::FAILED_PRECONDITION) << "a blob is missing";
  ASSERT_TRUE(upload(kScene, hash, kScene.size()).ok());
  v1::SubmitRequest r = submission(4);
  r.mutable_settings()->set_width(0);
  EXPECT_EQ(code(r), grpc::StatusCode::INVALID_ARGUMENT);
  r = submission(0);
  EXPECT_EQ(code(r), grpc::StatusCode::INVALID_ARGUMENT) << "no stop rule";
  r = submission(4);
  r.set_share(std::nan(""));
  EXPECT_EQ(code(r), grpc::StatusCode::INVALID_ARGUMENT);
  v1::GetJobRequest get;
  get.set_job_id("nope");
  v1::JobStatus out;
  grpc::ClientContext c1;
  EXPECT_EQ(farm->GetJob(&c1, get, &out).error_code(), grpc::StatusCode::NOT_FOUND);
}

// Claim: other protocols and builds are refused at the door, unknown sessions everywhere.
TEST_F(MasterTest, RefusesStrangers) {
  TestWorker w(channel);
  EXPECT_EQ(w.enrol("another-build").error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(w.enrol(std::string(build_id()), 99).error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  w.session.set_worker_id("w");
  w.session.set_session("s");
  w.acquire();
  EXPECT_EQ(w.status.error_code(), grpc::StatusCode::UNAUTHENTICATED);
}

// Claim: truncated, altered, foreign and repeated deltas never reach the film; the sums stay exact to the
// last bit.
TEST_F(MasterTest, BadDeltasNeverMerge) {
  TestWorker bad(channel), good(channel);
  ASSERT_TRUE(bad.enrol().ok());
  ASSERT_TRUE(good.enrol().ok());
  const std::string id = submit(9);
  ASSERT_TRUE(good.step());  // the pilot
  const auto lease = [&](TestWorker& w) {
    const auto l = w.acquire_soon();
    EXPECT_TRUE(l);
    return l.value_or(v1::Lease());
  };
  const v1::Lease spare = lease(good);
  v1::Lease l = lease(bad);
  std::string bytes = TestWorker::render(l);
  v1::DeltaHeader h = bad.header(l, bytes);
  EXPECT_EQ(bad.push(h, bytes.substr(0, bytes.size() / 2)).verdict(), v1::DELTA_VERDICT_CORRUPT)
      << "truncated";
  EXPECT_EQ(bad.push(h, bytes).verdict(), v1::DELTA_VERDICT_STALE) << "the lease went with the failure";
  l = lease(bad);
  bytes = TestWorker::render(l);
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  EXPECT_EQ(bad.push(bad.header(l, bytes), bytes).verdict(), v1::DELTA_VERDICT_CORRUPT)
      << "altered, with the right hash";
  l = lease(good);
  bytes = TestWorker::render(l);
  h = good.header(l, bytes);
  h.set_build_id("another");
  EXPECT_EQ(good.push(h, bytes).verdict(), v1::DELTA_VERDICT_WRONG_BUILD);
  l = spare;
  v1::Lease other = l;
  other.mutable_unit()->set_half(1 - l.unit().half());
  bytes = TestWorker::render(other);
  EXPECT_EQ(good.push(good.header(l, bytes), bytes).verdict(), v1::DELTA_VERDICT_CORRUPT)
      << "another unit's film";
  EXPECT_EQ(show(id).iterations(), 0U);
  TestWorker last(channel);
  ASSERT_TRUE(last.enrol().ok());
  l = lease(last);
  EXPECT_EQ(last.deliver(l), v1::DELTA_VERDICT_MERGED);
  EXPECT_EQ(last.deliver(l), v1::DELTA_VERDICT_DUPLICATE);
  while (show(id).iterations() < 9) {
    const auto next = last.acquire_soon();
    ASSERT_TRUE(next);
    ASSERT_EQ(last.deliver(*next), v1::DELTA_VERDICT_MERGED);
  }
  std::map<v1::FailureCause, std::uint64_t> causes;
  const v1::JobStatus status = show(id);
  for (const auto& f : status.failures()) causes[f.cause()] = f.count();
  EXPECT_EQ(causes, (std::map<v1::FailureCause, std::uint64_t>{{v1::FAILURE_CAUSE_NETWORK, 1},
                                                               {v1::FAILURE_CAUSE_WORKER, 3}}));
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  audit(id, 9);
  expect_same(checkpoint_of(id), expected_film(9));
}

// Claim: a restarted master goes on with the job; a worker that survived delivers with its old lease; the
// newest checkpoint broken, the one before serves and only what is missing is done again.
TEST_F(MasterTest, RestartContinues) {
  TestWorker w(channel);
  ASSERT_TRUE(w.enrol().ok());
  constexpr std::uint64_t kIterations = 40;  // more than are delivered before the checkpoint is broken
  const std::string id = submit(kIterations);
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(w.step());
  const v1::Lease held = w.acquire().value();
  const std::uint64_t before = show(id).iterations();
  restart();
  EXPECT_EQ(show(id).iterations(), before);
  TestWorker survivor(channel);
  survivor.session = w.session;
  EXPECT_EQ(survivor.deliver(held), v1::DELTA_VERDICT_MERGED);
  ASSERT_LT(show(id).iterations(), kIterations);
  // One more generation, then break the newest.
  farm.reset();
  channel.reset();
  master.reset();
  fs::path newest;
  std::uint64_t best = 0;
  for (const auto& e : fs::directory_iterator(folder.path() / "jobs" / id)) {
    const std::string n = e.path().filename().string();
    if (!n.starts_with("film.")) continue;
    const std::uint64_t g = std::stoull(n.substr(5));
    if (g >= best) {
      best = g;
      newest = e.path();
    }
  }
  ASSERT_GE(best, 2U);
  fs::resize_file(newest, fs::file_size(newest) / 2);
  start();
  EXPECT_LE(show(id).iterations(), before);
  EXPECT_GT(show(id).iterations(), 0U);
  TestWorker again(channel);
  again.session = w.session;
  for (int i = 0; i < 100 && show(id).iterations() < kIterations; ++i) again.step();
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  audit(id, kIterations);
  expect_same(checkpoint_of(id), expected_film(kIterations));
}

// Claim: films left behind by a store that was lost or damaged are told of at the start; a sound store's are
// not.
TEST_F(MasterTest, TellsOfFilmsWithoutAJob) {
  const auto orphans = [&] {
    v1::ListEventsRequest request;
    request.set_limit(100);
    v1::ListEventsResponse events;
    grpc::ClientContext context;
    EXPECT_TRUE(farm->ListEvents(&context, request, &events).ok());
    return std::count_if(events.events().begin(), events.events().end(), [](const auto& e) {
      return e.kind() == "orphans" && e.message().find("jlost") != std::string::npos;
    });
  };
  restart();
  EXPECT_EQ(orphans(), 0);
  fs::create_directories(folder.path() / "jobs" / "jlost");
  restart();
  EXPECT_EQ(orphans(), 1);
}

// Claim: a cancelled job keeps its image, over a restart too; extended it becomes the job of all iterations,
// exactly.
TEST_F(MasterTest, CancelKeepsAndExtendContinues) {
  TestWorker w(channel);
  ASSERT_TRUE(w.enrol().ok());
  const std::string id = submit(8);
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(w.step());
  v1::JobRequest request;
  request.set_job_id(id);
  v1::JobStatus out;
  for (int i = 0; i < 2; ++i) {
    grpc::ClientContext context;
    ASSERT_TRUE(farm->CancelJob(&context, request, &out).ok());
    EXPECT_EQ(out.state(), v1::JOB_STATE_CANCELLED);
  }
  const std::string image = fetch(id);
  restart();
  EXPECT_EQ(fetch(id), image);
  v1::ExtendJobRequest more;
  more.set_job_id(id);
  more.set_add_iterations(8);
  grpc::ClientContext context;
  ASSERT_TRUE(farm->ExtendJob(&context, more, &out).ok());
  TestWorker again(channel);
  again.session = w.session;
  for (int i = 0; i < 100 && show(id).iterations() < 16; ++i) again.step();
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  audit(id, 16);
  expect_same(checkpoint_of(id), expected_film(16));
}

// Claim: a sender that hangs in the middle of a delta delays neither others' merges nor a preview.
TEST_F(MasterTest, AHungSenderDelaysNobody) {
  TestWorker hung(channel), w(channel);
  ASSERT_TRUE(hung.enrol().ok());
  ASSERT_TRUE(w.enrol().ok());
  const std::string id = submit(9);
  ASSERT_TRUE(w.step());
  const v1::Lease l = hung.acquire().value();
  const std::string bytes = TestWorker::render(l);
  grpc::ClientContext context;
  v1::PushDeltaResponse response;
  auto stream = hung.stub->PushDelta(&context, &response);
  v1::DeltaChunk chunk;
  *chunk.mutable_header() = hung.header(l, bytes);
  chunk.set_data(bytes.substr(0, 100));
  ASSERT_TRUE(stream->Write(chunk));
  const auto started = std::chrono::steady_clock::now();
  ASSERT_TRUE(w.step());
  EXPECT_FALSE(fetch(id).empty());
  EXPECT_LT(std::chrono::steady_clock::now() - started, std::chrono::seconds(5));
  context.TryCancel();
  stream->Finish();
}

// Claim: two masters cannot share a data folder; a listener beyond loopback needs TLS or a word.
TEST_F(MasterTest, RefusesToStartTwiceOrOpenly) {
  MasterOptions o;
  o.data_dir = folder.path();
  o.listen.clear();
  auto second = Master::start(o);
  ASSERT_FALSE(second.ok());
  EXPECT_EQ(second.error().exit_code(), 2);
  ASSERT_TRUE(std::filesystem::remove(folder.path() / "lock"));
  EXPECT_FALSE(Master::start(o).ok()) << "the file of the lock was removed, the master was not";
  test::TemporaryFolder other;
  o.data_dir = other.path();
  o.listen = "0.0.0.0:0";
  EXPECT_FALSE(Master::start(o).ok());
  o.listen = "127.0.0.1:0";
  auto first = Master::start(o);
  ASSERT_TRUE(first.ok());
  test::TemporaryFolder third;
  o.data_dir = third.path();
  o.listen = "127.0.0.1:" + std::to_string((*first)->port());
  EXPECT_FALSE(Master::start(o).ok()) << "the port is taken";
}

// Claim: while checkpoints cannot be written the job goes on, is not called done, says why, keeps the
// generation before, and is done as soon as the disk has room.
TEST(FarmDisk, AFullDiskDelaysTheEndOnly) {
  ASSERT_TRUE(log::initialise("test", "off", "text").ok());
  test::TemporaryFolder folder;
  std::atomic<bool> full{false};
  FarmOptions o;
  o.master.data_dir = folder.path();
  o.master.checkpoint_seconds = 0.02;
  o.master.image_on_checkpoint = false;
  o.film_writer = [&](const fs::path& path, std::string_view data) -> Result<void> {
    if (full) return resource_error("No space left on device").at(path.string(), 0);
    return write_file_atomically(path, data);
  };
  auto opened = Farm::open(o);
  ASSERT_TRUE(opened.ok());
  Farm& farm = **opened;
  JobRow row;
  row.settings.width = kWidth;
  row.settings.height = kHeight;
  row.stop.iterations = 6;
  row.bundle_sha256 = sha256_hex("b");
  const std::string id = farm.submit(row, "b")->job_id;
  farm.with_scheduler([&](Scheduler& s) {
    WorkerRow w;
    w.id = "a";
    w.session = "s";
    w.isas = {"avx2"};
    return s.register_worker(w, farm.now()).ok();
  });
  const auto step = [&] {
    struct Work {
      std::optional<Lease> lease;
      Unit unit;
    };
    const Work w = farm.with_scheduler([&](Scheduler& s) {
      Work out{s.acquire("a", {}, {}, farm.now()).lease, {}};
      if (out.lease) out.unit = s.job(id)->units.at(out.lease->row.unit_id).row.unit;
      return out;
    });
    if (!w.lease) return false;
    if (w.unit.kind == Unit::Kind::pilot)
      return farm.with_scheduler([&](Scheduler& s) {
        return s.complete_pilot("a", w.lease->row.token, {NamedState{20}, "", 1}, farm.now());
      });
    const std::string bytes = make_delta(w.unit, id, 20, std::string(build_id()));
    DeltaHeader h;
    h.worker_id = "a";
    h.token = w.lease->row.token;
    h.unit_id = w.lease->row.unit_id;
    h.job_id = id;
    h.unit = w.unit;
    h.build_id = build_id();
    h.size_bytes = bytes.size();
    h.sha256 = sha256_hex(bytes);
    EXPECT_FALSE(farm.deltas().admit(h));
    return farm.deltas().deliver(h, bytes, {}).verdict == DeltaVerdict::merged;
  };
  const auto until = [&](auto condition) {
    for (int i = 0; i < 500 && !condition(*farm.status(id)); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return condition(*farm.status(id));
  };
  ASSERT_TRUE(step());
  ASSERT_TRUE(step());
  ASSERT_TRUE(until([](const JobStatus& s) { return s.checkpoint_iterations() > 0; }));
  const std::uint64_t saved = farm.status(id)->row.checkpoint_generation;
  full = true;
  while (step()) {
  }
  ASSERT_TRUE(until([](const JobStatus& s) { return s.message.find("No space left") != std::string::npos; }));
  EXPECT_EQ(farm.status(id)->row.state, JobState::running);
  EXPECT_EQ(farm.status(id)->iterations(), 6U);
  EXPECT_EQ(farm.status(id)->row.checkpoint_generation, saved);
  EXPECT_TRUE(fs::exists(folder.path() / "jobs" / id / ("film." + std::to_string(saved) + ".ckpt")));
  EXPECT_FALSE(farm.trouble().empty());
  full = false;
  EXPECT_TRUE(until([](const JobStatus& s) { return s.row.state == JobState::done; }));
  EXPECT_EQ(farm.status(id)->checkpoint_iterations(), 6U);
}

// Claim: epochs grow over openings, and rows come back as they were written; a newer schema is refused.
TEST(SqliteStore, KeepsWhatItIsTold) {
  test::TemporaryFolder folder;
  const fs::path path = folder.path() / "s.sqlite";
  UnitRow unit;
  unit.id = 42;
  unit.job_id = "j";
  unit.unit = {Unit::Kind::iterations, 1, 5, 9};
  unit.state = UnitRow::State::leased;
  unit.failures = 2;
  JobRow job;
  job.id = "j";
  job.name = "it's; a \"name\"";
  job.settings.width = 3;
  job.settings.height = 4;
  job.settings.integrator_settings = {{"max_depth", "7"}};
  job.stop.relmse = 1e-3;
  job.sample_counts.rejected = {1, 2, 3, 4, 5};
  job.sample_counts.sampled_merges = 6;
  job.sample_counts.repeated_merges = 7;
  job.sample_counts.bounded_walks = 8;
  job.named_state = NamedState{-5};
  job.state = JobState::paused;
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE(store.ok());
    EXPECT_EQ(*(*store)->next_epoch(), 1U);
    StoreWriter writer(**store, [](const std::string& text) { ADD_FAILURE() << text; });
    LeaseRow lease{(1ULL << 32) + 5, 42, "j", "w", 1.5, true};
    writer.enqueue({PutJob{job}, PutUnit{unit}, PutLease{lease}, AddEvent{{7, "j", "w", "kind", "text"}}});
    ASSERT_TRUE(writer.flush().ok());
  }
  auto store = open_sqlite_store(path);
  ASSERT_TRUE(store.ok());
  EXPECT_EQ(*(*store)->next_epoch(), 2U);
  auto state = (*store)->load();
  ASSERT_TRUE(state.ok()) << state.error().to_string();
  ASSERT_EQ(state->jobs.size(), 1U);
  const JobRow& j = state->jobs[0];
  EXPECT_EQ(j.name, job.name);
  EXPECT_EQ(j.settings.integrator_settings, job.settings.integrator_settings);
  EXPECT_EQ(j.stop.relmse, 1e-3);
  EXPECT_EQ(j.sample_counts, job.sample_counts);
  EXPECT_EQ(j.named_state->film_scale_log2, -5);
  EXPECT_EQ(j.state, JobState::paused);
  EXPECT_TRUE(std::isnan(j.relmse));
  ASSERT_EQ(state->unmerged_units.size(), 1U);
  EXPECT_EQ(state->unmerged_units[0].unit.end, 9U);
  EXPECT_EQ(state->unmerged_units[0].failures, 2U);
  ASSERT_EQ(state->leases.size(), 1U);
  EXPECT_EQ(state->leases[0].token, (1ULL << 32) + 5);
  EXPECT_EQ(state->next_unit_id, 43U);
  EXPECT_EQ((*store)->events("j", 10)->size(), 1U);
  const std::vector<Change> drop{DropUnmergedUnits{"j"}};
  ASSERT_TRUE((*store)->write(drop).ok());
  EXPECT_TRUE((*store)->load()->unmerged_units.empty());
  EXPECT_TRUE((*store)->load()->leases.empty());
}

}  // namespace
}  // namespace candela::master
