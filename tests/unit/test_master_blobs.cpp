// Scene files that rot, or vanish, on the master's disk: noticed when they are read, never blamed on a
// worker, mended by submitting again, after which the jobs that waited go on by themselves.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "tests/unit/flip_a_bit.h"
#include "tests/unit/master_fixture.h"

namespace candela::master {
namespace {

namespace fs = std::filesystem;
using test::flip_a_bit;

class MasterBlobs : public MasterTest {
 protected:
  fs::path blob() const {
    const std::string hash = sha256_hex(kScene);
    return folder.path() / "blobs" / hash.substr(0, 2) / hash;
  }
  std::vector<std::string> missing() {
    v1::FindMissingBlobsRequest request;
    request.add_sha256(sha256_hex(kScene));
    v1::FindMissingBlobsResponse response;
    grpc::ClientContext context;
    EXPECT_TRUE(farm->FindMissingBlobs(&context, request, &response).ok());
    return {response.sha256().begin(), response.sha256().end()};
  }
  std::vector<std::string> events(const std::string& id, const std::string& kind) {
    v1::ListEventsRequest request;
    request.set_job_id(id);
    request.set_limit(1000);
    v1::ListEventsResponse response;
    grpc::ClientContext context;
    EXPECT_TRUE(farm->ListEvents(&context, request, &response).ok());
    std::vector<std::string> out;
    for (const auto& e : response.events())
      if (e.kind() == kind) out.push_back(e.message());
    return out;
  }
  v1::WorkerStatus status_of(const TestWorker& worker) {
    v1::ListWorkersResponse response;
    grpc::ClientContext context;
    EXPECT_TRUE(farm->ListWorkers(&context, v1::ListWorkersRequest(), &response).ok());
    for (const auto& w : response.workers())
      if (w.id() == worker.session.worker_id()) return w;
    return {};
  }
  // As a worker does that needs the scene for this lease: fetches it, and fails the unit if it cannot.
  bool fetch_scene(TestWorker& w, const v1::Lease& lease) {
    if (w.fetch_blob(sha256_hex(kScene), kScene.size()) == kScene && w.status.ok()) return true;
    EXPECT_EQ(w.status.error_code(), grpc::StatusCode::DATA_LOSS) << w.status.error_message();
    w.fail(lease, v1::FAILURE_CAUSE_MASTER, "cannot fetch the scene: " + w.status.error_message());
    return false;
  }
};

// Claim: see the top of the file. Bits flipped, the file cut, the file removed; found by one worker after
// another. The job waits, its message names the scene's file and the mend; nobody is set aside. The same
// submission with the same token uploads the file again, is the same job, and the job is done.
TEST_F(MasterBlobs, RotIsMendedBySubmittingAgain) {
  const std::vector<std::pair<std::string, std::function<void()>>> damages = {
      {"damaged", [&] { flip_a_bit(blob(), 3); }},
      {"damaged", [&] { fs::resize_file(blob(), 5); }},
      {"missing", [&] { fs::remove(blob()); }}};
  int serial = 0;
  for (const auto& [word, damage] : damages) {
    SCOPED_TRACE(word + std::to_string(serial));
    v1::SubmitRequest request = submission(5);
    request.set_idempotency_token("token" + std::to_string(serial++));
    const std::string id = test::submit(*farm, kScene, request);
    TestWorker warm(channel), a(channel), b(channel);
    for (TestWorker* w : {&warm, &a, &b}) ASSERT_TRUE(w->enrol().ok());
    ASSERT_TRUE(warm.step());  // the pilot: this worker has the scene
    damage();
    for (int i = 0; i < 4; ++i) {
      TestWorker& w = i % 2 == 0 ? a : b;
      const auto lease = w.acquire_soon();
      ASSERT_TRUE(lease);
      EXPECT_FALSE(fetch_scene(w, *lease));
    }
    EXPECT_EQ(missing(), std::vector<std::string>{sha256_hex(kScene)});
    const v1::JobStatus waits = show(id);
    EXPECT_EQ(waits.state(), v1::JOB_STATE_RUNNING) << waits.message();
    for (const std::string& part : {std::string("'scene.xml'"), word, std::string("submit the scene again")})
      EXPECT_NE(waits.message().find(part), std::string::npos) << waits.message();
    EXPECT_EQ(waits.waiting().cause(), v1::FAILURE_CAUSE_MASTER);
    EXPECT_EQ(events(id, "blob-" + word).size(), 1U) << "told once";
    for (const TestWorker* w : {&a, &b}) {
      EXPECT_EQ(status_of(*w).units_failed(), 0U);
      EXPECT_EQ(status_of(*w).state(), "idle");
    }
    ASSERT_TRUE(warm.step()) << "who has the scene goes on";

    EXPECT_EQ(test::submit(*farm, kScene, request), id);
    EXPECT_TRUE(missing().empty());
    EXPECT_EQ(events(id, "blob-restored").size(), 1U);
    EXPECT_EQ(show(id).message().find("submit the scene again"), std::string::npos) << show(id).message();
    auto lease = a.acquire();
    ASSERT_TRUE(lease) << "at once";
    ASSERT_TRUE(fetch_scene(a, *lease));
    ASSERT_EQ(a.deliver(*lease), v1::DELTA_VERDICT_MERGED);
    while (show(id).iterations() < 5) {
      lease = a.acquire_soon();
      ASSERT_TRUE(lease);
      ASSERT_EQ(a.deliver(*lease), v1::DELTA_VERDICT_MERGED);
    }
    EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
    expect_same(checkpoint_of(id), expected_film(5));
  }
}

// Claim: a worker that asks for another size of a blob than it has does not make a whole blob go away.
TEST_F(MasterBlobs, AWrongRequestDamagesNothing) {
  submit(4);
  TestWorker w(channel);
  ASSERT_TRUE(w.enrol().ok());
  w.fetch_blob(sha256_hex(kScene), 7);
  EXPECT_EQ(w.status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(w.fetch_blob(sha256_hex(kScene)), kScene);
  EXPECT_TRUE(w.status.ok());
  w.fetch_blob(sha256_hex("nothing of ours"));
  EXPECT_EQ(w.status.error_code(), grpc::StatusCode::DATA_LOSS);
}

// Claim: a blob of another length that nobody has read yet is noticed by the submission that needs it, which
// asks for an upload in place of blaming its sender; the upload replaces it.
TEST_F(MasterBlobs, SubmissionNoticesAShortBlob) {
  submit(4);
  fs::resize_file(blob(), 5);
  v1::SubmitRequest request = submission(4);
  const auto send = [&] {
    grpc::ClientContext context;
    v1::SubmitResponse response;
    return farm->Submit(&context, request, &response);
  };
  EXPECT_EQ(send().error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(missing().size(), 1U);
  ASSERT_TRUE(upload(kScene, sha256_hex(kScene), kScene.size()).ok());
  EXPECT_TRUE(send().ok());
  fs::resize_file(blob(), 5);
  ASSERT_TRUE(upload(kScene, sha256_hex(kScene), kScene.size()).ok()) << "without having been noticed";
  EXPECT_EQ(fs::file_size(blob()), kScene.size());
}

// Claim: a failed job is resumed over the wire, goes on from what is merged, over a restart of the master
// too, and ends with the sums of an undisturbed one; what cannot be resumed is refused.
TEST_F(MasterBlobs, AFailedJobIsResumed) {
  const auto resume = [&](const std::string& id, v1::JobStatus& out) {
    v1::JobRequest request;
    request.set_job_id(id);
    grpc::ClientContext context;
    return farm->ResumeJob(&context, request, &out);
  };
  TestWorker w(channel);
  ASSERT_TRUE(w.enrol().ok());
  // Units grow as they are measured to be quick: the first one leaves enough to fail.
  constexpr std::uint64_t kIterations = 40;
  const std::string id = submit(kIterations);
  while (show(id).iterations() == 0) ASSERT_TRUE(w.step());
  const std::uint64_t had = show(id).iterations();
  ASSERT_LT(had, kIterations);
  w.fail(*w.acquire_soon(), v1::FAILURE_CAUSE_SCENE, "no such file");
  EXPECT_EQ(show(id).state(), v1::JOB_STATE_FAILED);
  restart();
  v1::JobStatus out;
  ASSERT_TRUE(resume(id, out).ok());
  EXPECT_EQ(out.state(), v1::JOB_STATE_QUEUED);
  EXPECT_TRUE(out.message().empty() || out.message().find("no such file") == std::string::npos);
  EXPECT_EQ(out.iterations(), had);
  TestWorker again(channel);
  ASSERT_TRUE(again.enrol().ok());
  while (show(id).iterations() < kIterations) {
    const auto lease = again.acquire_soon();
    ASSERT_TRUE(lease);
    ASSERT_EQ(again.deliver(*lease), v1::DELTA_VERDICT_MERGED);
  }
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  audit(id, kIterations);
  expect_same(checkpoint_of(id), expected_film(kIterations));
  EXPECT_EQ(resume(id, out).error_code(), grpc::StatusCode::FAILED_PRECONDITION) << "it is done";
  EXPECT_EQ(resume("nothing", out).error_code(), grpc::StatusCode::NOT_FOUND);
}

}  // namespace
}  // namespace candela::master
