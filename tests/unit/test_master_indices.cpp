// The scheduler with jobs that are asked for exact indices, and with jobs whose halves are levelled when
// their time is up.
#include <gtest/gtest.h>

#include <algorithm>

#include "common/rng/stream.h"
#include "common/stages/epochs.h"
#include "tests/unit/scheduler_fixture.h"

namespace candela::master {
namespace {

constexpr std::uint32_t kPixels = 64;

HalfSets sets_of(const std::string& text) {
  auto sets = film::parse_half_indices(text);
  EXPECT_TRUE(sets.ok()) << text;
  return *sets;
}

class IndicesTest : public SchedulerFixture {
 protected:
  void submit(const std::string& indices, const WorkPlan& work = {}) {
    JobRow j = row("j", 0);
    j.stop_indices = sets_of(indices);
    s->submit(j, now());
    worker("pilot");
    const auto l = lease("pilot");
    ASSERT_TRUE(l);
    PilotResult result{NamedState{17}, "plan", 1, work};
    ASSERT_TRUE(s->complete_pilot("pilot", l->row.token, result, now()));
    s->deregister("pilot", now());
  }
  Delivery deliver(const Lease& l, const Unit& u, double seconds = 1) {
    film::SampleCounts sample_counts;
    sample_counts.eye_samples = (u.end - u.begin) * kPixels;
    return SchedulerFixture::deliver(l, u, sample_counts, seconds, 100);
  }
  const Job& job() { return *s->job("j"); }
  // Workers a, b, c take, deliver, hand back and lose units at random until nobody gets one any more.
  void render_at_random(std::uint64_t seed) {
    rng::Stream stream(rng::key(seed, 9));
    std::vector<std::pair<Lease, Unit>> held;
    for (int step = 0; step < 20000 && !job().finishing; ++step) {
      at(clock + 0.01);
      const std::string w(1, static_cast<char>('a' + static_cast<int>(stream.next_double() * 3)));
      const double u = stream.next_double();
      for (const EpochJob& d : s->epoch_jobs())
        if (d.due && u < 0.3) s->decided({"j", d.states, "rule", std::string(64, 'a'), 1}, now());
      if (u < 0.5) {
        if (const auto l = lease(w, stream.next_double() < 0.3)) held.emplace_back(*l, unit_of(*l));
      } else if (!held.empty()) {
        const auto [l, unit] = held.back();
        held.pop_back();
        if (u < 0.8)
          deliver(l, unit, 0.1);
        else if (u < 0.9)
          s->return_lease(l.row.worker_id, l.row.token, now());
        else
          s->fail_unit(l.row.worker_id, l.row.token, FailureCause::network, "cut off", now());
      } else {
        at(clock + 1);
      }
    }
  }
};

// Claim: whoever asks, delivers, hands back or fails, a job that is asked for exact indices merges these and
// no others, and ends with the reason "indices"; its extent, its bound and its need of workers are those of
// the set.
TEST_F(IndicesTest, TheyAreRenderedAndNoOthers) {
  for (const char* text : {"0-9/0-9", "3-5,9,20-40/1-2,30", "none/7", "0,2,4,6,8,10,12/1,3,5,7,9,11"}) {
    for (std::uint64_t seed = 0; seed < 5; ++seed) {
      SCOPED_TRACE(text);
      s = std::make_unique<Scheduler>(options(), 1, 1);
      clock = 100;
      submit(text);
      for (const char* w : {"a", "b", "c"}) worker(w);
      const HalfSets wanted = sets_of(text);
      const Extent extent = job().source->extent(job().view());
      EXPECT_TRUE(extent.bounded);
      EXPECT_EQ(extent.remaining, count(wanted));
      EXPECT_EQ(extent.cut, 0U);
      EXPECT_EQ(job().source->open_indices(job().view()), count(wanted));
      render_at_random(seed);
      ASSERT_TRUE(job().finishing);
      EXPECT_EQ(job().merged, wanted);
      s->finish("j", now());
      EXPECT_EQ(job().row.state, JobState::done);
      EXPECT_EQ(job().row.stop_reason, "indices");
    }
  }
}

// Claim: the same of a job of epochs, whose later units wait for decisions, and of one of chains, whose
// segments go on from each other; the bootstrap is whole whatever the set.
TEST_F(IndicesTest, EpochsAndChainsTooWithTheirOwnOrder) {
  WorkPlan epochs, chains;
  epochs.epochs = EpochPlan{6, 4, 1, "rule", {}};
  chains.layers = {"independent"};
  chains.chains = ChainPlan{8, 20, 100};
  for (const auto& [text, work] : {std::pair<std::string, WorkPlan*>{"0-11,14-15/0-11,13", &epochs},
                                   std::pair<std::string, WorkPlan*>{"0-6,8-9/0-3,5", &chains}}) {
    for (std::uint64_t seed = 0; seed < 5; ++seed) {
      SCOPED_TRACE(text);
      s = std::make_unique<Scheduler>(options(), 1, 1);
      clock = 100;
      submit(text, *work);
      for (const char* w : {"a", "b", "c"}) worker(w);
      while (job().in_bootstrap()) {
        const auto l = lease("a");
        ASSERT_TRUE(l);
        const Unit u = unit_of(*l);
        ASSERT_TRUE(s->complete_bootstrap("a", l->row.token, std::vector<float>(u.end - u.begin, 1.0F), {},
                                          0.01, now())
                        .ok());
      }
      render_at_random(seed);
      ASSERT_TRUE(job().finishing);
      EXPECT_EQ(job().merged, sets_of(text));
    }
  }
}

// Claim: indices that cannot be rendered without others end the job after its pilot, with the reason.
TEST_F(IndicesTest, ImpossibleSetsFailAfterThePilot) {
  WorkPlan epochs, chains;
  epochs.epochs = EpochPlan{6, 4, 1, "rule", {}};
  chains.layers = {"independent"};
  chains.chains = ChainPlan{8, 20, 100};
  // Epochs begin at indices 0, 3, 6, ...: epoch 2 is decided from [0, 3).
  EXPECT_EQ(Epochs(6, 4).begin_index(2), 6U);
  for (const auto& [text, work] : {std::pair<const char*, WorkPlan*>{"0-1,3-6/0-6", &epochs},
                                   std::pair<const char*, WorkPlan*>{"0-6/0-1", &epochs},
                                   std::pair<const char*, WorkPlan*>{"0-2,4-7/0-3", &chains},
                                   std::pair<const char*, WorkPlan*>{"0-3/9", &chains}}) {
    SCOPED_TRACE(text);
    s = std::make_unique<Scheduler>(options(), 1, 1);
    submit(text, *work);
    EXPECT_EQ(job().row.state, JobState::failed);
    EXPECT_NE(job().row.message.find("cannot be rendered without others"), std::string::npos)
        << job().row.message;
  }
}

// Claim: after a restart, and when the film turns out to have less, the job goes on with what its set lacks.
TEST_F(IndicesTest, ARestartKeepsTheSet) {
  JobRow j = row("j", 0);
  j.stop_indices = sets_of("0-3,8-11/2-9");
  j.state = JobState::running;
  j.named_state = NamedState{1};
  j.thread_seconds_per_iteration = 1;
  const HalfSets film = sets_of("0-1,8/2-4");
  s->restore(j, film, {}, {}, {}, now());
  for (const char* w : {"a", "b", "c"}) worker(w);
  EXPECT_EQ(job().source->extent(job().view()).remaining, 10U);
  render_at_random(1);
  EXPECT_EQ(job().merged, j.stop_indices);

  s = std::make_unique<Scheduler>(options(), 1, 1);
  for (const char* w : {"a", "b", "c"}) worker(w);
  s->restore(j, film, {}, {}, {}, now());
  s->reconcile("j", sets_of("0/3"), {}, {}, 1, "", now());
  render_at_random(2);
  EXPECT_EQ(job().merged, j.stop_indices);
}

// Claim: such a job cannot be extended, whether it runs or has ended.
TEST_F(IndicesTest, NothingIsAdded) {
  submit("0-3/0-3");
  for (const char* w : {"a", "b", "c"}) worker(w);
  for (int round = 0; round < 2; ++round) {
    const auto extended = s->extend("j", 5, 0, 0, now());
    ASSERT_FALSE(extended.ok());
    EXPECT_EQ(extended.error().kind, ErrorKind::refused);
    render_at_random(1);
    s->finish("j", now());
  }
  EXPECT_EQ(job().row.state, JobState::done);
}

// Claim: a job that was cancelled with gaps, and with indices beyond those that an extension asks for, gets
// the gaps rendered and ends.
TEST_F(IndicesTest, AnExtensionFillsGaps) {
  JobRow j = row("j", 0);
  j.stop.time_seconds = 100;
  j.state = JobState::cancelled;
  j.named_state = NamedState{1};
  j.thread_seconds_per_iteration = 1;
  s->restore(j, sets_of("0-9,12-13/0-11,14"), {}, {}, {}, now());
  for (const char* w : {"a", "b", "c"}) worker(w);
  ASSERT_TRUE(s->extend("j", 1, 0, 0, now()).ok());
  EXPECT_EQ(job().source->extent(job().view()).remaining, 3U);
  EXPECT_EQ(job().source->open_indices(job().view()), 3U);
  render_at_random(3);
  ASSERT_TRUE(job().finishing);
  EXPECT_EQ(job().merged, sets_of("0-13/0-12,14"));
}

class LevelTest : public IndicesTest {
 protected:
  // A job with a limit of time alone that has `film`, and whose iteration takes a thread so many seconds.
  // Workers a and b are at work on it.
  void timed(const std::string& film, double seconds_per_iteration, double limit = 100) {
    JobRow j = row("j", 0);
    j.stop.time_seconds = limit;
    j.state = JobState::running;
    j.named_state = NamedState{1};
    j.elapsed_seconds = limit - 1;
    j.thread_seconds_per_iteration = seconds_per_iteration;
    s->restore(j, sets_of(film), {}, {}, {}, now());
    worker("a");
    worker("b");
    held_.clear();
    for (const char* w : {"a", "b"}) {
      const auto l = lease(w);
      ASSERT_TRUE(l);
      held_.emplace_back(*l, unit_of(*l));
    }
  }
  // Renders until nobody gets a unit any more, each in so many seconds.
  void render(double seconds) {
    for (const auto& [l, u] : held_) {
      at(clock + seconds);
      deliver(l, u, seconds);
    }
    held_.clear();
    for (int i = 0; i < 100 && !job().finishing; ++i) {
      const auto l = lease("a");
      at(clock + seconds);
      s->tick(now());
      if (l) deliver(*l, unit_of(*l), seconds);
    }
  }
  std::vector<std::pair<Lease, Unit>> held_;
};

// Claim: where the time is up, halves that are not level, or have small gaps, become level before the job
// ends; units beyond are given up, and the job says what it does.
TEST_F(LevelTest, ALittleIsMissing) {
  for (const char* film : {"0-29/0-31", "0-31/0-30", "0-9,12-31/0-31", "0-31/0-3,5-20,22-31"}) {
    SCOPED_TRACE(film);
    s = std::make_unique<Scheduler>(options(), 1, 1);
    clock = 100;
    timed(film, 0.5);
    s->tick(at(clock + 1.5));
    ASSERT_FALSE(job().finishing);
    EXPECT_NE(s->message_of(job(), now()).find("no half of the image is behind"), std::string::npos)
        << s->message_of(job(), now());
    EXPECT_EQ(job().source->extent(job().view()).remaining + 0U,
              count(without(sets_of("0-31/0-31"), job().source->reserved())));
    render(0.2);
    ASSERT_TRUE(job().finishing);
    EXPECT_EQ(job().merged, sets_of("0-31/0-31"));
    EXPECT_EQ(job().row.stop_reason, "time");
    const auto changes = s->take_changes();
    const auto told = std::count_if(changes.begin(), changes.end(), [](const Change& change) {
      const auto* event = std::get_if<AddEvent>(&change);
      return event != nullptr && event->row.kind == "leveling";
    });
    EXPECT_EQ(told, 1);
  }
}

// Claim: halves that are level end at once, as do those that would need more than a unit's time, or more than
// a quarter of the time limit.
TEST_F(LevelTest, NothingOrTooMuchIsMissing) {
  const std::tuple<const char*, double, double> cases[] = {
      {"0-31/0-31", 0.5, 100}, {"0-31/0-11", 0.5, 100}, {"0-31/0-30", 5, 100}, {"0-31/0-29", 0.5, 1.5}};
  for (const auto& [film, seconds, limit] : cases) {
    SCOPED_TRACE(film);
    s = std::make_unique<Scheduler>(options(), 1, 1);
    clock = 100;
    timed(film, seconds, limit);
    s->tick(at(clock + 1.5));
    EXPECT_TRUE(job().finishing);
    EXPECT_EQ(job().merged, sets_of(film));
  }
}

// Claim: the time is exceeded by at most a unit's time, whatever becomes of the workers, also where the job
// is queued again meanwhile.
TEST_F(LevelTest, ItEndsInTime) {
  timed("0-31/0-29", 0.5);
  const double begin = clock + 1;  // when the time is up
  s->tick(at(clock + 1.1));
  ASSERT_FALSE(job().finishing);
  s->deregister("a", now());
  s->deregister("b", now());
  while (!job().finishing && clock < begin + 60) s->tick(at(clock + 0.25));
  EXPECT_LE(clock, begin + options().unit_seconds + 0.5);
  EXPECT_EQ(job().merged, sets_of("0-31/0-29"));
  EXPECT_EQ(job().row.stop_reason, "time");
}

// Claim: a cancel ends the job at once, also while it is being levelled; more time lets it go on past the
// level; a delta that was on its way and brings more raises the level.
TEST_F(LevelTest, OthersComeBetween) {
  timed("0-31/0-29", 0.5);
  s->tick(at(clock + 1.1));
  ASSERT_TRUE(job().level);
  ASSERT_TRUE(s->cancel("j", now()).ok());
  EXPECT_EQ(job().row.state, JobState::cancelled);
  EXPECT_EQ(job().merged, sets_of("0-31/0-29"));

  s = std::make_unique<Scheduler>(options(), 1, 1);
  clock = 100;
  timed("0-31/0-29", 0.5);
  s->tick(at(clock + 1.1));
  ASSERT_TRUE(job().level);
  ASSERT_TRUE(s->extend("j", 0, 50, 0, now()).ok());
  EXPECT_FALSE(job().level);
  render(0.1);
  EXPECT_GT(count(job().merged), 64U);

  s = std::make_unique<Scheduler>(options(), 1, 1);
  clock = 100;
  timed("0-31/0-29", 0.5);
  s->tick(at(clock + 1.1));
  ASSERT_TRUE(job().level);
  s->merged("a", 1ULL << 33, 77, "j", {Unit::Kind::iterations, 0, 32, 33}, {}, 0.1, 0.001, now());
  expect_invariants();
  ASSERT_FALSE(job().finishing);
  render(0.1);
  EXPECT_EQ(job().merged, sets_of("0-32/0-32"));
}

}  // namespace
}  // namespace candela::master
