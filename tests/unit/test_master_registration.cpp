// The table of workers: it is bounded, and nobody can fill it for others.
#include <fmt/format.h>

#include "tests/unit/scheduler_fixture.h"

namespace candela::master {
namespace {

class RegistrationTest : public SchedulerFixture {
 protected:
  static constexpr std::size_t kMaxWorkers = 50;
  void SetUp() override {
    SchedulerOptions o = options();
    o.max_workers = kMaxWorkers;
    s = std::make_unique<Scheduler>(o, 1, 1);
  }
  bool is_known(const std::string& id) { return s->workers().contains(id); }
  void call(const std::string& id) { EXPECT_NE(s->authenticate(id, "session-" + id, now()), nullptr); }
  // Merges one unit of a job of its own.
  void merge_one(const std::string& id) {
    JobRow job = row("job-" + id, 100);
    job.state = JobState::running;
    job.named_state = NamedState{20};
    s->restore(job, {}, {}, {}, {}, now());
    const auto l = lease(id);
    ASSERT_TRUE(l);
    ASSERT_EQ(deliver(*l, unit_of(*l), {}, 1), Delivery::ok);
    ASSERT_TRUE(s->cancel("job-" + id, now()).ok());
  }
};

// Claim: registrations beyond the limit, from programs that never call again, keep no honest worker out and
// end no honest worker's session: those that work, wait for work, or are lost but merged a unit.
TEST_F(RegistrationTest, AFloodKeepsNobodyOut) {
  worker("lost-but-merged");
  merge_one("lost-but-merged");
  at(150);
  worker("busy");
  merge_one("busy");
  worker("waiting");
  call("waiting");
  for (int i = 0; i < 1000; ++i) worker(fmt::format("flood-{}", i));
  worker("honest");
  call("honest");
  for (int i = 0; i < 1000; ++i) worker(fmt::format("again-{}", i));
  for (const char* id : {"lost-but-merged", "busy", "waiting", "honest", "again-999"})
    EXPECT_TRUE(is_known(id)) << id;
  EXPECT_EQ(s->workers().size(), kMaxWorkers);
}

// Claim: a full table of workers that merged units and are there refuses one more, and takes it when one is
// lost.
TEST_F(RegistrationTest, WorkersThatWorkAreNotForgotten) {
  for (std::size_t i = 0; i < kMaxWorkers; ++i) {
    worker(fmt::format("w{}", i));
    merge_one(fmt::format("w{}", i));
  }
  WorkerRow late;
  late.id = "late";
  EXPECT_FALSE(s->register_worker(late, now()).ok());
  at(clock + 15);
  for (std::size_t i = 1; i < kMaxWorkers; ++i) call(fmt::format("w{}", i));
  worker("late");
  EXPECT_FALSE(is_known("w0"));
  EXPECT_TRUE(is_known("w1") && is_known("late"));
}

// Claim: a worker that falls silent and never merged a unit is forgotten after a minute; one that did, after
// an hour.
TEST_F(RegistrationTest, CrashLoopsDoNotPileUp) {
  worker("merged");
  merge_one("merged");
  for (int i = 0; i < 300; ++i) {  // six programs that crash every twelve seconds
    at(clock + 2);
    s->tick(now());
    worker(fmt::format("crash-{}", i));
  }
  EXPECT_LE(s->workers().size(), 40U);
  EXPECT_TRUE(is_known("merged"));
  at(clock + 3600);
  s->tick(now());
  EXPECT_EQ(s->workers().size(), 0U);
}

}  // namespace
}  // namespace candela::master
