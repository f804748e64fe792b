// The consequences of failed units, by cause: the policy, and the scheduler that lives by it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "master/scheduler/failure.h"
#include "tests/unit/scheduler_fixture.h"

namespace candela::master {
namespace {

// Claim: each wait doubles from its first to its longest, is at most a quarter off, differs between units and
// is the same whenever it is asked; a scene's unit is free for others at once.
TEST(FailurePolicy, WaitsDoubleWithJitter) {
  const FailurePolicy policy;
  struct Case {
    FailureCause cause;
    double unit_first, unit_longest, worker_first, worker_longest;
  };
  for (const Case& c : {Case{FailureCause::worker, 1, 60, 1, 60}, Case{FailureCause::place, 0.5, 8, 2, 60},
                        Case{FailureCause::network, 0.5, 8, 0.5, 60},
                        Case{FailureCause::master, 1, 60, 1, 60}, Case{FailureCause::scene, 0, 0, 2, 60}}) {
    SCOPED_TRACE(std::string(name(c.cause)));
    for (std::uint32_t n = 1; n < 40; ++n) {
      FailureHistory h;
      h.cause = c.cause;
      h.unit_id = 7;
      h.worker_id = "w";
      h.of_unit = h.at_job = n;
      const Consequence then = consequence(h, policy);
      EXPECT_EQ(then.unit_wait, consequence(h, policy).unit_wait);
      const double unit = std::min(c.unit_first * std::pow(2.0, n - 1), c.unit_longest);
      const double worker = std::min(c.worker_first * std::pow(2.0, n - 1), c.worker_longest);
      EXPECT_GE(then.unit_wait, 0.75 * unit);
      EXPECT_LE(then.unit_wait, 1.25 * unit);
      EXPECT_GE(then.worker_wait, 0.75 * worker);
      EXPECT_LE(then.worker_wait, 1.25 * worker);
      h.unit_id = 8;
      if (unit > 0) {
        EXPECT_NE(then.unit_wait, consequence(h, policy).unit_wait);
      }
      h.worker_id = "v";
      EXPECT_NE(then.worker_wait, consequence(h, policy).worker_wait);
    }
  }
}

// Claim: a worker is set aside for five failures in a row of its own causes, or failures at three jobs, for a
// minute and then twice as long each time, ten minutes at most; never for the scene, the network or the
// master.
TEST(FailurePolicy, WorkersAreSetAsideForTheirOwnCauses) {
  const FailurePolicy policy;
  FailureHistory h;
  h.own = 5;
  for (const FailureCause cause : kAllFailureCauses) {
    h.cause = cause;
    EXPECT_EQ(consequence(h, policy).set_aside > 0, is_workers_own(cause)) << name(cause);
  }
  h.cause = FailureCause::place;
  h.own = 4;
  EXPECT_EQ(consequence(h, policy).set_aside, 0);
  h.own_jobs = 3;
  std::vector<double> times;
  for (h.times_set_aside = 0; h.times_set_aside < 6; ++h.times_set_aside)
    times.push_back(consequence(h, policy).set_aside);
  EXPECT_EQ(times, (std::vector<double>{60, 120, 240, 480, 600, 600}));
}

// Claim: a unit is given up after six failures on three workers, or on all there are; after twelve in any
// case. A scene is given up when two say so, or all there are.
TEST(FailurePolicy, WhenAJobIsGivenUp) {
  const FailurePolicy policy;
  EXPECT_FALSE(is_poison({5.5, 3, 3}, policy));
  EXPECT_TRUE(is_poison({6, 3, 50}, policy));
  EXPECT_FALSE(is_poison({6, 2, 50}, policy));
  EXPECT_TRUE(is_poison({6, 2, 2}, policy));
  EXPECT_TRUE(is_poison({6, 1, 1}, policy));
  EXPECT_TRUE(is_poison({12, 1, 50}, policy));
  EXPECT_FALSE(is_refused(0, 0));
  EXPECT_FALSE(is_refused(1, 1));
  EXPECT_TRUE(is_refused(1, 0));
  EXPECT_TRUE(is_refused(2, 5));
}

class FailureTest : public SchedulerFixture {
 protected:
  void job(const std::string& id, std::uint64_t iterations, bool pilot_done = true) {
    JobRow j = row(id, iterations);
    if (pilot_done) {
      j.named_state = NamedState{20};
      j.thread_seconds_per_iteration = 1;
      s->restore(j, {}, {}, {}, {}, now());  // as after a pilot
    } else {
      s->submit(j, now());
    }
  }
  Delivery deliver(const Lease& l) { return SchedulerFixture::deliver(l, unit_of(l), {}, 1); }
  void fail(const Lease& l, FailureCause cause, const std::string& message = "boom") {
    s->fail_unit(l.row.worker_id, l.row.token, cause, message, now());
  }
  std::string message(const std::string& id) { return s->message_of(*s->job(id), now()); }
  JobState state(const std::string& id) { return s->job(id)->row.state; }
  // All workers live; time goes on in steps until somebody has a lease, or too long.
  std::optional<Lease> next(const std::vector<std::string>& workers, double most_seconds = 1000) {
    for (const double end = clock + most_seconds; clock < end; at(clock + 0.05)) {
      s->tick(now());
      for (const std::string& w : workers)
        if (auto l = lease(w)) return l;
    }
    return std::nullopt;
  }
  std::vector<std::string> events(const std::string& kind) {
    for (Change& c : s->take_changes())
      if (auto* e = std::get_if<AddEvent>(&c)) told_.emplace(e->row.kind, e->row.message);
    std::vector<std::string> out;
    for (auto [it, end] = told_.equal_range(kind); it != end; ++it) out.push_back(it->second);
    return out;
  }

 private:
  std::multimap<std::string, std::string> told_;
};

// Claim: a cause that is not the scene's never fails a job, however long it lasts: a night of a full disk, or
// of a bad line. The unit waits longer and longer, though never much above a minute; then the job goes on.
class NeverFails : public FailureTest, public testing::WithParamInterface<FailureCause> {};
TEST_P(NeverFails, WhateverTheNight) {
  worker("a");
  job("j", 4);
  const double night = clock + 8 * 3600;
  int attempts = 0;
  double longest = 0;
  while (clock < night) {
    const double before = clock;
    const auto l = next({"a"});
    ASSERT_TRUE(l) << clock;
    longest = std::max(longest, clock - before);
    ++attempts;
    fail(*l, GetParam(), "cannot write to the cache: No space left on device");
    EXPECT_FALSE(lease("a")) << "not at once";
    ASSERT_NE(state("j"), JobState::failed) << message("j");
    EXPECT_NE(message("j").find("No space left on device"), std::string::npos) << message("j");
    EXPECT_NE(message("j").find(name(GetParam())), std::string::npos) << message("j");
    EXPECT_NE(message("j").find("tried again at"), std::string::npos) << message("j");
    const auto waiting = s->waiting_of(*s->job("j"), now());
    ASSERT_TRUE(waiting);
    EXPECT_EQ(waiting->cause, GetParam());
    EXPECT_GT(waiting->retry_unix_ms, now().unix_ms);
  }
  EXPECT_GT(attempts, 30) << "it is tried time and again";
  EXPECT_LT(attempts, 2000) << "but not in a loop";
  EXPECT_LT(longest, 700);
  EXPECT_EQ(events("waiting").size(), 1U) << "told once";
  const auto i = index_of(GetParam());
  EXPECT_EQ(s->failures()[i], static_cast<std::uint64_t>(attempts));
  EXPECT_EQ(s->job("j")->failures[i], static_cast<std::uint64_t>(attempts));
  EXPECT_EQ(s->workers().at("a").failures[i], static_cast<std::uint64_t>(attempts));
  for (int n = 0; n < 20 && !s->job("j")->finishing; ++n) {
    const auto l = next({"a"});
    ASSERT_TRUE(l);
    ASSERT_EQ(deliver(*l), Delivery::ok);
  }
  EXPECT_TRUE(s->job("j")->finishing);
  EXPECT_FALSE(s->waiting_of(*s->job("j"), now()));
}
INSTANTIATE_TEST_SUITE_P(Cause, NeverFails,
                         testing::Values(FailureCause::place, FailureCause::network, FailureCause::master),
                         [](const auto& one) { return std::string(name(one.param)); });

// Claim: a unit that waits is not offered, another worker has it as soon as its own wait is over, and a
// worker that waits for one job renders others, also as a prefetch.
TEST_F(FailureTest, AWaitStarvesNobody) {
  worker("a");
  worker("b");
  job("j", 1);
  job("k", 1000);
  std::optional<Lease> l;
  while ((l = lease("a")) && l->row.job_id != "j") ASSERT_EQ(deliver(*l), Delivery::ok);
  ASSERT_TRUE(l);
  fail(*l, FailureCause::place);
  const std::uint64_t unit = l->row.unit_id;
  for (int i = 0; i < 5; ++i) {
    const auto other = lease("a", i % 2 == 1);
    ASSERT_TRUE(other);
    EXPECT_EQ(other->row.job_id, "k");
    deliver(*other);
  }
  EXPECT_EQ(lease("b")->row.job_id, "k") << "the unit's own wait";
  at(clock + 0.7);
  for (int i = 0; i < 5; ++i) {
    const auto given = lease("b");
    ASSERT_TRUE(given);
    if (given->row.job_id != "j") continue;
    EXPECT_EQ(given->row.unit_id, unit);
    return;
  }
  FAIL() << "another worker does not get the unit";
}

// Claim: one worker's full disk costs the farm nothing but that worker: others end the job in the meantime.
TEST_F(FailureTest, OthersGoOnMeanwhile) {
  worker("full");
  worker("good");
  job("j", 40);
  while (!s->job("j")->finishing) {
    const auto l = next({"full", "good"}, 100);
    ASSERT_TRUE(l);
    if (l->row.worker_id == "full") {
      fail(*l, FailureCause::place, "disk full");
      EXPECT_NE(s->workers().at("full").message.find("place: disk full"), std::string::npos);
    } else {
      ASSERT_EQ(deliver(*l), Delivery::ok);
    }
    at(clock + 0.2);
  }
  EXPECT_EQ(s->job("j")->row.iterations, 40U);
  EXPECT_LT(clock, 140);
}

// Claim: the scene is at fault when two workers say so, at once where there is one only, and not by one
// worker's word where another gets on with it; that one is told of.
TEST_F(FailureTest, TwoMustNameTheScene) {
  worker("a");
  job("lonely", 1, false);
  fail(*lease("a"), FailureCause::scene, "scene.xml:3: no such file");
  EXPECT_EQ(state("lonely"), JobState::failed);
  EXPECT_EQ(s->job("lonely")->row.message, "scene.xml:3: no such file");

  worker("b");
  job("j", 1, false);
  fail(*lease("a"), FailureCause::scene, "scene.xml:3: no such file");
  EXPECT_EQ(state("j"), JobState::running);
  EXPECT_NE(message("j").find("scene.xml:3"), std::string::npos);
  at(clock + 5);
  s->authenticate("b", "session-b", now());
  EXPECT_FALSE(lease("a")) << "it has had its say";
  const auto second = lease("b");
  ASSERT_TRUE(second);
  fail(*second, FailureCause::scene, "scene.xml:3: no such file");
  EXPECT_EQ(state("j"), JobState::failed);

  job("k", 4);
  const auto wrong = next({"a"});
  ASSERT_TRUE(wrong);
  fail(*wrong, FailureCause::scene, "unknown plugin");
  while (!s->job("k")->finishing) {
    const auto l = next({"b"});
    ASSERT_TRUE(l);
    deliver(*l);
  }
  EXPECT_EQ(events("scene-disputed").size(), 1U);
  EXPECT_EQ(s->workers().at("a").row.units_failed, 0U);
}

// Claim: where the other worker goes before it was asked, the word of the one that is left counts.
TEST_F(FailureTest, TheLastWitnessDecides) {
  worker("a");
  worker("b");
  job("j", 1, false);
  fail(*lease("a"), FailureCause::scene, "no such file");
  EXPECT_EQ(state("j"), JobState::running);
  s->deregister("b", now());
  s->tick(now());
  EXPECT_EQ(state("j"), JobState::failed);
}

// Claim: a unit that fails by its worker wherever it is tried ends its job, with a message that says so; the
// attempts take tens of seconds, whether there is one worker or five, and no worker has it twice before each
// has had it once.
TEST_F(FailureTest, APoisonUnitEndsItsJob) {
  for (const int count : {1, 2, 5}) {
    SCOPED_TRACE(count);
    s = std::make_unique<Scheduler>(options(), 1, 1);
    std::vector<std::string> names;
    for (int i = 0; i < count; ++i) {
      names.emplace_back(1, static_cast<char>('a' + i));
      worker(names.back());
    }
    job("j", 1);
    const double started = clock;
    std::map<std::string, int> times;
    int attempts = 0;
    while (state("j") != JobState::failed && attempts < 50) {
      const auto l = next(names);
      ASSERT_TRUE(l);
      ++attempts;
      ++times[l->row.worker_id];
      if (attempts <= count) {
        EXPECT_EQ(times[l->row.worker_id], 1);
      }
      fail(*l, FailureCause::worker, "out of memory");
    }
    EXPECT_EQ(attempts, 6);
    EXPECT_GT(clock - started, 20);
    EXPECT_LT(clock - started, 200);
    const std::string text = s->job("j")->row.message;
    EXPECT_NE(text.find("out of memory"), std::string::npos) << text;
    EXPECT_NE(text.find("failed 6 times"), std::string::npos) << text;
    EXPECT_NE(text.find("candela resume j"), std::string::npos) << text;
  }
}

// Claim: a scene whose every unit fails by the worker ends its job as well, though there is always another
// unit to cut.
TEST_F(FailureTest, AJobWhoseEveryUnitFailsEnds) {
  const std::vector<std::string> names{"a", "b", "c"};
  for (const std::string& n : names) worker(n);
  job("j", 100000);
  int attempts = 0;
  const double started = clock;
  while (state("j") != JobState::failed && attempts < 200) {
    const auto l = next(names);
    ASSERT_TRUE(l);
    ++attempts;
    fail(*l, FailureCause::worker);
  }
  EXPECT_EQ(state("j"), JobState::failed);
  EXPECT_LT(attempts, 60);
  EXPECT_LT(clock - started, 1000);
}

// Claim: a unit that ends the process of each worker that has it ends its job too; the units that only waited
// on those workers are not blamed, and one worker's death costs no wait.
TEST_F(FailureTest, AUnitThatKillsWorkersEndsItsJob) {
  job("j", 1000);
  const auto row_of = [](const Lease& l) { return l.row.unit_id; };
  std::uint64_t poison = 0;
  int deaths = 0;
  for (; deaths < 50 && state("j") != JobState::failed; ++deaths) {
    const std::string id = fmt::format("w{}", deaths);
    worker(id);
    const auto first = next({id});
    ASSERT_TRUE(first);
    if (poison == 0) poison = row_of(*first);
    const auto waiting = lease(id, true);
    ASSERT_TRUE(waiting);
    std::vector<std::uint64_t> tokens{first->row.token, waiting->row.token};
    if (row_of(*first) != poison) {  // an innocent one: done
      deliver(*first);
      std::erase(tokens, first->row.token);
    }
    s->heartbeat(id, {tokens.begin(), tokens.end()}, now());
    // It dies; its leases run out.
    const double before = clock;
    for (at(clock + 1); clock < before + 25; at(clock + 1)) s->tick(now());
    if (deaths == 0) {
      EXPECT_FALSE(s->job("j")->units.at(poison).waits(clock));
    }
  }
  EXPECT_EQ(state("j"), JobState::failed);
  EXPECT_GE(deaths, 12);
  EXPECT_NE(s->job("j")->row.message.find("lost with its worker"), std::string::npos)
      << s->job("j")->row.message;
}

// Claim: a worker that fails at three jobs is set aside, is shown with the cause, and is on probation after
// its time: one more failure sets it aside again, for longer; a delivery clears it.
TEST_F(FailureTest, SetAsideIsProbation) {
  worker("a");
  for (const char* id : {"i", "j", "k"}) job(id, 1000);
  for (int n = 0; n < 3; ++n) fail(*lease("a"), FailureCause::place, "disk full");
  EXPECT_FALSE(lease("a"));
  const WorkerState& w = s->workers().at("a");
  EXPECT_EQ(s->worker_state_name(w, now()), "set-aside");
  EXPECT_NE(w.message.find("place: disk full"), std::string::npos) << w.message;
  EXPECT_NEAR(w.set_aside_until - clock, 60, 1);
  const auto probation = next({"a"});
  ASSERT_TRUE(probation);
  fail(*probation, FailureCause::worker, "crash");
  EXPECT_EQ(w.set_aside_until, 0) << "another cause of its own at one job is one failure";
  while (w.set_aside_until <= clock) fail(*next({"a"}), FailureCause::place, "disk full");
  EXPECT_NEAR(w.set_aside_until - clock, 120, 1);
  const auto good = next({"a"});
  ASSERT_TRUE(good);
  deliver(*good);
  EXPECT_EQ(w.times_set_aside, 0U);
  EXPECT_TRUE(w.message.empty());
}

// Claim: a lease whose inputs the master cannot give makes its unit wait, and neither the worker nor other
// units and jobs; the worker is not blamed.
TEST_F(FailureTest, LackOfInputsIsNobodysFault) {
  worker("a");
  job("j", 1);
  const auto l = lease("a");
  ASSERT_TRUE(l);
  s->lack_inputs("a", l->row.token, "the film has lost segments", now());
  EXPECT_FALSE(lease("a"));
  EXPECT_NE(message("j").find("the film has lost segments"), std::string::npos);
  EXPECT_EQ(s->workers().at("a").row.units_failed, 0U);
  EXPECT_EQ(s->failures()[index_of(FailureCause::master)], 1U);
  int offers = 0;
  for (const double end = clock + 600; clock < end;) {
    const auto again = next({"a"}, end - clock);
    if (!again) break;
    ++offers;
    EXPECT_EQ(again->row.unit_id, l->row.unit_id);
    s->lack_inputs("a", again->row.token, "the film has lost segments", now());
  }
  EXPECT_GT(offers, 5);
  EXPECT_LT(offers, 25);
  EXPECT_FALSE(has_ended(state("j")));
  job("k", 10);
  EXPECT_EQ(lease("a")->row.job_id, "k");
}

// Claim: the job's message names a blob that the master has lost; with the blob there again the waits end.
TEST_F(FailureTest, ALostBlobIsSaidAndItsReturnEndsTheWait) {
  worker("a");
  job("j", 1);
  fail(*lease("a"), FailureCause::master, "blob is damaged");
  EXPECT_TRUE(s->lack_blob("j", "hash", "'wood.png' is damaged: submit the scene again", now()));
  EXPECT_FALSE(s->lack_blob("j", "hash", "again", now())) << "no news";
  EXPECT_EQ(message("j"), "'wood.png' is damaged: submit the scene again");
  EXPECT_FALSE(lease("a"));
  s->blob_arrived("another", now());
  EXPECT_FALSE(lease("a"));
  s->blob_arrived("hash", now());
  EXPECT_TRUE(lease("a"));
  EXPECT_EQ(message("j").find("wood.png"), std::string::npos);
}

// Claim: a failed job goes on from what is merged, its failures forgotten; extending it is refused with that
// mend; one that lost where its chains start says why it cannot.
TEST_F(FailureTest, AFailedJobCanBeResumed) {
  worker("a");
  job("j", 8);
  ASSERT_EQ(deliver(*lease("a")), Delivery::ok);
  const std::uint64_t had = s->job("j")->row.iterations;
  ASSERT_GT(had, 0U);
  while (state("j") != JobState::failed) fail(*next({"a"}), FailureCause::worker, "a bug");
  const auto refused = s->extend("j", 8, 0, 0, now());
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().mend.find("candela resume j"), std::string::npos);
  ASSERT_TRUE(s->resume("j", now()).ok());
  EXPECT_EQ(state("j"), JobState::queued);
  EXPECT_TRUE(s->job("j")->row.message.empty());
  EXPECT_EQ(s->job("j")->row.finished_unix_ms, 0);
  EXPECT_EQ(s->job("j")->row.iterations, had);
  while (!s->job("j")->finishing) {
    const auto l = lease("a");
    ASSERT_TRUE(l) << "nothing waits, nobody is set aside";
    ASSERT_EQ(deliver(*l), Delivery::ok);
  }
  for (const auto& half : s->job("j")->merged) EXPECT_EQ(half.count(), 4U);

  job("pilot", 4, false);
  fail(*next({"a"}), FailureCause::scene, "no such file");
  ASSERT_EQ(state("pilot"), JobState::failed);
  ASSERT_TRUE(s->resume("pilot", now()).ok());
  EXPECT_EQ(unit_of(*lease("a")).kind, Unit::Kind::pilot);

  JobRow chains = row("chains", 4);
  chains.state = JobState::failed;
  chains.layers = {"independent"};
  chains.chains = ChainPlan{4, 10, 100};
  chains.named_state = NamedState{20, 0.5};
  s->restore(chains, {}, {}, {}, {}, now());
  const auto lost = s->resume("chains", now());
  ASSERT_FALSE(lost.ok());
  EXPECT_NE(lost.error().to_string().find("submit the job again"), std::string::npos)
      << lost.error().to_string();
}

// Claim: resuming a job that waits tries again at once, also with the workers that were set aside for it.
TEST_F(FailureTest, ResumeTriesAgainNow) {
  worker("a");
  job("j", 1);
  while (s->workers().at("a").set_aside_until <= clock) fail(*next({"a"}), FailureCause::place, "disk full");
  EXPECT_FALSE(lease("a"));
  ASSERT_TRUE(s->resume("j", now()).ok());
  EXPECT_TRUE(lease("a"));
}

}  // namespace
}  // namespace candela::master
