// The scheduler against a clock of our own: leases, fencing, failures, fairness, stop rules, restart.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "master/jobs/job_upkeep.h"
#include "tests/unit/scheduler_fixture.h"

namespace candela::master {
namespace {

constexpr std::uint32_t kPixels = 64;

class SchedulerTest : public SchedulerFixture {
 protected:
  void job(const std::string& id, std::uint64_t iterations, bool pilot_done = true, int priority = 0,
           double share = 1) {
    JobRow j = row(id, iterations);
    j.priority = priority;
    j.share = share;
    if (pilot_done) {
      j.named_state = NamedState{20};
      j.thread_seconds_per_iteration = 1;
      s->restore(j, {}, {}, {}, {}, now());  // as after a pilot
    } else {
      s->submit(j, now());
    }
  }
  Delivery deliver(const Lease& l, const Unit& u, double seconds = 1) {
    film::SampleCounts sample_counts;
    sample_counts.eye_samples = (u.end - u.begin) * kPixels;
    return SchedulerFixture::deliver(l, u, sample_counts, seconds);
  }
};

// Claim: a job starts with exactly one pilot; iterations are leased only after its result, with the pilot's
// state.
TEST_F(SchedulerTest, APilotComesFirstAndAlone) {
  worker("a");
  worker("b");
  job("j", 8, false);
  const auto pilot = lease("a");
  ASSERT_TRUE(pilot);
  EXPECT_EQ(unit_of(*pilot).kind, Unit::Kind::pilot);
  EXPECT_EQ(s->job("j")->row.state, JobState::running);
  EXPECT_FALSE(lease("b"));
  EXPECT_TRUE(s->complete_pilot("a", pilot->row.token, {NamedState{17}, "plan", 0.5}, now()));
  EXPECT_FALSE(s->complete_pilot("a", pilot->row.token, {NamedState{18}, "plan", 0.5}, now())) << "twice";
  EXPECT_EQ(s->job("j")->row.named_state->film_scale_log2, 17);
  const auto first = lease("b");
  ASSERT_TRUE(first);
  EXPECT_EQ(unit_of(*first).kind, Unit::Kind::iterations);
}

// Claim: units tile [0, N0) and [0, N1) without gap or overlap, whoever asks, and the job then waits for its
// checkpoint.
TEST_F(SchedulerTest, UnitsTileBothHalvesOfAnOddTarget) {
  worker("a");
  worker("b");
  job("j", 101);
  std::array<film::IndexSet, 2> seen;
  for (int i = 0; i < 1000; ++i) {
    const auto l = lease(i % 3 == 0 ? "b" : "a");
    if (!l) break;
    const Unit u = unit_of(*l);
    EXPECT_TRUE(seen[u.half].insert(u.begin, u.end));
    EXPECT_EQ(deliver(*l, u), Delivery::ok);
  }
  EXPECT_EQ(seen[0].count(), 51U);
  EXPECT_EQ(seen[1].count(), 50U);
  EXPECT_EQ(seen[0].first_gap(0, 51).first, seen[0].first_gap(0, 51).second);
  EXPECT_EQ(seen[1].first_gap(0, 50).first, seen[1].first_gap(0, 50).second);
  EXPECT_TRUE(s->job("j")->finishing);
  EXPECT_EQ(s->job("j")->row.state, JobState::running) << "done only after the final checkpoint";
  s->finish("j", now());
  EXPECT_EQ(s->job("j")->row.state, JobState::done);
  EXPECT_EQ(s->job("j")->row.stop_reason, "iterations");
}

// Claim: a zombie whose lease expired is refused, also before anybody else has the unit; tokens only grow.
TEST_F(SchedulerTest, AnExpiredLeaseIsFencedOff) {
  worker("a");
  worker("b");
  job("j", 2);
  const auto zombie = lease("a");
  ASSERT_TRUE(zombie);
  const Unit u = unit_of(*zombie);
  s->heartbeat("a", {zombie->row.token}, at(101));
  at(105);
  EXPECT_EQ(s->check_delivery("a", zombie->row.token, zombie->row.unit_id, "j", u, now()), Delivery::ok);
  at(112);
  EXPECT_EQ(deliver(*zombie, u), Delivery::stale);
  const auto next = lease("b");
  ASSERT_TRUE(next);
  EXPECT_EQ(next->row.unit_id, zombie->row.unit_id);
  EXPECT_GT(next->row.token, zombie->row.token);
  EXPECT_EQ(deliver(*zombie, u), Delivery::stale);
  EXPECT_EQ(deliver(*next, u), Delivery::ok);
  EXPECT_EQ(deliver(*zombie, u), Delivery::duplicate);
  EXPECT_EQ(s->heartbeat("a", {zombie->row.token}, now()).revoked,
            std::vector<std::uint64_t>{zombie->row.token});
  EXPECT_EQ(s->job("j")->row.iterations, u.end - u.begin);
}

// Claim: another worker's token, unit or range does not pass.
TEST_F(SchedulerTest, ADeliveryMustMatchItsLease) {
  worker("a");
  worker("b");
  job("j", 8);
  const auto l = lease("a");
  const Unit u = unit_of(*l);
  EXPECT_EQ(s->check_delivery("b", l->row.token, l->row.unit_id, "j", u, now()), Delivery::stale);
  EXPECT_EQ(s->check_delivery("a", l->row.token + 1, l->row.unit_id, "j", u, now()), Delivery::stale);
  EXPECT_EQ(s->check_delivery("a", l->row.token, l->row.unit_id + 1, "j", u, now()), Delivery::stale);
  Unit longer = u;
  longer.end += 1;
  EXPECT_EQ(s->check_delivery("a", l->row.token, l->row.unit_id, "j", longer, now()), Delivery::stale);
  EXPECT_EQ(s->check_delivery("a", l->row.token, l->row.unit_id, "other", u, now()), Delivery::stale);
}

// Claim: heartbeats that name a lease keep it for ever; one that no heartbeat names goes.
TEST_F(SchedulerTest, HeartbeatsKeepWhatTheyName) {
  worker("a");
  job("j", 100);
  const auto kept = lease("a");
  const auto lost = lease("a");  // its answer never arrived
  ASSERT_TRUE(kept && lost);
  for (int t = 101; t < 160; t += 3) {
    s->authenticate("a", "session-a", at(t));
    EXPECT_TRUE(s->heartbeat("a", {kept->row.token}, now()).revoked.empty());
  }
  EXPECT_EQ(s->lease_count(), 1U);
  EXPECT_EQ(s->expired_count(), 1U);
}

// Claim: the memory of a job's workers is the largest that its present workers told.
TEST_F(SchedulerTest, MemoryIsOfTheLargestWorkerOfTheJob) {
  worker("a");
  worker("b");
  worker("idle");
  job("j", 100);
  EXPECT_EQ(s->worker_memory_of("j"), 0U);
  s->note_memory("a", 700);
  s->note_memory("b", 900);
  s->note_memory("idle", 5000);
  s->note_memory("nobody", 9000);
  EXPECT_EQ(s->worker_memory_of("j"), 0U) << "nobody renders it";
  ASSERT_TRUE(lease("a"));
  EXPECT_EQ(s->worker_memory_of("j"), 700U);
  ASSERT_TRUE(lease("b"));
  EXPECT_EQ(s->worker_memory_of("j"), 900U);
}

// Claim: a lease that its live worker does not name is open again within seconds, not after lease times:
// after a restart the end of a job does not wait for units that died with their process. The late delivery is
// refused.
TEST_F(SchedulerTest, WhatALiveWorkerDoesNotNameIsOpenAgainSoon) {
  worker("a");
  worker("b");
  job("j", 2);
  const auto lost = lease("a");
  ASSERT_TRUE(lost);
  s->heartbeat("a", {}, at(101));
  EXPECT_EQ(s->lease_count(), 1U) << "its answer may still be on the way";
  s->heartbeat("a", {}, at(105.5));
  EXPECT_EQ(s->lease_count(), 0U);
  const auto next = lease("b");
  ASSERT_TRUE(next);
  EXPECT_EQ(next->row.unit_id, lost->row.unit_id);
  EXPECT_EQ(deliver(*lost, unit_of(*lost)), Delivery::stale);
  EXPECT_EQ(deliver(*next, unit_of(*next)), Delivery::ok);
}

// Claim: a straggler's unit is leased once more when nothing else is open; the first delivery wins, the other
// is told.
TEST_F(SchedulerTest, StragglersRunTwiceAndCountOnce) {
  worker("a");
  worker("b");
  worker("c");
  job("j", 1);
  const auto slow = lease("a");
  ASSERT_TRUE(slow);
  EXPECT_FALSE(lease("b")) << "not late yet";
  for (int t = 101; t < 112; ++t) s->heartbeat("a", {slow->row.token}, at(t));
  const auto fast = lease("b");
  ASSERT_TRUE(fast);
  EXPECT_TRUE(fast->row.speculative);
  EXPECT_EQ(fast->row.unit_id, slow->row.unit_id);
  EXPECT_FALSE(lease("c")) << "once";
  const Unit u{Unit::Kind::iterations, 0, 0, 1};
  EXPECT_EQ(deliver(*fast, u), Delivery::ok);
  EXPECT_EQ(deliver(*slow, u), Delivery::duplicate);
  EXPECT_EQ(s->heartbeat("a", {slow->row.token}, now()).revoked.size(), 1U);
  EXPECT_EQ(s->job("j")->row.units_merged, 1U);
}

// Claim: a returned lease re-opens the unit without counting a failure.
TEST_F(SchedulerTest, ReturnedUnitsAreOpenAgain) {
  worker("a");
  job("j", 1);
  const auto l = lease("a");
  s->return_lease("a", l->row.token, now());
  s->return_lease("a", l->row.token, now());
  const auto again = lease("a");
  ASSERT_TRUE(again);
  EXPECT_EQ(again->row.unit_id, l->row.unit_id);
  EXPECT_EQ(s->job("j")->units.at(l->row.unit_id).row.failures, 0U);
}

// Claim: higher priority first; within one priority worker time follows the shares (here 3 to 1, within a
// unit).
TEST_F(SchedulerTest, PrioritiesAndShares) {
  worker("a");
  job("low", 100000, true, 0, 1);
  job("x", 100000, true, 1, 3);
  job("y", 100000, true, 1, 1);
  std::map<std::string, double> seconds;
  for (int i = 0; i < 400; ++i) {
    const auto l = lease("a");
    ASSERT_TRUE(l);
    const Unit u = unit_of(*l);
    const auto spent = static_cast<double>(u.end - u.begin);
    seconds[l->row.job_id] += spent;
    at(clock + spent);
    s->heartbeat("a", {l->row.token}, now());
    ASSERT_EQ(deliver(*l, u, spent), Delivery::ok);
  }
  EXPECT_EQ(seconds.count("low"), 0U);
  EXPECT_NEAR(seconds["x"] / seconds["y"], 3, 0.1);
}

// Claim: a worker that asks as full gets a unit of a job of higher priority than all that it holds, and no
// other, nor a straggler's unit.
TEST_F(SchedulerTest, FullWorkersTakeUrgentUnitsAlone) {
  worker("a");
  job("low", 100000);
  ASSERT_TRUE(lease("a"));
  ASSERT_TRUE(lease("a"));
  EXPECT_FALSE(lease("a", false, true));
  job("same", 100000, true, 0, 1);
  EXPECT_FALSE(lease("a", false, true));
  job("urgent", 100000, true, 1, 1);
  const auto got = lease("a", false, true);
  ASSERT_TRUE(got);
  EXPECT_EQ(got->row.job_id, "urgent");
  EXPECT_FALSE(lease("a", false, true)) << "it holds a unit of the urgent job now";
  const auto normal = lease("a");
  ASSERT_TRUE(normal) << "as one that is not full it gets units as ever";
}

// Claim: a job that arrives late shares from then on; it does not get all the time it was not there.
TEST_F(SchedulerTest, LateJobsDoNotStarveOthers) {
  worker("a");
  job("old", 100000);
  const auto work = [&](int units) {
    std::map<std::string, int> count;
    for (int i = 0; i < units; ++i) {
      const auto l = lease("a");
      const Unit u = unit_of(*l);
      ++count[l->row.job_id];
      deliver(*l, u, static_cast<double>(u.end - u.begin));
    }
    return count;
  };
  work(50);
  JobRow j;
  j.id = "new";
  j.settings.width = j.settings.height = 8;
  j.stop.iterations = 100000;
  s->submit(j, now());
  const auto pilot = lease("a");
  ASSERT_EQ(pilot->row.job_id, "new");
  s->complete_pilot("a", pilot->row.token, {NamedState{1}, "", 1}, now());
  auto count = work(40);
  EXPECT_NEAR(count["old"], 20, 3);
}

// Claim: no worker gets a job whose instruction set it lacks, and the job says why it waits.
TEST_F(SchedulerTest, InstructionSetsAreRespected) {
  worker("a", {"sse2"});
  job("j", 4);
  EXPECT_FALSE(lease("a"));
  EXPECT_NE(s->message_of(*s->job("j"), now()).find("avx2"), std::string::npos);
  worker("b");
  EXPECT_TRUE(lease("b"));
}

// Claim: prefetching is granted while work is plenty and refused near the end; a job near its end is not
// passed over for a lesser one, whose prefetched units would keep the worker from it for ever.
TEST_F(SchedulerTest, PrefetchOnlyWhileWorkIsPlenty) {
  worker("a");
  job("j", 1000);
  EXPECT_TRUE(lease("a", true));
  job("k", 4, true, 5);
  EXPECT_FALSE(lease("a", true));
  for (int i = 0; i < 4; ++i) {
    const auto last = lease("a", false);
    ASSERT_TRUE(last);
    ASSERT_EQ(last->row.job_id, "k");
    deliver(*last, unit_of(*last));
    if (s->job("k")->finishing) break;
    EXPECT_FALSE(lease("a", true)) << "k has more";
  }
  ASSERT_TRUE(s->job("k")->finishing);
  EXPECT_EQ(lease("a", true)->row.job_id, "j");
}

// Claim: drained workers get nothing and are drained when their last lease is gone.
TEST_F(SchedulerTest, DrainEndsLeases) {
  worker("a");
  job("j", 100);
  const auto l = lease("a");
  ASSERT_TRUE(s->drain("a", now()).ok());
  EXPECT_TRUE(s->acquire("a", {}, {}, now()).drain);
  EXPECT_EQ(s->worker_state_name(s->workers().at("a"), now()), "draining");
  deliver(*l, unit_of(*l));
  EXPECT_EQ(s->worker_state_name(s->workers().at("a"), now()), "drained");
  EXPECT_FALSE(s->drain("nobody", now()).ok());
}

// Claim: pause lets outstanding units in and gives no new ones; cancel drops them; both may be repeated.
TEST_F(SchedulerTest, PauseResumeCancel) {
  worker("a");
  job("j", 100);
  const auto l = lease("a");
  const auto m = lease("a");
  const Unit u = unit_of(*l), v = unit_of(*m);
  ASSERT_TRUE(s->pause("j", now()).ok());
  ASSERT_TRUE(s->pause("j", now()).ok());
  EXPECT_FALSE(lease("a"));
  EXPECT_EQ(deliver(*l, u), Delivery::ok);
  ASSERT_TRUE(s->resume("j", now()).ok());
  ASSERT_TRUE(s->cancel("j", now()).ok());
  ASSERT_TRUE(s->cancel("j", now()).ok());
  EXPECT_EQ(deliver(*m, v), Delivery::job_ended);
  EXPECT_FALSE(s->resume("j", now()).ok());
  EXPECT_EQ(s->job("j")->row.iterations, u.end - u.begin);
}

// Claim: 8 iterations extended by 8 are the same set of iterations as 16; failed jobs cannot be extended.
TEST_F(SchedulerTest, ExtendContinues) {
  worker("a");
  job("j", 8);
  const auto drain = [&] {
    while (const auto l = lease("a")) deliver(*l, unit_of(*l));
  };
  drain();
  s->finish("j", now());
  EXPECT_FALSE(s->extend("j", 0, 0, 0, now()).ok());
  EXPECT_FALSE(s->extend("j", 0, -1, 0, now()).ok());
  ASSERT_TRUE(s->extend("j", 8, 0, 0, now()).ok());
  EXPECT_EQ(s->job("j")->row.state, JobState::queued);
  drain();
  s->finish("j", now());
  EXPECT_EQ(s->job("j")->row.state, JobState::done);
  for (const auto& half : s->job("j")->merged) {
    EXPECT_EQ(half.count(), 8U);
    EXPECT_EQ(half.first_gap(0, 8).first, half.first_gap(0, 8).second);
  }
  job("k", 1, false);
  s->fail_job("k", "no", now());
  EXPECT_FALSE(s->extend("k", 1, 0, 0, now()).ok());
}

// Claim: the time limit counts time in state running only, and ends the job after a first merge.
TEST_F(SchedulerTest, TimeLimitExcludesPauses) {
  worker("a");
  JobRow j;
  j.id = "j";
  j.settings.width = j.settings.height = 8;
  j.stop.time_seconds = 10;
  j.named_state = NamedState{1};
  j.thread_seconds_per_iteration = 1;
  s->restore(j, {}, {}, {}, {}, now());
  s->tick(at(150));
  EXPECT_EQ(s->job("j")->row.elapsed_seconds, 0) << "queued";
  const auto l = lease("a");
  s->tick(at(154));
  s->heartbeat("a", {l->row.token}, now());
  ASSERT_TRUE(s->pause("j", now()).ok());
  deliver(*l, unit_of(*l));
  s->tick(at(1000));
  EXPECT_FALSE(s->job("j")->finishing);
  ASSERT_TRUE(s->resume("j", now()).ok());
  s->authenticate("a", "session-a", now());
  const auto other_half = lease("a");
  ASSERT_TRUE(other_half);
  s->tick(at(1005));
  EXPECT_NEAR(s->job("j")->row.elapsed_seconds, 9, 1e-9);
  s->tick(at(1006.5));
  EXPECT_FALSE(s->job("j")->finishing) << "the other half has nothing yet";
  deliver(*other_half, unit_of(*other_half));
  EXPECT_TRUE(s->job("j")->finishing);
  EXPECT_EQ(s->lease_count(), 0U);
}

// Claim: at a restart rows follow the film: units it lacks are open again, units it has are merged, gaps
// can be cut again, and a worker that survived can deliver with its old token.
TEST_F(SchedulerTest, RestartReconcilesRowsWithTheFilm) {
  worker("a");
  JobRow j;
  j.id = "j";
  j.state = JobState::running;
  j.settings.width = j.settings.height = 8;
  j.stop.iterations = 40;
  j.named_state = NamedState{1};
  j.thread_seconds_per_iteration = 1;
  const auto row = [](std::uint64_t id, std::uint64_t b, std::uint64_t e, UnitRow::State state) {
    UnitRow u;
    u.id = id;
    u.job_id = "j";
    u.unit = {Unit::Kind::iterations, 0, b, e};
    u.state = state;
    return u;
  };
  std::array<film::IndexSet, 2> film;
  film[0].insert(0, 4);
  film[0].insert(8, 10);  // 8..10: leased says the row; 12..14: no row at all
  film[0].insert(12, 14);
  Scheduler t(options(), 2, 100);
  WorkerRow w;
  w.id = "a";
  w.session = "session-a";
  w.isas = {"avx2"};
  t.restore_worker(w, now());
  t.restore(j, film, {}, {row(3, 8, 10, UnitRow::State::leased), row(5, 14, 16, UnitRow::State::leased)},
            {row(1, 0, 4, UnitRow::State::merged), row(2, 4, 8, UnitRow::State::merged)}, now());
  LeaseRow l;
  l.token = (1ULL << 32) + 7;
  l.unit_id = 5;
  l.job_id = "j";
  l.worker_id = "a";
  t.restore_lease(l, now());
  const Job& job = *t.job("j");
  EXPECT_EQ(job.row.iterations, 8U);
  EXPECT_EQ(job.row.units_merged, 3U);
  film::IndexSet open;
  for (const auto& [id, u] : job.units) EXPECT_TRUE(open.insert(u.row.unit.begin, u.row.unit.end));
  EXPECT_EQ(open.ranges(), (std::map<std::uint64_t, std::uint64_t>{{4, 8}, {14, 16}}));
  EXPECT_EQ(job.source->reserved()[0].first_gap(0, 16), std::pair(std::uint64_t{10}, std::uint64_t{12}))
      << "it can be cut";
  EXPECT_EQ(t.check_delivery("a", l.token, 5, "j", {Unit::Kind::iterations, 0, 14, 16}, now()), Delivery::ok);
  t.authenticate("a", "session-a", now());
  EXPECT_GT(t.acquire("a", {}, {}, now()).lease->row.token, l.token);
}

// Claim: a job that has rendered all it was asked for, but whose last checkpoint fails, cannot be paused, and
// the refusal says what it waits for, not that it has ended.
TEST_F(SchedulerTest, AFinishingJobCannotBePaused) {
  worker("a");
  job("j", 2);
  while (const auto l = lease("a")) deliver(*l, unit_of(*l));
  ASSERT_TRUE(s->job("j")->finishing);
  s->set_note("j", "the disk is full");
  const auto paused = s->pause("j", now());
  ASSERT_FALSE(paused.ok());
  EXPECT_EQ(paused.error().message.find("has ended"), std::string::npos) << paused.error().message;
  EXPECT_NE(paused.error().message.find("the disk is full"), std::string::npos) << paused.error().message;
}

// Claim: of a farm of many workers sizes follow how many there are, once some are drained, leave, or have not
// been heard of for long: a guided unit is the rest over twice their number, if that is short.
TEST_F(SchedulerTest, ManyWorkersAreCountedAnewWhenTheyChange) {
  const auto name = [](int i) { return "w" + std::to_string(i); };
  for (int i = 0; i < 100; ++i) worker(name(i));
  JobRow j = row("j", 20'000);
  j.named_state = NamedState{20};
  j.thread_seconds_per_iteration = 1e-3;
  s->restore(j, {}, {}, {}, {}, now());
  constexpr std::uint64_t kAll = 20'000;
  std::uint64_t rest = kAll;
  const auto expect_shared_by = [&](std::uint64_t workers) {
    const Unit u = unit_of(*lease("w0"));
    // 250: a quarter second, which the first eight units take. Later ones are as long as each worker's share
    // of what is cut.
    const std::uint64_t cut = kAll - rest;
    EXPECT_EQ(u.end - u.begin, std::min(rest / (2 * workers),
                                        std::max<std::uint64_t>(250, cut < 8 * 250 ? 0 : cut / workers)));
    rest -= u.end - u.begin;
  };
  expect_shared_by(100);
  ASSERT_TRUE(s->drain("w1", now()).ok());
  expect_shared_by(99);
  s->deregister("w2", now());
  expect_shared_by(98);
  worker("x");
  expect_shared_by(99);
  at(clock + 0.1);
  expect_shared_by(99);
  at(clock + 11);
  for (int i = 3; i < 6; ++i) {
    const Unit u = unit_of(*lease(name(i)));
    rest -= u.end - u.begin;
  }
  // One that only says that it lives takes nothing.
  s->authenticate(name(7), "session-" + name(7), now());
  at(clock + 0.3);
  expect_shared_by(4);
}

// Claim: the time for estimates of the error is shared by jobs that run, however many are queued or paused.
TEST_F(SchedulerTest, QueuedJobsTakeNoShareOfTheEstimates) {
  worker("a");
  job("j", 1000);
  for (int i = 0; i < 500; ++i) job("queued" + std::to_string(i), 1000, false, -1);
  EXPECT_EQ(estimating_jobs(s->jobs()), 0U);
  ASSERT_EQ(lease("a")->row.job_id, "j");
  EXPECT_EQ(estimating_jobs(s->jobs()), 1U);
  ASSERT_TRUE(s->pause("j", now()).ok());
  EXPECT_EQ(estimating_jobs(s->jobs()), 0U);
}

// Claim: sessions are checked whole.
TEST_F(SchedulerTest, SessionsAuthenticate) {
  worker("a");
  EXPECT_NE(s->authenticate("a", "session-a", now()), nullptr);
  EXPECT_EQ(s->authenticate("a", "session-b", now()), nullptr);
  EXPECT_EQ(s->authenticate("a", "", now()), nullptr);
  EXPECT_EQ(s->authenticate("b", "session-a", now()), nullptr);
}

}  // namespace
}  // namespace candela::master
