// Jobs that are removed some time after they ended, and scene files that no job needs.
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <thread>

#include "master/store/store.h"
#include "tests/unit/master_fixture.h"

namespace candela::master {
namespace {

namespace fs = std::filesystem;

class MasterRemoval : public MasterTest {
 protected:
  static bool eventually(const std::function<bool()>& holds) {
    for (int i = 0; i < 1000; ++i) {
      if (holds()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return false;
  }
  static void sleep(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }
  void restart_with(double keep_finished, double blob_grace = 3600) {
    keep_finished_seconds = keep_finished;
    blob_grace_seconds = blob_grace;
    restart();
  }
  bool knows(const std::string& id) {
    v1::GetJobRequest request;
    request.set_job_id(id);
    v1::JobStatus status;
    grpc::ClientContext context;
    return farm->GetJob(&context, request, &status).ok();
  }
  fs::path blob(const std::string& bytes) const {
    const std::string hash = sha256_hex(bytes);
    return folder.path() / "blobs" / hash.substr(0, 2) / hash;
  }
  std::string submit_scene(const std::string& scene, std::uint64_t iterations) {
    JobSettings settings;
    settings.width = kWidth;
    settings.height = kHeight;
    return test::submit(*farm, scene, test::submission(scene, settings, iterations));
  }
  void render(const std::string& id) {
    TestWorker worker(channel);
    ASSERT_TRUE(worker.enrol().ok());
    ASSERT_TRUE(eventually([&] {
      worker.step();
      return show(id).state() == v1::JOB_STATE_DONE;
    }));
  }
  bool told(const std::string& id, const std::string& kind) {
    v1::ListEventsRequest request;
    request.set_limit(10000);
    v1::ListEventsResponse response;
    grpc::ClientContext context;
    EXPECT_TRUE(farm->ListEvents(&context, request, &response).ok());
    return std::any_of(response.events().begin(), response.events().end(),
                       [&](const v1::Event& e) { return e.kind() == kind && e.job_id() == id; });
  }
  grpc::Status steer(grpc::Status (v1::FarmService::Stub::*call)(grpc::ClientContext*, const v1::JobRequest&,
                                                                 v1::JobStatus*),
                     const std::string& id) {
    v1::JobRequest request;
    request.set_job_id(id);
    v1::JobStatus status;
    grpc::ClientContext context;
    return (farm.get()->*call)(&context, request, &status);
  }
  // As if the clock had been so far behind when the job ended. Precondition: the master is stopped.
  void age(const std::string& id, double seconds) {
    auto store = open_sqlite_store(folder.path() / "master.sqlite");
    ASSERT_TRUE(store.ok());
    auto state = (*store)->load();
    ASSERT_TRUE(state.ok());
    for (JobRow& row : state->jobs)
      if (row.id == id) {
        row.finished_unix_ms -= static_cast<std::int64_t>(seconds * 1000);
        ASSERT_TRUE((*store)->write(std::vector<Change>{PutJob{row}}).ok());
      }
  }
  void stop() {
    farm.reset();
    channel.reset();
    master.reset();
  }
  const std::string other_scene = "<scene version='3.0.0'><!-- another --></scene>";
};

// Claim: finished jobs go, with their folder and the scene file that they alone needed, and an event says so.
// Jobs that run or are paused stay for ever, and end as if nothing had been removed. A restart changes
// nothing; the idempotency token of a removed job is free again.
TEST_F(MasterRemoval, FinishedJobsGoOthersStay) {
  const std::string done = submit_scene(other_scene, 4);
  render(done);
  const std::string paused = submit(5), running = submit(6);
  ASSERT_TRUE(steer(&v1::FarmService::Stub::PauseJob, paused).ok());
  v1::SubmitRequest with_token = submission(7);
  with_token.set_idempotency_token("t");
  const std::string cancelled = test::submit(*farm, kScene, with_token);
  ASSERT_TRUE(steer(&v1::FarmService::Stub::CancelJob, cancelled).ok());
  ASSERT_TRUE(fs::exists(folder.path() / "jobs" / done));
  restart_with(1.0, 0.3);
  ASSERT_TRUE(eventually([&] { return !knows(done) && !knows(cancelled); }));
  EXPECT_TRUE(eventually([&] { return told(done, "removed"); }));
  EXPECT_TRUE(told("", "keep-finished"));
  EXPECT_TRUE(eventually([&] { return !fs::exists(folder.path() / "removed" / done); }));
  EXPECT_FALSE(fs::exists(folder.path() / "jobs" / done));
  EXPECT_TRUE(eventually([&] { return !fs::exists(blob(other_scene)); }));
  EXPECT_TRUE(fs::exists(blob(kScene)));
  EXPECT_EQ(steer(&v1::FarmService::Stub::CancelJob, done).error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_NE(test::submit(*farm, kScene, with_token), cancelled);
  restart();
  EXPECT_FALSE(knows(done));
  EXPECT_FALSE(told("", "orphans"));
  EXPECT_EQ(show(paused).state(), v1::JOB_STATE_PAUSED);
  restart_with(0);
  TestWorker worker(channel);
  ASSERT_TRUE(worker.enrol().ok());
  ASSERT_TRUE(eventually([&] {
    worker.step();
    return show(running).state() == v1::JOB_STATE_DONE;
  }));
  audit(running, 6);
}

// Claim: a clock that jumps does not wipe the list. Jobs that are suddenly old stay for the time of grace, an
// event announces their removal, and they stay for good when the clock is right again; so do jobs that ended
// "in the future".
TEST_F(MasterRemoval, AClockThatJumpsRemovesNothingAtOnce) {
  const std::string old = submit(4), future = submit(5);
  for (const std::string& id : {old, future}) ASSERT_TRUE(steer(&v1::FarmService::Stub::CancelJob, id).ok());
  stop();
  age(old, 1e6);
  age(future, -1e6);
  keep_finished_seconds = 10;  // grace: 1 s
  start();
  ASSERT_TRUE(eventually([&] { return told("", "keep-finished"); }));
  EXPECT_TRUE(knows(old));
  stop();
  age(old, -1e6);
  start();
  sleep(1.5);
  EXPECT_TRUE(knows(old));
  EXPECT_TRUE(knows(future));
  EXPECT_FALSE(told(old, "removed"));
}

// Claim: the wait of an old job goes on where a restart broke it off, so that a master which is restarted
// more often than the wait removes jobs, too. A job that a right clock makes young waits from the beginning.
TEST_F(MasterRemoval, RestartsDoNotBeginTheWaitAnew) {
  const auto waited = [&](const std::string& id) {
    auto store = open_sqlite_store(folder.path() / "master.sqlite");
    if (!store.ok()) {
      ADD_FAILURE() << store.error().to_string();
      return 0.0;
    }
    const auto rows = (*store)->overdue();
    if (!rows.ok()) {
      ADD_FAILURE() << rows.error().to_string();
      return 0.0;
    }
    for (const OverdueRow& row : *rows)
      if (row.job_id == id) return row.waited_seconds;
    return 0.0;
  };
  std::string old, young;
  double before = 0;
  // Starts the master until the wait of `old` has grown. True if the job is removed.
  const auto run = [&] {
    start();
    bool gone = false;
    EXPECT_TRUE(eventually([&] {
      const double now = waited(old);
      gone = !knows(old);  // asked last: a job without a row may be removed
      EXPECT_TRUE(gone || now >= before) << "the wait begins anew: " << now << " s after " << before << " s";
      return gone || now > before;
    }));
    stop();
    before = waited(old);
    return gone;
  };
  // One run is the whole wait if the machine stands still for two seconds: other jobs are tried then.
  for (int tries = 0; before == 0 && tries < 5; ++tries) {
    if (tries > 0) start();
    old = submit(4);
    young = submit(5);
    for (const std::string& id : {old, young}) ASSERT_TRUE(steer(&v1::FarmService::Stub::CancelJob, id).ok());
    stop();
    age(old, 1e6);
    age(young, 1e6);
    keep_finished_seconds = 20;  // a wait of 2 s, in rounds of 0.5 s
    run();
  }
  ASSERT_GT(before, 0) << "no wait outlives a run";
  EXPECT_GT(waited(young), 0);
  age(young, -1e6);
  int runs = 1;
  for (bool gone = false; !gone && runs < 50; ++runs) gone = run();
  EXPECT_LT(runs, 50);
  EXPECT_EQ(waited(old), 0);
  EXPECT_EQ(waited(young), 0);
  start();
  EXPECT_TRUE(knows(young));
}

// Claim: a job that is dropped leaves no row of its wait, which a start after a crash would take for a job
// that was extended.
TEST(MasterRemovalStore, DroppedJobsDoNotWait) {
  const test::TemporaryFolder folder;
  auto store = open_sqlite_store(folder.path() / "s.sqlite");
  ASSERT_TRUE(store.ok());
  JobRow gone, kept;
  gone.id = "gone";
  kept.id = "kept";
  ASSERT_TRUE(
      (*store)
          ->write(std::vector<Change>{PutJob{gone}, PutJob{kept},
                                      PutOverdue{{{"gone", 1, 2.0}, {"kept", 1, 3.0}}}, DropJob{"gone"}})
          .ok());
  const auto rows = (*store)->overdue();
  ASSERT_TRUE(rows.ok());
  ASSERT_EQ(rows->size(), 1U);
  EXPECT_EQ(rows->front().job_id, "kept");
}

// Claim: a removal that a crash broke off after its decision is finished by the next start.
TEST_F(MasterRemoval, ABrokenOffRemovalIsFinished) {
  const std::string id = submit(4), other = submit(3);
  render(id);
  stop();
  fs::create_directories(folder.path() / "removed");
  fs::rename(folder.path() / "jobs" / id, folder.path() / "removed" / id);
  start();
  EXPECT_FALSE(knows(id));
  EXPECT_TRUE(knows(other));
  EXPECT_FALSE(fs::exists(folder.path() / "removed" / id));
}

// Claim: a scene file that was uploaded, or asked for, a moment ago is not collected before its job can name
// it; one that nobody came back for is. While a folder belongs to no job of the store nothing is collected.
TEST_F(MasterRemoval, BlobsInFlightStay) {
  stop();
  const auto ask = [&] {
    v1::FindMissingBlobsRequest request;
    request.add_sha256(sha256_hex(other_scene));
    v1::FindMissingBlobsResponse response;
    grpc::ClientContext context;
    EXPECT_TRUE(farm->FindMissingBlobs(&context, request, &response).ok());
    return response.sha256_size() == 0;
  };
  fs::create_directories(folder.path() / "jobs" / "jorphan");
  blob_grace_seconds = 0.5;
  start();
  ASSERT_TRUE(upload(other_scene, sha256_hex(other_scene), other_scene.size()).ok());
  sleep(1.5);
  EXPECT_TRUE(fs::exists(blob(other_scene))) << "collected beside an orphan";
  stop();
  fs::remove(folder.path() / "jobs" / "jorphan");
  blob_grace_seconds = 30;
  start();
  EXPECT_TRUE(ask()) << "collected at the start";
  restart_with(0, 0.5);
  EXPECT_TRUE(eventually([&] { return !fs::exists(blob(other_scene)); }));
}

// Claim: 5,000 jobs are listed in pages, each once, the newest first, also while jobs come; states are
// filtered; a token that is none is refused. Start and pages are quick (figures in
// docs/lab/five-thousand-jobs.md).
TEST_F(MasterRemoval, FiveThousandJobs) {
  constexpr int kJobs = 5000;
  const std::string first = submit(3);
  stop();
  {
    auto store = open_sqlite_store(folder.path() / "master.sqlite");
    ASSERT_TRUE(store.ok());
    auto state = (*store)->load();
    ASSERT_TRUE(state.ok() && state->jobs.size() == 1);
    std::vector<Change> changes;
    for (int i = 1; i < kJobs; ++i) {
      JobRow row = state->jobs[0];
      row.id = fmt::format("jmade{:05}", i);
      row.name = fmt::format("shot {}", i);
      row.submitted_unix_ms -= 10 + i / 3;  // some in one millisecond
      row.state = i % 100 == 0 ? JobState::paused : JobState::done;
      row.finished_unix_ms = row.submitted_unix_ms + 1000;
      changes.emplace_back(PutJob{row});
    }
    ASSERT_TRUE((*store)->write(changes).ok());
  }
  using Clock = std::chrono::steady_clock;
  const auto seconds = [](Clock::time_point since) {
    return std::chrono::duration<double>(Clock::now() - since).count();
  };
  const auto begin = Clock::now();
  start();
  const double start_seconds = seconds(begin);
  const auto page = [&](v1::ListJobsRequest request, v1::ListJobsResponse& out) {
    grpc::ClientContext context;
    return farm->ListJobs(&context, request, &out);
  };
  v1::ListJobsRequest request;
  request.set_page_size(300);
  std::set<std::string> seen;
  std::int64_t last = INT64_MAX;
  double slowest = 0;
  for (int pages = 0;; ++pages) {
    ASSERT_LT(pages, 20);
    v1::ListJobsResponse out;
    const auto asked = Clock::now();
    ASSERT_TRUE(page(request, out).ok());
    slowest = std::max(slowest, seconds(asked));
    EXPECT_LE(out.jobs_size(), 300);
    EXPECT_EQ(out.total(), static_cast<std::uint64_t>(kJobs + std::min(pages, 1)));
    for (const v1::JobStatus& job : out.jobs()) {
      EXPECT_TRUE(seen.insert(job.id()).second) << job.id();
      EXPECT_LE(job.submitted_unix_ms(), last);
      last = job.submitted_unix_ms();
    }
    if (pages == 0) submit(2);  // it is newer than every later page
    if (out.next_page_token().empty()) break;
    request.set_page_token(out.next_page_token());
  }
  EXPECT_EQ(seen.size(), static_cast<std::size_t>(kJobs));
  std::printf("start %.3f s, slowest page of 300 %.4f s\n", start_seconds, slowest);
  v1::ListJobsRequest paused;
  paused.add_states(v1::JOB_STATE_PAUSED);
  v1::ListJobsResponse out;
  ASSERT_TRUE(page(paused, out).ok());
  EXPECT_EQ(out.jobs_size(), (kJobs - 1) / 100);
  EXPECT_EQ(out.total(), static_cast<std::uint64_t>((kJobs - 1) / 100));
  for (const v1::JobStatus& job : out.jobs()) EXPECT_EQ(job.state(), v1::JOB_STATE_PAUSED);
  EXPECT_TRUE(out.next_page_token().empty());
  for (const char* token : {"x", "-", "12", "-3-j", "12-", "99999999999999999999-j"}) {
    request.set_page_token(token);
    EXPECT_EQ(page(request, out).error_code(), grpc::StatusCode::INVALID_ARGUMENT) << token;
  }
  paused.add_states(static_cast<v1::JobState>(77));
  EXPECT_EQ(page(paused, out).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

// Claim: a job's priority is set over the wire and survives a restart; unknown and ended jobs and values out
// of range are refused.
TEST_F(MasterRemoval, PriorityOverTheWire) {
  const std::string id = submit(4);
  const auto set = [&](const std::string& job, std::int32_t priority) {
    v1::SetPriorityRequest request;
    request.set_job_id(job);
    request.set_priority(priority);
    v1::JobStatus status;
    grpc::ClientContext context;
    const grpc::Status answer = farm->SetPriority(&context, request, &status);
    if (answer.ok()) {
      EXPECT_EQ(status.priority(), priority);
    }
    return answer.error_code();
  };
  EXPECT_EQ(set(id, -7), grpc::StatusCode::OK);
  EXPECT_EQ(set(id, -7), grpc::StatusCode::OK);
  restart();
  EXPECT_EQ(show(id).priority(), -7);
  EXPECT_EQ(set(id, 1000001), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(set("jno", 1), grpc::StatusCode::NOT_FOUND);
  ASSERT_TRUE(steer(&v1::FarmService::Stub::CancelJob, id).ok());
  EXPECT_EQ(set(id, 1), grpc::StatusCode::FAILED_PRECONDITION);
}

}  // namespace
}  // namespace candela::master
