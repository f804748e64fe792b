// The master's treatment of deltas that come twice, late, broken, or from strangers, and with pushes that
// hang. All are sent by a worker in the test's hands to a master of this process; honest workers then finish
// the job, and the image must be what it always is.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <thread>

#include "common/base/hash.h"
#include "common/base/version.h"
#include "tests/farm/farm.h"
#include "tests/farm/hand_worker.h"

namespace candela::farm {
namespace {

class Deltas : public testing::Test {
 protected:
  void start(const std::vector<std::string>& options = {"--unit-time", "0.05"}) {
    farm_.start_master_here(options);
    id_ = farm_.submit(kJobIterations);
  }
  HandWorker hand(const std::string& name) {
    HandWorker worker(farm_.address(), name);
    worker.scene_file_for_pilots = scene_;
    return worker;
  }
  void finish() {
    farm_.start_worker_here("honest", 2);
    farm_.wait_for(id_, v1::JOB_STATE_DONE);
    expect_identical(farm_.fetch(id_), farm_.render(kJobIterations), "after everything");
    farm_.audit(id_, kJobIterations);
  }
  // One bad push, its verdict, then an honest delivery by the same worker, so that no unit fails time and
  // again.
  void refuse(const std::string& name, v1::DeltaVerdict verdict, const std::function<void(Push&)>& spoil) {
    SCOPED_TRACE(name);
    HandWorker worker = hand(name);
    Push push = worker.delta_for(worker.acquire(), scene_);
    const std::uint64_t before = farm_.job(id_).iterations();
    spoil(push);
    const v1::PushDeltaResponse response = worker.push(push);
    EXPECT_EQ(response.verdict(), verdict)
        << v1::DeltaVerdict_Name(response.verdict()) << ": " << response.message();
    EXPECT_FALSE(response.message().empty()) << "a refusal says why";
    EXPECT_EQ(farm_.job(id_).iterations(), before) << "a refused delta was counted";
    const v1::PushDeltaResponse honest = worker.push(worker.delta_for(worker.acquire(), scene_));
    EXPECT_EQ(honest.verdict(), v1::DELTA_VERDICT_MERGED) << honest.message();
  }
  // A push whose bytes were changed on the way before the hash was taken: only the delta's own checks can
  // tell.
  static void rehash(Push& push) {
    push.header.set_size_bytes(push.bytes.size());
    push.header.set_sha256(sha256_hex(push.bytes));
  }

  Farm farm_;
  std::string id_;
  const std::string scene_ = scene_path("cornell");
};

// Claim: a delta delivered twice is counted once, be it by the same worker at once or after other units.
TEST_F(Deltas, DeliveredTwice) {
  start();
  HandWorker worker = hand("twice");
  const Push first = worker.delta_for(worker.acquire(), scene_);
  EXPECT_EQ(worker.push(first).verdict(), v1::DELTA_VERDICT_MERGED);
  const std::uint64_t before = farm_.job(id_).iterations();
  EXPECT_EQ(worker.push(first).verdict(), v1::DELTA_VERDICT_DUPLICATE);
  EXPECT_EQ(farm_.job(id_).iterations(), before);
  EXPECT_EQ(worker.push(worker.delta_for(worker.acquire(), scene_)).verdict(), v1::DELTA_VERDICT_MERGED);
  EXPECT_EQ(worker.push(first).verdict(), v1::DELTA_VERDICT_DUPLICATE);
  // And by a worker that never had the unit.
  HandWorker thief = hand("thief");
  Push stolen = first;
  Push own = thief.delta_for(thief.acquire(), scene_);
  stolen.header.set_worker_id(own.header.worker_id());
  stolen.header.set_session(own.header.session());
  EXPECT_THAT(thief.push(stolen).verdict(),
              testing::AnyOf(v1::DELTA_VERDICT_DUPLICATE, v1::DELTA_VERDICT_STALE));
  EXPECT_EQ(thief.push(own).verdict(), v1::DELTA_VERDICT_MERGED);
  finish();
}

// Claim: truncated and corrupted deltas are refused, whether transport or sender spoilt them.
TEST_F(Deltas, TruncatedAndCorrupted) {
  start();
  refuse("truncated on the way", v1::DELTA_VERDICT_CORRUPT,
         [](Push& push) { push.bytes.resize(push.bytes.size() / 2); });
  refuse("truncated by the sender", v1::DELTA_VERDICT_CORRUPT, [](Push& push) {
    push.bytes.resize(push.bytes.size() - 1);
    rehash(push);
  });
  refuse("empty", v1::DELTA_VERDICT_CORRUPT, [](Push& push) {
    push.bytes.clear();
    rehash(push);
  });
  refuse("longer than it says", v1::DELTA_VERDICT_CORRUPT, [](Push& push) { push.bytes += "more"; });
  refuse("a bit turned on the way", v1::DELTA_VERDICT_CORRUPT,
         [](Push& push) { push.bytes[push.bytes.size() / 3] ^= 0x10; });
  for (const double place : {0.0, 0.1, 0.5, 0.999})
    refuse("a bit turned by the sender", v1::DELTA_VERDICT_CORRUPT, [place](Push& push) {
      push.bytes[static_cast<std::size_t>(place * static_cast<double>(push.bytes.size()))] ^= 0x01;
      rehash(push);
    });
  finish();
}

// Claim: a delta of another build is refused, and so is the registration of a worker of another build or
// protocol.
TEST_F(Deltas, OfAnotherBuild) {
  start();
  refuse("another build in the header", v1::DELTA_VERDICT_WRONG_BUILD,
         [](Push& push) { push.header.set_build_id("0.0.1-0123456789abcdef"); });
  EXPECT_EQ(HandWorker::try_register(farm_.address(), kProtocol, "0.0.1-0123456789abcdef").error_code(),
            grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(HandWorker::try_register(farm_.address(), kProtocol + 1, std::string(build_id())).error_code(),
            grpc::StatusCode::FAILED_PRECONDITION);
  finish();
}

// Claim: a delta that belongs to another unit than its lease is refused.
TEST_F(Deltas, OfAnotherUnit) {
  // Leases that nobody serves stay behind here: they shall not last long.
  start({"--unit-time", "0.05", "--lease-time", "3"});
  refuse("another unit inside than outside", v1::DELTA_VERDICT_CORRUPT, [this](Push& push) {
    HandWorker other = hand("other");
    push.bytes = other.delta_for(other.acquire(), scene_).bytes;
    rehash(push);
  });
  HandWorker worker = hand("foreign token");
  Push push = worker.delta_for(worker.acquire(), scene_);
  push.header.set_token(push.header.token() + 1000000);
  const v1::PushDeltaResponse response = worker.push(push);
  EXPECT_EQ(response.verdict(), v1::DELTA_VERDICT_STALE) << v1::DeltaVerdict_Name(response.verdict());
  finish();
}

// Claim: after a lease has expired and its unit was done by another, the first owner is told and its delta
// dropped.
TEST_F(Deltas, AfterTheLeaseExpired) {
  start({"--unit-time", "0.05", "--lease-time", "0.5"});
  HandWorker late = hand("late");
  const v1::Lease lease = late.acquire();
  const Push push = late.delta_for(lease, scene_);
  ASSERT_TRUE(eventually(20, [&] { return farm_.job(id_).units_leased() == 0; }));
  EXPECT_TRUE(late.revoked(lease)) << "a heartbeat after the expiry does not say so";
  farm_.start_worker_here("other");
  farm_.wait_for(id_, v1::JOB_STATE_DONE);
  v1::PushDeltaResponse response;
  const grpc::Status status = late.push_status(push, response);
  if (status.ok())
    EXPECT_THAT(response.verdict(), testing::AnyOf(v1::DELTA_VERDICT_STALE, v1::DELTA_VERDICT_DUPLICATE,
                                                   v1::DELTA_VERDICT_JOB_ENDED))
        << v1::DeltaVerdict_Name(response.verdict());
  else
    EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAUTHENTICATED) << status.error_message();
  finish();
}

// Claim: workers that hang in the midst of a push delay neither the preview nor the merges of others.
TEST_F(Deltas, HungPushesDelayNobody) {
  constexpr int hung_count = 12;
  constexpr std::uint64_t iterations = 601;
  // A few seconds are a hundred times what a healthy merge or preview takes; a lock held by a hung push would
  // last for ever here.
  constexpr double bound_seconds = 5;
  farm_.start_master({"--unit-time", "0.1", "--lease-time", "2"});
  id_ = farm_.submit(iterations);
  std::vector<std::unique_ptr<HandWorker>> workers;
  std::vector<std::unique_ptr<HungPush>> hung;
  for (int i = 0; i < hung_count; ++i) {
    workers.push_back(std::make_unique<HandWorker>(farm_.address(), "hung-" + std::to_string(i)));
    workers.back()->scene_file_for_pilots = scene_;
    const Push push = workers.back()->delta_for(workers.back()->acquire(), scene_);
    hung.push_back(std::make_unique<HungPush>(*workers.back(), push));
  }
  for (const char* name : {"a", "b"}) farm_.start_worker(name);
  farm_.wait_for_iterations(id_, 1);
  double longest_fetch = 0, longest_without_merge = 0;
  std::uint64_t last = 0;
  Stopwatch since_merge, all;
  int fetches = 0;
  for (;;) {
    const v1::JobStatus status = farm_.job(id_);
    if (status.iterations() != last) {
      longest_without_merge = std::max(longest_without_merge, since_merge.seconds());
      since_merge = Stopwatch();
      last = status.iterations();
    }
    if (status.state() == v1::JOB_STATE_DONE) break;
    ASSERT_EQ(status.state(), v1::JOB_STATE_RUNNING) << status.message();
    ASSERT_LT(since_merge.seconds(), bound_seconds) << "no merge while " << hung_count << " pushes hang";
    ASSERT_LT(all.seconds(), kPatienceSeconds);
    const Stopwatch clock;
    farm_.fetch(id_);
    longest_fetch = std::max(longest_fetch, clock.seconds());
    ++fetches;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  RecordProperty("longest_fetch_ms", static_cast<int>(longest_fetch * 1000));
  RecordProperty("longest_without_merge_ms", static_cast<int>(longest_without_merge * 1000));
  EXPECT_LT(longest_fetch, bound_seconds);
  EXPECT_GT(fetches, 0);
  hung.clear();
  expect_identical(farm_.fetch(id_), farm_.render(iterations), "beside hung pushes");
  farm_.audit(id_, iterations);
}

}  // namespace
}  // namespace candela::farm
