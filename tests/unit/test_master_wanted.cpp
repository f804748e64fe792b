// Threads and workers that the queue wants, against a clock of our own. Units take four seconds.
#include <gtest/gtest.h>

#include "tests/unit/scheduler_fixture.h"

namespace candela::master {
namespace {

class WantedTest : public SchedulerFixture {
 protected:
  void worker(const std::string& id, std::uint32_t threads, std::vector<std::string> isas = {"avx2"}) {
    WorkerRow w;
    w.id = id;
    w.session = "session-" + id;
    w.isas = std::move(isas);
    w.threads = threads;
    ASSERT_TRUE(s->register_worker(w, now()).ok());
  }
  // A job behind its pilot.
  void job(const std::string& id, std::uint64_t iterations, double thread_seconds,
           std::optional<ChainPlan> chains = std::nullopt, const std::string& isa = "avx2") {
    JobRow j = row(id, iterations);
    j.settings.isa = isa;
    j.named_state = NamedState{20};
    if (chains) j.named_state->bootstrap_b = 1;
    j.chains = chains;
    j.thread_seconds_per_iteration = thread_seconds;
    RestoredStages stages;
    if (chains) stages.starts.assign(chains->chains, 0);
    s->restore(j, {}, {}, {}, {}, now(), stages);
  }
  void expect(std::uint64_t threads, std::uint64_t workers) {
    EXPECT_EQ(s->wanted(now()).threads, threads);
    EXPECT_EQ(s->wanted(now()).workers, workers);
  }
};

// Claim: nothing is wanted where nothing is to do; a job that nobody has measured wants one worker.
TEST_F(WantedTest, AQueueOfOnePilotWantsOneWorker) {
  expect(0, 0);
  worker("a", 8);
  expect(0, 0);
  s->submit(row("j", 100), now());
  expect(8, 1);
  s->deregister("a", now());
  expect(1, 1);
}

// Claim: jobs that share workers add up to whole workers: 3 + 5 + 5 + 5 threads are three workers of six.
TEST_F(WantedTest, SharesOfWorkersAddUp) {
  worker("a", 6);
  for (const std::uint64_t iterations : {12U, 20U, 20U, 20U})
    job("j" + std::to_string(s->jobs().size()), iterations, 1);
  expect(18, 3);
}

// Claim: each thread wanted has a unit's time of work, merged work counts no more, and of several jobs each
// adds its own; without a worker one is wanted, whatever the work.
TEST_F(WantedTest, ThreadsHaveAUnitOfWorkEach) {
  job("j", 1000, 1);
  expect(250, 1);
  worker("a", 8);
  expect(250, 32);
  worker("b", 2);  // five threads on average
  expect(250, 50);
  for (int i = 0; i < 200; ++i) {
    const auto l = lease("a");
    ASSERT_TRUE(l);
    film::SampleCounts sample_counts;
    sample_counts.eye_samples = 64;
    const Unit u = unit_of(*l);
    ASSERT_EQ(deliver(*l, u, sample_counts, static_cast<double>(u.end - u.begin) / 8), Delivery::ok);
    const std::uint64_t left = 1000 - s->job("j")->row.iterations;
    EXPECT_EQ(s->wanted(now()).threads, std::max<std::uint64_t>((left + 3) / 4, left > 0 ? 1 : 0));
    if (left == 0) break;
  }
  expect(0, 0);
  job("k", 100, 1);
  job("l", 10, 1);
  expect(25 + 3, 6);
}

// Claim: workers that lack a job's instruction set do not count for it. More of them would not help, so that
// a job that none of the present ones can run wants a single one.
TEST_F(WantedTest, WorkersCountForTheInstructionSetsThatTheyHave) {
  job("wide", 1000, 1, std::nullopt, "avx512");
  expect(250, 1);
  worker("a", 8);
  expect(1, 1);
  job("k", 100, 1);
  expect(25 + 1, 5);  // 25 / 8 + 1
  worker("b", 40, {"avx2", "avx512"});
  expect(25 + 250, 8);  // 25 / 24 + 250 / 40
  ASSERT_TRUE(s->drain("b", now()).ok());
  expect(25 + 1, 5);
}

// Claim: an iteration is one worker's, a chain one thread's.
TEST_F(WantedTest, IndicesBoundTheThreads) {
  worker("a", 8);
  job("slow", 3, 400);
  expect(24, 3);
  ASSERT_TRUE(s->cancel("slow", now()).ok());
  job("chains", 1000, 400, ChainPlan{40, 1000, 100});
  expect(40, 5);
}

// Claim: of a job of epochs only the open ones count.
TEST_F(WantedTest, EpochsBoundTheThreads) {
  worker("a", 1);
  s->submit(row("j", 1000), now());
  const auto l = lease("a");
  ASSERT_TRUE(l);
  PilotResult result;
  result.state = NamedState{17};
  result.seconds_per_iteration = 4;
  result.work.epochs = EpochPlan{6, 4, 1, "rule", {}};
  ASSERT_TRUE(s->complete_pilot("a", l->row.token, result, now()));
  expect(1, 1);
  s->decided({"j", 0, "rule", std::string(64, 'a'), 1}, now());
  expect(6, 6);
}

// Claim: a job without an end wants no more than the farm admits; paused jobs and workers that drain or are
// lost do not count.
TEST_F(WantedTest, IsBounded) {
  worker("a", 8);
  job("j", 0, 1);
  const std::uint64_t most = SchedulerOptions{}.max_workers;
  expect(8 * most, most);
  worker("b", 1000);
  ASSERT_TRUE(s->drain("b", now()).ok());
  expect(8 * most, most);
  at(clock + 20);
  expect(most, 1);
  ASSERT_TRUE(s->pause("j", now()).ok());
  expect(0, 0);
}

}  // namespace
}  // namespace candela::master
