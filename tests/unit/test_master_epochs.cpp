// The scheduler with jobs of epochs, against a clock of our own: borders, open epochs, decisions, restarts.
#include <gtest/gtest.h>

#include <algorithm>

#include "common/rng/stream.h"
#include "common/stages/epochs.h"
#include "tests/unit/scheduler_fixture.h"

namespace candela::master {
namespace {

const EpochPlan kPlan{6, 4, 1, "rule", {}};
const Epochs kEpochs(kPlan.first, kPlan.growth);

class EpochSchedulerTest : public SchedulerFixture {
 protected:
  void job(const std::string& id, std::uint64_t iterations) {
    s->submit(row(id, iterations), now());
    worker("pilot");
    const auto l = lease("pilot");
    PilotResult result;
    result.state = NamedState{17};
    result.seconds_per_iteration = 0.4;
    result.work.epochs = kPlan;
    ASSERT_TRUE(s->complete_pilot("pilot", l->row.token, result, now()));
    s->deregister("pilot", now());
  }
  static std::string hash_of(std::uint64_t epoch) {
    return std::string(63, '0') + static_cast<char>('a' + epoch);
  }
  // Decides what is due, once for each job. What must be merged before is merged.
  std::size_t decide() {
    std::size_t count = 0;
    for (const EpochJob& d : s->epoch_jobs()) {
      const Job& job = *s->job(d.job_id);
      EXPECT_EQ(d.states, job.states.size());
      if (!d.due) continue;
      ++count;
      for (std::uint32_t h = 0; h < 2; ++h)
        EXPECT_TRUE(contains(job.merged[h], 0, kEpochs.begin_index(epochs_before(d.states, kPlan.lag))));
      s->decided({d.job_id, d.states, "rule", hash_of(d.states), 1}, now());
    }
    return count;
  }
  // A lease with what came beside it.
  AcquireResult acquire(const std::string& w) {
    s->authenticate(w, "session-" + w, now());
    return s->acquire(w, {}, {}, now());
  }
};

// Claim: whoever asks, delivers, hands back or falls silent, and however late decisions come, no unit crosses
// a border, none is leased before its epoch's state is decided, each comes with that state, decisions come in
// order when what they need is merged, and all of the target is merged once.
TEST_F(EpochSchedulerTest, UnitsKeepWithinOpenEpochs) {
  constexpr std::uint64_t kIterations = 75;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    s = std::make_unique<Scheduler>(options(), 1, 1);
    clock = 100;
    rng::Stream stream(rng::key(seed, 4));
    const int workers = 1 + static_cast<int>(stream.next_double() * 6);
    for (int w = 0; w < workers; ++w) worker(std::string(1, static_cast<char>('a' + w)));
    job("j", kIterations);
    EXPECT_FALSE(lease("a")) << "no state is decided";
    std::vector<std::pair<Lease, Unit>> held;
    for (int step = 0; step < 20000 && !s->job("j")->finishing; ++step) {
      at(clock + 0.1);
      const std::string w(1, static_cast<char>('a' + static_cast<int>(stream.next_double() * workers)));
      const double u = stream.next_double();
      if (u < 0.2) {
        decide();
      } else if (u < 0.6) {
        const AcquireResult result = acquire(w);
        if (!result.lease) continue;
        const Unit unit = unit_of(*result.lease);
        const std::uint64_t epoch = kEpochs.of_index(unit.begin);
        ASSERT_EQ(kEpochs.of_index(unit.end - 1), epoch);
        ASSERT_LT(epoch, s->job("j")->states.size());
        ASSERT_EQ(result.input.states.size(), 1U);
        ASSERT_EQ(result.input.states[0].epoch, epoch);
        ASSERT_EQ(result.input.states[0].sha256, hash_of(epoch));
        held.emplace_back(*result.lease, unit);
      } else if (!held.empty()) {
        const auto index =
            static_cast<std::ptrdiff_t>(stream.next_double() * static_cast<double>(held.size()));
        const auto [l, unit] = held[static_cast<std::size_t>(index)];
        held.erase(held.begin() + index);
        if (u < 0.9)
          SchedulerFixture::deliver(l, unit, {}, 0.1);
        else if (u < 0.95)
          s->return_lease(l.row.worker_id, l.row.token, now());
      }
    }
    const Job& job = *s->job("j");
    ASSERT_TRUE(job.finishing) << seed;
    EXPECT_EQ(job.row.iterations, kIterations);
    EXPECT_EQ(job.states.size(), kEpochs.of_iteration(kIterations - 1) + 1) << "no state that nobody needs";
  }
}

// Claim: lag + 1 epochs are open from the start, so that nobody waits for the last unit of an epoch.
TEST_F(EpochSchedulerTest, TheNextEpochIsOpen) {
  worker("a");
  job("j", 100);
  EXPECT_EQ(decide(), 1U);
  EXPECT_EQ(decide(), 1U);
  EXPECT_EQ(decide(), 0U) << "epoch 2 needs epoch 0";
  std::uint64_t indices = 0;
  for (int i = 0; i < 100; ++i) {
    at(clock + 5);
    const auto l = lease("a");
    if (!l) break;
    const Unit unit = unit_of(*l);
    indices += unit.end - unit.begin;
    if (kEpochs.of_index(unit.begin) > 0) SchedulerFixture::deliver(*l, unit, {}, 0.1);
  }
  EXPECT_GT(indices, kEpochs.begin(1)) << "units of epoch 1 while one of epoch 0 is missing";
  EXPECT_EQ(decide(), 0U);
}

// Claim: a film that lost everything while the store knows the states opens the job from its first epoch with
// those states, decides none of them anew, and comes to its end.
TEST_F(EpochSchedulerTest, ALostFilmKeepsTheStates) {
  worker("a");
  job("j", 60);
  const auto run = [&](int units) {
    for (int i = 0; i < units && !s->job("j")->finishing; ++i) {
      decide();
      if (const auto l = lease("a")) SchedulerFixture::deliver(*l, unit_of(*l), {}, 0.1);
    }
  };
  run(30);
  const std::vector<StateRow> states = s->job("j")->states;
  ASSERT_GT(states.size(), 3U);
  JobRow row = s->job("j")->row;
  s = std::make_unique<Scheduler>(options(), 2, 1000);
  worker("a");
  RestoredStages restored;
  restored.states = states;
  s->restore(row, {}, {}, {}, {}, now(), restored);
  EXPECT_EQ(s->job("j")->states, states);
  EXPECT_FALSE(s->epoch_jobs().at(0).due);
  const auto l = lease("a");
  ASSERT_TRUE(l);
  EXPECT_EQ(unit_of(*l).begin, 0U);
  SchedulerFixture::deliver(*l, unit_of(*l), {}, 0.1);
  run(1000);
  EXPECT_TRUE(s->job("j")->finishing);
}

// Claim: a state whose bytes are lost is decided again, with those after it; the same hash goes on, another
// one fails the job.
TEST_F(EpochSchedulerTest, ALostStateIsDecidedAgain) {
  for (const bool same : {true, false}) {
    s = std::make_unique<Scheduler>(options(), 1, 1);
    worker("a");
    job("j", 60);
    decide();
    decide();
    EXPECT_FALSE(s->lost_state(std::string(64, 'f'), now()));
    EXPECT_TRUE(s->lost_state(hash_of(0), now()));
    EXPECT_TRUE(s->job("j")->states.empty());
    EXPECT_FALSE(lease("a"));
    const auto jobs = s->epoch_jobs();
    ASSERT_EQ(jobs.size(), 1U);
    EXPECT_TRUE(jobs[0].due);
    EXPECT_EQ(jobs[0].states, 0U);
    s->decided({"j", 0, "rule", same ? hash_of(0) : hash_of(7), 1}, now());
    EXPECT_EQ(s->job("j")->row.state == JobState::failed, !same);
    s->decided({"j", 5, "rule", hash_of(5), 1}, now());
    EXPECT_EQ(s->job("j")->states.size(), same ? 1U : 0U) << "not the next one";
  }
}

// Claim: an extended job goes on in the epoch it was in.
TEST_F(EpochSchedulerTest, ExtendContinues) {
  worker("a");
  job("j", 20);
  const auto run = [&] {
    for (int i = 0; i < 1000 && !s->job("j")->finishing; ++i) {
      decide();
      if (const auto l = lease("a")) SchedulerFixture::deliver(*l, unit_of(*l), {}, 0.1);
    }
    ASSERT_TRUE(s->job("j")->finishing);
    s->finish("j", now());
  };
  run();
  const std::vector<StateRow> before = s->job("j")->states;
  ASSERT_TRUE(s->extend("j", 55, 0, 0, now()).ok());
  run();
  const std::vector<StateRow>& after = s->job("j")->states;
  EXPECT_EQ(after.size(), kEpochs.of_iteration(74) + 1);
  EXPECT_TRUE(std::equal(before.begin(), before.end(), after.begin()));
}

}  // namespace
}  // namespace candela::master
