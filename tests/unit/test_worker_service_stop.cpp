// Units that are stopped, cut short, or do not stop.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/unit/worker_service_fixture.h"

namespace candela::worker {
namespace {

class WorkerServiceStop : public WorkerServiceTest {
 protected:
  // Blocks of one iteration, of which the first goes through the closed gate.
  void close_gate_behind_the_first(float progress) {
    tuning_.block = Milliseconds(0);
    renderer_.close_gate(progress);
    renderer_.permits = 1;
  }
  [[nodiscard]] bool wait_for_runs(std::size_t count) {
    std::unique_lock lock(renderer_.mutex);
    return renderer_.changed.wait_for(lock, std::chrono::seconds(5),
                                      [&] { return renderer_.runs.size() >= count; });
  }
  std::vector<Unit> runs() {
    const std::lock_guard lock(renderer_.mutex);
    return renderer_.runs;
  }
};

// Claim: a unit is rendered in blocks of iterations that the lease's expectation makes a second long;
// together they are the unit, and one delta brings them.
TEST_F(WorkerServiceStop, UnitsAreRenderedInBlocks) {
  const std::uint64_t token = master_.add_lease(10, 30, false, 4);  // 0.2 s an iteration
  start();
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
  const std::vector<Unit> blocks = runs();
  ASSERT_GE(blocks.size(), 2U);
  EXPECT_EQ(blocks.front().begin, 10U);
  EXPECT_EQ(blocks.front().end, 12U);
  for (std::size_t i = 1; i < blocks.size(); ++i) EXPECT_EQ(blocks[i].begin, blocks[i - 1].end);
  EXPECT_EQ(blocks.back().end, 30U);
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.headers[token].unit().begin(), 10U);
  EXPECT_EQ(master_.headers[token].unit().end(), 30U);
}

// Claim: a unit that the master wants cut short ends after the block under way; its delta names the
// iterations that it has, and is theirs. A lease behind it goes back untouched.
TEST_F(WorkerServiceStop, CutUnitsBringWhatIsDone) {
  close_gate_behind_the_first(0.5F);
  const std::uint64_t token = master_.add_lease(0, 10), behind = master_.add_lease(10, 20);
  start();
  ASSERT_TRUE(wait_for_runs(2));
  ASSERT_TRUE(master_.wait_for([&] { return master_.fractions.contains(behind); }));
  {
    const std::lock_guard lock(master_.mutex);
    master_.to_cut = {token, behind};
  }
  ASSERT_TRUE(master_.wait_for([&] { return !master_.returned.empty(); }));
  renderer_.open_gate();
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
  const std::vector<Unit> blocks = runs();
  ASSERT_EQ(blocks.size(), 2U);
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.returned, std::vector<std::uint64_t>{behind});
  EXPECT_EQ(master_.merged, std::vector<std::uint64_t>{token});
  EXPECT_EQ(master_.headers[token].unit().end(), blocks.back().end);
  EXPECT_LT(blocks.back().end, 10U);
  const auto delta = film::Delta::decode(master_.deltas[token], {{40, 8, 1}, {}});
  ASSERT_TRUE(delta.ok()) << delta.error().to_string();
  EXPECT_EQ(delta->sample_counts().eye_samples, 40U * 8U * blocks.back().end);
}

// Claim: a unit of segments that is to be cut short ends after the segments under way, though its end is far:
// it brings those with their records.
TEST_F(WorkerServiceStop, CutUnitsBringTheFirstSegments) {
  close_gate_behind_the_first(0.1F);
  tuning_.cut_within = Milliseconds(1000);
  std::uint64_t token = 0;
  {
    const std::lock_guard lock(master_.mutex);
    token = master_.add_lease_unlocked(0, 200);
    v1::Lease& lease = master_.leases.back();
    wire::to_proto(Unit{Unit::Kind::segments, 0, 0, 200}, *lease.mutable_unit());
    for (int i = 0; i < 200; ++i)
      lease.add_chain_starts()->set_bootstrap_sample(static_cast<std::uint64_t>(i));
  }
  start();
  ASSERT_TRUE(wait_for_runs(1));
  {
    const std::lock_guard lock(renderer_.mutex);
    renderer_.permits += 2;
  }
  {
    const std::lock_guard lock(master_.mutex);
    master_.to_cut = {token};
  }
  // Two heartbeats later the worker knows.
  int beats = 0;
  ASSERT_TRUE(master_.wait_for([&] {
    if (beats == 0) beats = master_.heartbeats + 2;
    return master_.heartbeats > beats;
  }));
  renderer_.open_gate();
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_TRUE(master_.returned.empty());
  const std::uint64_t end = master_.headers[token].unit().end();
  EXPECT_GE(end, 1U);
  EXPECT_LT(end, 200U);
  const auto delta = film::Delta::decode(master_.deltas[token], {{40, 8, 1}, {}});
  ASSERT_TRUE(delta.ok()) << delta.error().to_string();
  EXPECT_EQ(delta->info().unit.kind, Unit::Kind::segments);
  EXPECT_EQ(delta->info().unit.end, end);
  EXPECT_EQ(delta->sample_counts().eye_samples, 40U * 8U * end);
}

// Claim: a unit that would take long to the end of its iteration, and has not rendered for so long yet, is
// given back whole.
TEST_F(WorkerServiceStop, LongIterationsAreGivenBack) {
  tuning_.cut_within = Milliseconds(50);
  renderer_.close_gate(0.001F);
  const std::uint64_t token = master_.add_lease(0, 10);
  start();
  ASSERT_TRUE(wait_until_rendering());
  {
    const std::lock_guard lock(master_.mutex);
    master_.to_cut = {token};
  }
  ASSERT_TRUE(master_.wait_for([&] { return !master_.returned.empty(); }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.returned_computing, std::set<std::uint64_t>{token});
  EXPECT_TRUE(master_.merged.empty());
}

// Claim: a worker that drains brings what it has of a long unit.
TEST_F(WorkerServiceStop, DrainBringsWhatIsDone) {
  close_gate_behind_the_first(0.999F);
  const std::uint64_t token = master_.add_lease(0, 10);
  start();
  ASSERT_TRUE(wait_for_runs(2));
  worker_->drain();
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  renderer_.open_gate();
  EXPECT_TRUE(worker_->wait().ok());
  EXPECT_FALSE(worker_->must_begin_again());
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.merged, std::vector<std::uint64_t>{token});
  EXPECT_EQ(master_.headers[token].unit().end(), runs().back().end);
  EXPECT_LT(runs().back().end, 10U);
  EXPECT_TRUE(master_.returned.empty());
}

// Claim: while a renderer goes on with a unit that was taken away, the worker says so with every heartbeat
// and asks for no other unit. When that takes too long it leaves, and wants its process to begin again.
TEST_F(WorkerServiceStop, RenderersThatDoNotStopEndTheWorker) {
  tuning_.stop_limit = Milliseconds(400);
  renderer_.deaf = true;
  renderer_.close_gate(0.5F);
  const std::uint64_t token = master_.add_lease(0, 1), behind = master_.add_lease(1, 2);
  start();
  ASSERT_TRUE(wait_until_rendering());
  ASSERT_TRUE(master_.wait_for([&] { return master_.fractions.contains(behind); }));
  int asked = 0;
  {
    const std::lock_guard lock(master_.mutex);
    master_.revoked = {token, behind};
    master_.add_lease_unlocked(2, 3);
  }
  ASSERT_TRUE(master_.wait_for([&] { return !master_.fractions.contains(behind); }));
  {
    const std::lock_guard lock(master_.mutex);
    asked = master_.acquisitions;
    EXPECT_EQ(master_.reports[token].phase(), v1::WORK_PHASE_RENDERING);
  }
  EXPECT_TRUE(worker_->wait().ok());
  EXPECT_TRUE(worker_->must_begin_again());
  {
    const std::lock_guard lock(master_.mutex);
    EXPECT_LE(master_.acquisitions, asked + 1);  // one may have been on its way
    EXPECT_EQ(master_.deregistrations, 1);
    EXPECT_TRUE(master_.merged.empty());
  }
  renderer_.open_gate();
}

// Claim: a delta that the master does not take is given up at once when its unit is taken away.
TEST_F(WorkerServiceStop, PushesStop) {
  for (int i = 0; i < 1000; ++i) master_.push_script.emplace_back(grpc::StatusCode::UNAVAILABLE, "away");
  tuning_.first_backoff = tuning_.longest_backoff = Milliseconds(60000);
  const std::uint64_t token = master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return master_.pushes == 1; }));
  {
    const std::lock_guard lock(master_.mutex);
    master_.push_script.clear();
    master_.revoked = {token};
    master_.add_lease_unlocked(1, 2);
  }
  EXPECT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
}

}  // namespace
}  // namespace candela::worker
