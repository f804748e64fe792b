// Calls that a master refuses, and that no client keeps others out.
#include <gtest/gtest.h>

#include <list>
#include <string>

#include "common/job/stop_limits.h"
#include "master/api/peer_places.h"
#include "master/farm.h"
#include "tests/unit/master_fixture.h"
#include "tests/unit/scheduler_fixture.h"

namespace candela::master {
namespace {

using Places = std::list<PeerPlaces::Place>;

bool enter(PeerPlaces& places, const std::string& peer, Places& held, bool yields = true) {
  auto place = places.enter(peer, yields);
  if (!place.ok()) return false;
  held.push_back(std::move(*place));
  return true;
}

// Claim: one client has its part and no more, and the error names it, the limit and the mend; where all
// places are taken the client with the most gives its newest one to a client with fewer.
TEST(PeerPlaces, OneClientKeepsNobodyOut) {
  PeerPlaces places("watchers", 6, 4, "end some");
  Places greedy, second, third;
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(enter(places, "10.0.0.1", greedy));
  const auto refused = places.enter("10.0.0.1", true);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().kind, ErrorKind::resource);
  EXPECT_EQ(refused.error().to_string(),
            "this client (10.0.0.1) has 4 watchers, as many as one client may (end some)");
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(enter(places, "10.0.0.2", second));
  ASSERT_TRUE(enter(places, "10.0.0.3", third));
  EXPECT_TRUE(greedy.back().revoked());
  EXPECT_FALSE(greedy.front().revoked());
  EXPECT_FALSE(second.back().revoked());
  greedy.pop_back();  // it goes: its place was given away before
  ASSERT_TRUE(enter(places, "10.0.0.3", third));
  greedy.pop_back();
  const auto full = places.enter("10.0.0.3", true);
  ASSERT_FALSE(full.ok()) << "all have two";
  EXPECT_NE(full.error().to_string().find("there are 6 watchers"), std::string::npos)
      << full.error().to_string();
  second.clear();
  EXPECT_TRUE(enter(places, "10.0.0.4", second));
}

// Claim: places that cannot be given up stay, and calls of the same process have no part to keep to.
TEST(PeerPlaces, FixedPlacesStay) {
  PeerPlaces places("uploads", 3, 2, "wait");
  Places fixed, inner;
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(enter(places, "a", fixed, false));
  ASSERT_TRUE(enter(places, PeerPlaces::kThisProcess, inner, false));
  EXPECT_FALSE(places.enter("b").ok());
  fixed.clear();
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(enter(places, PeerPlaces::kThisProcess, inner, false));
}

class IdleWorkerTest : public SchedulerFixture {
 public:
  // For a new job, as the worker "honest" gets it after the pilot.
  Lease first_unit() {
    s->submit(row("j", 1000), now());
    const auto pilot = lease("honest");
    EXPECT_TRUE(pilot);
    PilotResult result{NamedState{17}, "", 0.01, {}};
    EXPECT_TRUE(s->complete_pilot("honest", pilot->row.token, result, now()));
    const auto unit = lease("honest");
    EXPECT_TRUE(unit);
    return *unit;
  }
  std::uint64_t iterations_of(const Lease& l) { return unit_of(l).end - unit_of(l).begin; }
};

// A farm of one worker.
class OneWorker : public IdleWorkerTest {
 public:
  OneWorker() { worker("honest"); }
  void TestBody() override {}
};

// Claim: workers that only say that they live are nobody to wait for: units are not cut for them, more
// threads are not wanted for want of them, and a job that they cannot save ends.
TEST_F(IdleWorkerTest, WorkersThatOnlyHeartbeatCountForNothing) {
  worker("honest");
  for (int i = 0; i < 100; ++i) worker("fake" + std::to_string(i));
  const auto beat = [&](double t) {
    at(t);
    for (int i = 0; i < 100; ++i) {
      const std::string id = "fake" + std::to_string(i);
      ASSERT_NE(s->authenticate(id, "session-" + id, now()), nullptr);
      s->heartbeat(id, {}, now());
    }
  };
  for (double t = 101; t < 125; t += 2) beat(t);
  const Lease unit = first_unit();
  OneWorker alone;
  EXPECT_EQ(iterations_of(unit), alone.iterations_of(alone.first_unit()))
      << "cut for workers that take nothing";
  // The one worker that renders fails: nobody else is to try first.
  s->fail_unit("honest", unit.row.token, FailureCause::scene, "no such texture", now());
  for (double t = clock + 1; t < 200 && s->job("j")->row.state != JobState::failed; t += 1) {
    beat(t);
    if (const auto again = lease("honest"))
      s->fail_unit("honest", again->row.token, FailureCause::scene, "no such texture", now());
    s->tick(now());
  }
  EXPECT_EQ(s->job("j")->row.state, JobState::failed) << s->message_of(*s->job("j"), now());
}

// Claim: limits of a job that no clock or estimate reaches are refused, as are sums of them.
TEST_F(IdleWorkerTest, ExtensionsHaveBounds) {
  s->submit(row("j", 8), now());
  EXPECT_FALSE(s->extend("j", 0, 1e308, 0, now()).ok());
  EXPECT_FALSE(s->extend("j", 0, 0, 1e308, now()).ok());
  EXPECT_TRUE(s->extend("j", 0, kMaxStopSeconds, 0, now()).ok());
  const auto more = s->extend("j", 0, 1, 0, now());
  ASSERT_FALSE(more.ok());
  EXPECT_EQ(more.error().field, "add_time_seconds");
}

class MasterLimitsTest : public MasterTest {
 protected:
  std::string submit_of(std::uint32_t width, std::uint32_t height, grpc::Status& status) {
    JobSettings settings;
    settings.width = width;
    settings.height = height;
    EXPECT_TRUE(upload(kScene, sha256_hex(kScene), kScene.size()).ok());
    v1::SubmitResponse response;
    grpc::ClientContext context;
    status = farm->Submit(&context, test::submission(kScene, settings, 4), &response);
    return response.job_id();
  }
  grpc::Status extend(const std::string& id, const std::string& token, v1::JobStatus& out) {
    v1::ExtendJobRequest request;
    request.set_job_id(id);
    request.set_add_iterations(5);
    request.set_idempotency_token(token);
    grpc::ClientContext context;
    return farm->ExtendJob(&context, request, &out);
  }
};

// Claim: a job whose film alone can never fit is refused when it is submitted, with figures; one whose plan
// asks for too much fails after its pilot with figures, and its bootstrap takes no memory.
TEST_F(MasterLimitsTest, WhatNeverFitsIsRefused) {
  memory_bytes = 500'000'000;
  restart();
  grpc::Status status;
  submit_of(4000, 4000, status);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  for (const char* word : {"4000 x 4000", "MB for its film", "500 MB for jobs", "--memory"})
    EXPECT_NE(status.error_message().find(word), std::string::npos) << status.error_message();
  const std::string id = submit_of(1000, 1000, status);
  ASSERT_TRUE(status.ok()) << status.error_message();
  TestWorker worker(channel);
  ASSERT_TRUE(worker.enrol().ok());
  const auto lease = worker.acquire();
  ASSERT_TRUE(lease);
  v1::CompletePilotRequest request;
  worker.sign(request, *lease);
  request.mutable_named_state()->set_film_scale_log2(20);
  request.mutable_work()->add_layers("chains.large");
  request.mutable_work()->mutable_chains()->set_chains(1 << 20);
  request.mutable_work()->mutable_chains()->set_bootstrap_samples(1 << 26);
  request.mutable_work()->mutable_chains()->set_segment_mutations(10);
  EXPECT_FALSE(worker.complete(request)) << worker.status.error_message();
  const v1::JobStatus job = show(id);
  EXPECT_EQ(job.state(), v1::JOB_STATE_FAILED) << job.message();
  EXPECT_NE(job.message().find("for chains"), std::string::npos) << job.message();
}

// Claim: a pilot's scale that no film can have is refused, and the job is not harmed by it.
TEST_F(MasterLimitsTest, ScalesBeyondBoundsAreRefused) {
  const std::string id = submit(2);
  TestWorker worker(channel);
  ASSERT_TRUE(worker.enrol().ok());
  const auto lease = worker.acquire();
  ASSERT_TRUE(lease);
  for (const int scale : {201, 500, -201, 1000}) {
    v1::CompletePilotRequest request;
    worker.sign(request, *lease);
    request.mutable_named_state()->set_film_scale_log2(scale);
    EXPECT_FALSE(worker.complete(request));
    EXPECT_EQ(worker.status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << scale;
  }
  EXPECT_TRUE(worker.pilot(*lease));
  while (worker.step()) {
  }
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
}

// Claim: an extension that is asked for twice with one token is made once.
TEST_F(MasterLimitsTest, OneTokenExtendsOnce) {
  const std::string id = submit(2);
  v1::JobStatus status;
  ASSERT_TRUE(extend(id, "t1", status).ok());
  ASSERT_TRUE(extend(id, "t1", status).ok());
  EXPECT_EQ(status.stop().iterations(), 7U);
  ASSERT_TRUE(extend(id, "t2", status).ok());
  EXPECT_EQ(status.stop().iterations(), 12U);
  ASSERT_TRUE(extend(id, "", status).ok());
  ASSERT_TRUE(extend(id, "", status).ok());
  EXPECT_EQ(status.stop().iterations(), 22U);
  EXPECT_EQ(extend(id, std::string(300, 'x'), status).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

}  // namespace
}  // namespace candela::master
