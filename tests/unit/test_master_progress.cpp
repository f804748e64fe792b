// Workers that do not go on, units that are cut short, time that counts: against a clock of our own.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "common/rng/stream.h"
#include "tests/unit/scheduler_fixture.h"

namespace candela::master {
namespace {

constexpr auto kBuilding = WorkPhase::building;

class Progress : public SchedulerFixture {
 protected:
  void job(const std::string& id, std::uint64_t iterations, int priority = 0, double thread_seconds = 1) {
    JobRow j = row(id, iterations);
    j.priority = priority;
    j.named_state = NamedState{20};
    j.thread_seconds_per_iteration = thread_seconds;
    s->restore(j, {}, {}, {}, {}, now());  // as after a pilot
  }
  Delivery deliver(const Lease& l, const Unit& u, double seconds = 1) {
    return SchedulerFixture::deliver(l, u, {}, seconds);
  }
  HeartbeatResult beat(const std::string& w, const std::vector<UnitReport>& units) {
    s->authenticate(w, "session-" + w, now());
    return s->heartbeat(w, units, now());
  }
  std::string state(const std::string& w) { return s->worker_state_name(s->workers().at(w), now()); }
  const JobRow& job_row(const std::string& id) { return s->job(id)->row; }
  // Kinds of the events since the last call, of one worker or of all.
  std::vector<std::string> events(const std::string& kind) {
    std::vector<std::string> out;
    for (const Change& change : s->take_changes())
      if (const auto* event = std::get_if<AddEvent>(&change); event != nullptr && event->row.kind == kind)
        out.push_back(event->row.message);
    return out;
  }
  // Beats with unchanged steps for so long.
  void stand_still(const std::string& w, const Lease& l, double seconds) {
    const double end = clock + seconds;
    while (clock < end) {
      at(clock + 2);
      beat(w, {{l.row.token, kBuilding, 7}});
      s->tick(now());
      expect_invariants();
    }
  }
  double stuck_seconds = options().stuck_seconds;
};

// Claim: a worker whose steps do not grow is called stuck after a minute, with the phase, and loses the unit
// after the time set; another worker gets it, and if that one does not go on either, the job fails and says
// so.
TEST_F(Progress, WhoStandsStillLosesTheUnit) {
  worker("a");
  job("j", 2);
  const Lease l = *lease("a");
  stand_still("a", l, 50);
  EXPECT_EQ(state("a"), "busy");
  stand_still("a", l, 20);
  EXPECT_EQ(state("a"), "stuck");
  EXPECT_NE(s->stuck_text(s->workers().at("a"), now()).find("building the scene for job j"),
            std::string::npos)
      << s->stuck_text(s->workers().at("a"), now());
  stand_still("a", l, stuck_seconds);
  EXPECT_EQ(s->lease_count(), 0U);
  EXPECT_EQ(events("stuck").size(), 1U);
  EXPECT_EQ(beat("a", {{l.row.token, kBuilding, 7}}).revoked, std::vector<std::uint64_t>{l.row.token});
  EXPECT_FALSE(has_ended(job_row("j").state)) << "one worker proves nothing";
  worker("b");  // it was forgotten meanwhile
  std::optional<Lease> second;
  for (int i = 0; i < 10 && !second; ++i) {
    at(clock + 1);
    second = lease("b");
  }
  ASSERT_TRUE(second);
  stand_still("b", *second, stuck_seconds + 5);
  EXPECT_EQ(job_row("j").state, JobState::failed);
  for (const char* part : {"building the scene", "/a", "/b", "--stuck-after", "candela resume j"})
    EXPECT_NE(job_row("j").message.find(part), std::string::npos) << part << ": " << job_row("j").message;
}

// Claim: steps, or another phase, are progress, however long the unit takes; a unit that waits behind another
// does not age.
TEST_F(Progress, WhoGoesOnKeepsTheUnit) {
  worker("a");
  job("j", 100);
  const Lease l = *lease("a"), behind = *lease("a", true);
  for (std::uint64_t step = 0; step < 4000; ++step) {
    at(clock + 2);
    beat("a", {{l.row.token, kBuilding, step / 100}, {behind.row.token, WorkPhase::waiting, 0}});
    s->tick(now());
  }
  EXPECT_EQ(s->lease_count(), 2U);
  EXPECT_TRUE(events("stuck").empty());
}

// Claim: the only worker of a farm has a second try, since a disk may have slept; then the job fails.
TEST_F(Progress, TheOnlyWorkerHasTwoTries) {
  worker("a");
  job("j", 2);
  stand_still("a", *lease("a"), stuck_seconds + 5);
  EXPECT_FALSE(has_ended(job_row("j").state));
  std::optional<Lease> again;
  for (int i = 0; i < 100 && !again; ++i) {
    at(clock + 1);
    again = lease("a");  // idle: it has begun again
  }
  ASSERT_TRUE(again);
  stand_still("a", *again, stuck_seconds + 5);
  EXPECT_EQ(job_row("j").state, JobState::failed);
}

// Claim: a worker is leased nothing, and is not idle, drained or paused, while it still computes a unit that
// was cancelled; when it names the unit no more, or asks as an idle worker, it is.
TEST_F(Progress, CancelledUnitsKeepTheirWorkers) {
  worker("a");
  job("j", 100);
  job("k", 100);
  const Lease l = *lease("a");
  beat("a", {{l.row.token, WorkPhase::rendering, 1}});
  ASSERT_TRUE(s->cancel("j", now()).ok());
  EXPECT_EQ(state("a"), "busy");
  EXPECT_FALSE(lease("a", true)) << "it renders still";
  EXPECT_EQ(beat("a", {{l.row.token, WorkPhase::rendering, 2}}).revoked.size(), 1U);
  ASSERT_TRUE(s->drain("a", now()).ok());
  EXPECT_EQ(state("a"), "draining");
  at(clock + 1);
  beat("a", {{l.row.token, WorkPhase::rendering, 2}});
  EXPECT_EQ(state("a"), "draining");
  at(clock + 25);
  beat("a", {{l.row.token, WorkPhase::rendering, 2}});
  EXPECT_EQ(state("a"), "stuck") << "told to stop, and goes on";
  beat("a", {});
  EXPECT_EQ(state("a"), "drained");
}

TEST_F(Progress, AnIdleWorkerComputesNothing) {
  worker("a");
  job("j", 100);
  job("k", 100);
  const Lease l = *lease("a");
  beat("a", {{l.row.token, WorkPhase::rendering, 1}});
  ASSERT_TRUE(s->cancel(l.row.job_id, now()).ok());
  EXPECT_FALSE(lease("a", true));
  EXPECT_TRUE(lease("a", false));
}

// Claim: a unit that comes back while its worker still stops is not the end of the worker's work; one that
// only waited is.
TEST_F(Progress, HandedBackUnitsMayStillBeComputed) {
  worker("a");
  job("j", 100);
  const Lease l = *lease("a"), behind = *lease("a", true);
  beat("a", {{l.row.token, WorkPhase::rendering, 1}, {behind.row.token, WorkPhase::waiting, 0}});
  ASSERT_TRUE(s->drain("a", now()).ok());
  s->return_lease("a", behind.row.token, now());
  s->return_lease("a", l.row.token, now(), true);
  EXPECT_EQ(s->lease_count(), 0U);
  EXPECT_EQ(state("a"), "draining");
  beat("a", {});
  EXPECT_EQ(state("a"), "drained");
}

// Claim: a delta may have fewer iterations than its lease; the others are leased anew, and every index of the
// job is merged once, whatever is cut and whoever delivers late.
TEST_F(Progress, CutUnitsTileTheJob) {
  for (const char* w : {"a", "b", "c"}) worker(w);
  job("j", 401, 0, 0.1);
  std::uint64_t random = 1;
  const auto draw = [&](std::uint64_t n) { return (random = rng::key(random, 5)) % n; };
  std::map<std::string, std::vector<Lease>> held;
  for (int step = 0; step < 5000 && !s->job("j")->finishing; ++step) {
    at(clock + 0.5);
    const std::string w(1, static_cast<char>('a' + draw(3)));
    auto& mine = held[w];
    if (mine.empty() || (mine.size() < 2 && draw(2) == 0)) {
      if (const auto l = lease(w, !mine.empty())) mine.push_back(*l);
      continue;
    }
    const Lease l = mine.front();
    mine.erase(mine.begin());
    const auto u = s->job("j")->units.find(l.row.unit_id);
    if (u == s->job("j")->units.end()) continue;  // another had it
    Unit unit = u->second.row.unit;
    const Unit whole = unit;
    if (draw(2) == 0) unit.end = unit.begin + 1 + draw(unit.end - unit.begin);
    if (draw(5) == 0) {
      s->return_lease(w, l.row.token, now());
    } else if (deliver(l, unit) == Delivery::ok) {
      EXPECT_NE(deliver(l, whole), Delivery::ok) << "its lease is gone";
    }
  }
  ASSERT_TRUE(s->job("j")->finishing);
  EXPECT_EQ(s->job("j")->merged[0].count(), 201U);
  EXPECT_EQ(s->job("j")->merged[1].count(), 200U);
}

// Claim: a unit can be cut short from its end alone, to one iteration or more.
TEST_F(Progress, UnitsAreCutFromTheirEnd) {
  worker("a");
  job("j", 100, 0, 0.1);
  const Lease l = *lease("a");
  const Unit u = unit_of(l);
  ASSERT_GE(u.end - u.begin, 2U);
  Unit bad = u;
  bad.begin += 1;
  EXPECT_EQ(deliver(l, bad), Delivery::stale);
  bad = u;
  bad.end = bad.begin;
  EXPECT_NE(deliver(l, bad), Delivery::ok);
}

// Claim: where a job of higher priority waits and no worker is idle, as many units of lower priority are cut
// short as it can use workers, those that would last longest first; none for one that can be served.
TEST_F(Progress, UrgentJobsCutUnits) {
  for (const char* w : {"a", "b", "c"}) worker(w);
  job("low", 100'000, 0, 20);  // units of one iteration
  std::map<std::string, Lease> held;
  for (const char* w : {"a", "b", "c"}) {
    held.emplace(w, *lease(w));
    at(clock + 1);
  }
  s->submit(
      [] {
        JobRow j = row("urgent", 100);
        j.priority = 5;
        return j;
      }(),
      now());
  s->tick(now());
  EXPECT_EQ(events("cut").size(), 1U) << "a pilot needs one worker";
  std::string cut_worker;
  for (const char* w : {"a", "b", "c"})
    if (!beat(w, {{held.at(w).row.token, WorkPhase::rendering, 1}}).cut.empty()) cut_worker += w;
  ASSERT_EQ(cut_worker.size(), 1U);
  s->tick(at(clock + 1));
  EXPECT_TRUE(events("cut").empty()) << "it is asked once";
  const Lease& l = held.at(cut_worker);
  EXPECT_EQ(deliver(l, unit_of(l), 20), Delivery::ok);
  const auto pilot = lease(cut_worker);
  ASSERT_TRUE(pilot);
  EXPECT_EQ(pilot->row.job_id, "urgent");
  ASSERT_TRUE(s->complete_pilot(cut_worker, pilot->row.token, {NamedState{20}, "", 1}, now()));
  s->tick(at(clock + 1));
  EXPECT_EQ(events("cut").size(), 2U) << "its film can use all";
}

// Claim: an idle worker, or one that is about to be, serves an urgent job: no unit is cut then. Nor is one
// for a job of the same priority.
TEST_F(Progress, NothingIsCutWithoutNeed) {
  worker("a");
  worker("b");
  job("low", 100'000, 0, 20);
  ASSERT_TRUE(lease("a"));
  JobRow urgent = row("urgent", 100);
  urgent.priority = 5;
  s->submit(urgent, now());
  s->submit(row("equal", 100), now());
  s->tick(now());
  EXPECT_TRUE(events("cut").empty());
}

// Claim: an urgent job's unit that waits on a worker behind a long unit has that one cut.
TEST_F(Progress, WaitingBehindALongUnitIsNoService) {
  worker("a");
  job("low", 100'000, 0, 20);
  const Lease l = *lease("a");
  JobRow urgent = row("urgent", 100);
  urgent.priority = 5;
  s->submit(urgent, now());
  ASSERT_EQ(lease("a", true)->row.job_id, "urgent");
  s->tick(now());
  EXPECT_EQ(beat("a", {{l.row.token, WorkPhase::rendering, 1}}).cut, std::vector<std::uint64_t>{l.row.token});
}

// Claim: --time counts while a unit of the job is under way: not while another job has all workers, and not
// while a unit of it only waits behind another job's.
TEST_F(Progress, TimeIsThatOfUnitsUnderWay) {
  worker("a");
  JobRow timed = row("timed", 0);
  timed.stop = {};
  timed.stop.time_seconds = 10;
  timed.named_state = NamedState{20};
  timed.thread_seconds_per_iteration = 1;
  s->restore(timed, {}, {}, {}, {}, now());
  const Lease first = *lease("a");
  at(clock + 0.3);
  EXPECT_EQ(deliver(first, unit_of(first)), Delivery::ok);
  job("urgent", 100'000, 5);
  const Lease urgent = *lease("a");
  ASSERT_EQ(urgent.row.job_id, "urgent");
  for (int i = 0; i < 100; ++i) {
    at(clock + 2);
    beat("a", {{urgent.row.token, WorkPhase::rendering, static_cast<std::uint64_t>(i)}});
    s->tick(now());
  }
  EXPECT_NEAR(job_row("timed").elapsed_seconds, 0.3, 1e-9);
  EXPECT_FALSE(s->job("timed")->finishing);
  EXPECT_EQ(job_row("timed").state, JobState::queued) << "no worker has a unit of it";
  ASSERT_TRUE(s->set_priority("timed", 9, now()).ok());
  const Lease behind = *lease("a", true);
  ASSERT_EQ(behind.row.job_id, "timed");
  EXPECT_EQ(job_row("timed").state, JobState::running);
  s->tick(at(clock + 3));
  EXPECT_NEAR(job_row("timed").elapsed_seconds, 0.3, 1e-9) << "it waits behind the other";
  EXPECT_EQ(deliver(urgent, unit_of(urgent)), Delivery::ok);
  s->tick(at(clock + 4));
  EXPECT_NEAR(job_row("timed").elapsed_seconds, 4.3, 1e-9);
}

// Claim: a worker that is not heard of is lost, by an event with its name, and back by another; after a
// restart of the master it is awaited, not idle, until it calls.
TEST_F(Progress, LossesAreTold) {
  worker("a");
  job("j", 100);
  const Lease l = *lease("a");
  beat("a", {{l.row.token, WorkPhase::rendering, 1}});
  events("");
  s->tick(at(clock + 11));
  const std::vector<std::string> lost = events("lost");
  ASSERT_EQ(lost.size(), 1U);
  EXPECT_NE(lost[0].find("a on "), std::string::npos) << lost[0];
  s->tick(at(clock + 1));
  EXPECT_TRUE(events("lost").empty()) << "told once";
  beat("a", {});
  EXPECT_EQ(events("back").size(), 1U);

  const WorkerRow old = s->workers().at("a").row;
  s = std::make_unique<Scheduler>(options(), 2, 100);
  s->restore_worker(old, now());
  EXPECT_EQ(state("a"), "awaited");
  s->tick(at(clock + 11));
  EXPECT_EQ(state("a"), "lost");
  EXPECT_EQ(events("lost").size(), 1U);
  beat("a", {});
  EXPECT_EQ(state("a"), "idle");
}

// Claim: a paused worker gets nothing and its unit is cut short; the pause holds for its name, also when its
// program starts again; a resumed one works.
TEST_F(Progress, WorkersCanBePaused) {
  worker("a");
  job("j", 1000);
  const Lease l = *lease("a");
  ASSERT_TRUE(s->pause_worker("a", now()).ok());
  ASSERT_TRUE(s->pause_worker("a", now()).ok());
  EXPECT_EQ(state("a"), "pausing");
  EXPECT_EQ(beat("a", {{l.row.token, WorkPhase::rendering, 1}}).cut.size(), 1U);
  Unit part = unit_of(l);
  part.end = part.begin + 1;
  EXPECT_EQ(deliver(l, part), Delivery::ok);
  EXPECT_EQ(state("a"), "paused");
  EXPECT_FALSE(lease("a"));
  EXPECT_EQ(s->wanted(now()).workers, 1U) << "as with no worker";
  s->deregister("a", now());
  worker("a");
  EXPECT_EQ(state("a"), "paused");
  EXPECT_FALSE(lease("a"));
  ASSERT_TRUE(s->resume_worker("a", now()).ok());
  EXPECT_TRUE(lease("a"));
  EXPECT_FALSE(s->pause_worker("nobody", now()).ok());
  ASSERT_TRUE(s->drain("a", now()).ok());
  EXPECT_FALSE(s->pause_worker("a", now()).ok());
}

}  // namespace
}  // namespace candela::master
