// The scheduler with jobs of Markov chains, against a clock of our own.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "common/rng/stream.h"
#include "common/stages/epochs.h"
#include "master/scheduler/free_segments.h"
#include "tests/unit/scheduler_fixture.h"

namespace candela::master {
namespace {

// Claim: the run found is free, ready, and either as long as wanted and the first such, or the longest there
// is. Against plain counting, for random sets.
TEST(FreeSegments, AgreesWithPlainCounting) {
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    rng::Stream stream(rng::key(seed, 2));
    const auto below = [&](std::uint64_t n) {
      return static_cast<std::uint64_t>(stream.next_double() * static_cast<double>(n));
    };
    const std::uint64_t n = 1 + below(9), target = n * (1 + below(6)), want = 1 + below(n);
    film::IndexSet merged, taken;
    std::vector<int> state(target);  // 1: taken, 2: merged
    for (std::uint64_t i = 0; i < target; ++i) {
      const bool ready = i < n || state[i - n] == 2;
      const double u = stream.next_double();
      if (!ready || u > 0.8) continue;
      state[i] = u < 0.6 ? 2 : 1;
      taken.insert(i, i + 1);
      if (state[i] == 2) merged.insert(i, i + 1);
    }
    const auto free = [&](std::uint64_t i) { return state[i] == 0 && (i < n || state[i - n] == 2); };
    SegmentRun expected;
    for (std::uint64_t i = 0; i < target && expected.length < want;) {
      std::uint64_t end = i;
      while (end < target && free(end)) ++end;
      if (end - i > expected.length) expected = {i, end - i};
      i = end + 1;
    }
    const SegmentRun run = free_segments(merged, taken, n, target, want);
    EXPECT_EQ(run.begin, expected.begin) << seed;
    EXPECT_EQ(run.length, expected.length) << seed;
  }
}

constexpr std::uint32_t kChains = 40;
constexpr std::uint64_t kSamples = 1000, kMutations = 100;

class ChainSchedulerTest : public SchedulerFixture {
 protected:
  void job(const std::string& id, std::uint64_t iterations, const std::optional<EpochPlan>& epochs = {}) {
    s->submit(row(id, iterations), now());
    worker("pilot");
    const auto l = lease("pilot");
    PilotResult result{
        {17}, "", 1, {.layers = {"independent"}, .chains = ChainPlan{kChains, kSamples, kMutations}}};
    result.work.epochs = epochs;
    ASSERT_TRUE(s->complete_pilot("pilot", l->row.token, result, now()));
    s->deregister("pilot", now());
  }
  static float contribution(std::uint64_t sample) { return static_cast<float>(sample % 7); }
  bool complete(const Lease& l, const Unit& u, float factor = 1) {
    std::vector<float> values;
    for (std::uint64_t i = u.begin; i < u.end; ++i) values.push_back(factor * contribution(i));
    const auto done = s->complete_bootstrap(l.row.worker_id, l.row.token, values, {0, 1, 0, 0}, 0.01, now());
    EXPECT_TRUE(done.ok());
    return done.ok() && *done;
  }
  Delivery deliver(const Lease& l, const Unit& u, double seconds = 1) {
    return SchedulerFixture::deliver(l, u, {}, seconds, 100);
  }
  void bootstrap(const std::string& w, float factor = 1) {
    while (s->job("j")->in_bootstrap()) {
      const auto l = lease(w);
      ASSERT_TRUE(l);
      ASSERT_TRUE(complete(*l, unit_of(*l), factor));
    }
  }
};

// Claim: pilot, then bootstrap units that tile all samples over all workers, then segments; what follows from
// the bootstrap does not depend on who did which samples, nor in which order.
TEST_F(ChainSchedulerTest, PhasesFollowEachOther) {
  worker("a");
  worker("b");
  job("j", 2);
  EXPECT_FALSE(s->job("j")->row.named_state);
  EXPECT_TRUE(s->job("j")->in_bootstrap());
  film::IndexSet seen;
  std::vector<std::pair<Lease, Unit>> held;
  for (int i = 0; i < 1000; ++i) {
    const std::string w = i % 2 == 0 ? "a" : "b";
    if (const auto l = lease(w)) {
      const Unit u = unit_of(*l);
      EXPECT_EQ(u.kind, Unit::Kind::bootstrap);
      EXPECT_TRUE(seen.insert(u.begin, u.end));
      held.emplace_back(*l, u);
    }
    if (held.size() < 4 && seen.count() < kSamples) continue;
    if (held.empty()) break;
    EXPECT_FALSE(s->job("j")->row.named_state);
    ASSERT_TRUE(complete(held.back().first, held.back().second));  // backwards
    EXPECT_FALSE(complete(held.back().first, held.back().second)) << "twice";
    held.pop_back();
    if (!s->job("j")->in_bootstrap()) break;
  }
  EXPECT_EQ(seen.count(), kSamples);
  const Job& job = *s->job("j");
  ASSERT_TRUE(job.row.named_state);
  chains::BootstrapTable table(kSamples);
  std::vector<float> values;
  for (std::uint64_t i = 0; i < kSamples; ++i) values.push_back(contribution(i));
  ASSERT_TRUE(table.insert(0, values).ok());
  EXPECT_EQ(job.row.named_state->bootstrap_b, table.normalisation().b);
  EXPECT_EQ(job.row.named_state->film_scale_log2, chains::film_scale_log2(table.normalisation().b, 17));
  EXPECT_EQ(job.starts, table.choose_starts(kChains, 0));
  EXPECT_GT(job.row.bootstrap_rejected[1], 0U);
  const auto l = lease("a");
  ASSERT_TRUE(l);
  EXPECT_EQ(unit_of(*l).kind, Unit::Kind::segments);
}

// Claim: a result of another number of samples is refused and the lease kept; impossible values are, too.
TEST_F(ChainSchedulerTest, BootstrapResultsMustFit) {
  worker("a");
  job("j", 2);
  const auto l = lease("a");
  const Unit u = unit_of(*l);
  std::vector<float> values(u.end - u.begin + 1, 1.0F);
  EXPECT_FALSE(s->complete_bootstrap("a", l->row.token, values, {}, 0.1, now()).ok());
  values.pop_back();
  EXPECT_FALSE(*s->complete_bootstrap("b", l->row.token, values, {}, 0.1, now())) << "another's lease";
  EXPECT_TRUE(*s->complete_bootstrap("a", l->row.token, values, {}, 0.1, now()));
}

// Claim: whoever asks, delivers all or the first segments, fails, hands back, falls silent or takes over, in
// any order, every segment is cut when its chain's one before is merged, no unit has a chain twice, and all
// of the target are merged once. An iteration of the stop rule is a round. If the job has epochs, no unit
// crosses a border, and each comes with the state of its epoch, which is decided when what it needs is
// merged.
TEST_F(ChainSchedulerTest, SegmentsFollowTheirChains) {
  constexpr std::uint64_t kRounds = 7;
  const EpochPlan plan{70, 4, 1, "rule", {}};  // borders lie amid rounds
  const Epochs epochs(plan.first, plan.growth);
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    s = std::make_unique<Scheduler>(options(), 1, 1);
    clock = 100;
    rng::Stream stream(rng::key(seed, 3));
    const int workers = 1 + static_cast<int>(stream.next_double() * 6);
    for (int w = 0; w < workers; ++w) worker(std::string(1, static_cast<char>('a' + w)));
    const bool in_epochs = seed % 2 == 1;
    job("j", kRounds, in_epochs ? std::optional(plan) : std::nullopt);
    bootstrap("a");
    EXPECT_EQ(s->epoch_jobs().size(), in_epochs ? 1U : 0U);
    std::array<film::IndexSet, 2> merged;
    std::vector<std::pair<Lease, Unit>> held;
    for (int step = 0; step < 20000 && !s->job("j")->finishing; ++step) {
      at(clock + 0.1);
      const std::string w(1, static_cast<char>('a' + static_cast<int>(stream.next_double() * workers)));
      const double u = stream.next_double();
      for (const EpochJob& d : s->epoch_jobs()) {
        if (!d.due || stream.next_double() > 0.3) continue;
        for (const film::IndexSet& half : merged) {
          ASSERT_TRUE(contains(half, 0, epochs.begin_index(epochs_before(d.states, plan.lag))));
        }
        s->decided({d.job_id, d.states, "rule", std::string(64, 'a'), 1}, now());
      }
      if (u < 0.4) {
        s->authenticate(w, "session-" + w, now());
        const AcquireResult result = s->acquire(w, {}, {stream.next_double() < 0.3, false}, now());
        if (const auto& l = result.lease) {
          const Unit unit = unit_of(*l);
          ASSERT_EQ(result.input.states.size(), in_epochs ? 1U : 0U);
          if (in_epochs) {
            ASSERT_EQ(result.input.states[0].epoch, epochs.of_index(unit.begin));
            ASSERT_EQ(result.input.states[0].epoch, epochs.of_index(unit.end - 1));
          }
          ASSERT_EQ(unit.kind, Unit::Kind::segments);
          ASSERT_LE(unit.end - unit.begin, kChains / 2);
          for (std::uint64_t i = unit.begin; i < unit.end; ++i) {
            ASSERT_FALSE(merged[unit.half].intersects(i, i + 1));
            if (i < kChains / 2) continue;
            ASSERT_TRUE(merged[unit.half].intersects(i - kChains / 2, i - kChains / 2 + 1));
          }
          held.emplace_back(*l, unit);
        }
      } else if (!held.empty()) {
        const auto at_index =
            static_cast<std::ptrdiff_t>(stream.next_double() * static_cast<double>(held.size()));
        auto [l, unit] = held[static_cast<std::size_t>(at_index)];
        held.erase(held.begin() + at_index);
        if (u < 0.9) {
          if (u < 0.6)  // cut short
            unit.end -=
                static_cast<std::uint64_t>(stream.next_double() * static_cast<double>(unit.end - unit.begin));
          if (deliver(l, unit) == Delivery::ok) {
            ASSERT_TRUE(merged[unit.half].insert(unit.begin, unit.end));
          }
        } else if (u < 0.95) {
          s->return_lease(l.row.worker_id, l.row.token, now());
        }  // else it falls silent, and its lease expires
      }
    }
    ASSERT_TRUE(s->job("j")->finishing) << seed;
    for (const film::IndexSet& half : merged)
      EXPECT_EQ(half.ranges(), (std::map<std::uint64_t, std::uint64_t>{{0, kRounds * kChains / 2}}));
    const JobRow& row = s->job("j")->row;
    EXPECT_EQ(row.iterations_of(row.iterations), kRounds);
  }
}

// Claim: a straggler holds up its own chains and no others: the rest of the job goes on to its end without
// them, and when nothing else is left its unit is leased again.
TEST_F(ChainSchedulerTest, AStragglerBlocksItsOwnChains) {
  worker("slow");
  worker("a");
  job("j", 3);
  bootstrap("a");
  const auto stuck = lease("slow");
  ASSERT_TRUE(stuck);
  const Unit unit = unit_of(*stuck);
  const auto beat = [&] { s->heartbeat("slow", {stuck->row.token}, now()); };
  bool speculative = false;
  for (int i = 0; i < 2000 && !s->job("j")->finishing; ++i) {
    at(clock + 1);
    s->authenticate("slow", "session-slow", now());
    beat();
    const auto l = lease("a");
    if (!l) continue;
    if (l->row.speculative) {
      speculative = true;
      EXPECT_EQ(l->row.unit_id, stuck->row.unit_id);
      const std::uint64_t done = s->job("j")->merged[0].count() + s->job("j")->merged[1].count();
      EXPECT_EQ(done, 3 * (kChains - (unit.end - unit.begin)));
    }
    ASSERT_EQ(deliver(*l, unit_of(*l)), Delivery::ok);
  }
  EXPECT_TRUE(speculative);
  EXPECT_TRUE(s->job("j")->finishing);
  EXPECT_EQ(deliver(*stuck, unit), Delivery::duplicate);
}

// Claim: units are small enough that every worker has chains to carry on, and that a lease's records fit a
// message.
TEST_F(ChainSchedulerTest, UnitsLeaveChainsForOthers) {
  for (const char* id : {"a", "b"}) worker(id);
  job("j", 10);
  bootstrap("a");
  const auto first = lease("a");
  EXPECT_LE(unit_of(*first).end - unit_of(*first).begin, kChains / (4 * 2));
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(lease(i % 2 == 0 ? "b" : "a")) << i;
  Unit u = unit_of(*first);
  ASSERT_EQ(s->check_delivery("a", first->row.token, first->row.unit_id, "j", u, now()), Delivery::ok);
  s->merged("a", first->row.token, first->row.unit_id, "j", u, {}, 0.001, 0.001, now(), 1 << 20);
  const auto next = lease("a");
  ASSERT_TRUE(next);
  EXPECT_LE(unit_of(*next).end - unit_of(*next).begin, 2U) << "records of 1 MiB";
}

// Claim: extended, a job of chains goes on where it was, by rounds; cancelled amid its bootstrap it goes on
// with what is known; pause and resume lose nothing.
TEST_F(ChainSchedulerTest, PauseCancelAndExtend) {
  worker("a");
  job("j", 2);
  auto l = lease("a");
  ASSERT_TRUE(complete(*l, unit_of(*l)));
  ASSERT_TRUE(s->cancel("j", now()).ok());
  const std::uint64_t known = s->job("j")->source->table()->known().count();
  EXPECT_GT(known, 0U);
  ASSERT_TRUE(s->extend("j", 1, 0, 0, now()).ok());
  l = lease("a");
  ASSERT_TRUE(l);
  EXPECT_EQ(unit_of(*l).kind, Unit::Kind::bootstrap);
  EXPECT_EQ(unit_of(*l).begin, known);
  ASSERT_TRUE(complete(*l, unit_of(*l)));
  bootstrap("a");
  const auto run = [&] {
    while (const auto next = lease("a")) ASSERT_EQ(deliver(*next, unit_of(*next)), Delivery::ok);
  };
  l = lease("a");
  ASSERT_TRUE(s->pause("j", now()).ok());
  EXPECT_FALSE(lease("a"));
  ASSERT_EQ(deliver(*l, unit_of(*l)), Delivery::ok);
  ASSERT_TRUE(s->resume("j", now()).ok());
  run();
  EXPECT_EQ(s->job("j")->row.iterations, 3 * kChains);
  s->finish("j", now());
  ASSERT_TRUE(s->extend("j", 2, 0, 0, now()).ok());
  run();
  EXPECT_EQ(s->job("j")->row.iterations, 5 * kChains);
  EXPECT_EQ(s->job("j")->row.stop_reason, "iterations");
}

// Claim: a bootstrap that found nothing leaves what needs no chain to the segments; if they find nothing,
// either, the job ends as black and says of how many samples, and cannot be extended.
TEST_F(ChainSchedulerTest, BlackJobsEnd) {
  worker("a");
  job("j", 1000);
  bootstrap("a", 0);
  EXPECT_EQ(s->job("j")->row.named_state->bootstrap_b, 0);
  EXPECT_EQ(s->job("j")->row.named_state->film_scale_log2, 17) << "the pilot's";
  const auto l = lease("a");
  ASSERT_TRUE(l) << "light that needs no chain";
  ASSERT_EQ(deliver(*l, unit_of(*l)), Delivery::ok);
  s->found_black("j", now());
  ASSERT_TRUE(s->job("j")->finishing);
  s->finish("j", now());
  EXPECT_EQ(s->job("j")->row.state, JobState::done);
  EXPECT_NE(s->message_of(*s->job("j"), now()).find("none of 1000 bootstrap samples"), std::string::npos);
  EXPECT_FALSE(s->extend("j", 1, 0, 0, now()).ok());
}

// Claim: a restart in the bootstrap goes on with the samples the store has, and a restart later with the
// segments the film has: units whose chains lost a segment are cut anew when it is there again.
TEST_F(ChainSchedulerTest, RestartsLoseNothingElse) {
  s = std::make_unique<Scheduler>(options(), 1, 7);  // the rows below are older
  worker("a");
  JobRow j;
  j.id = "j";
  j.state = JobState::running;
  j.settings.width = j.settings.height = 8;
  j.stop.iterations = 3;
  j.layers = {"independent"};
  j.chains = ChainPlan{kChains, kSamples, kMutations};
  const auto unit_row = [](std::uint64_t id, const Unit& unit, UnitRow::State state) {
    UnitRow u;
    u.id = id;
    u.job_id = "j";
    u.unit = unit;
    u.state = state;
    return u;
  };
  std::vector<float> values;
  for (std::uint64_t i = 0; i < 600; ++i) values.push_back(contribution(i));
  RestoredStages restored;
  restored.bootstrap = {{"j", 0, {values.begin(), values.begin() + 200}, {1, 0, 0, 0}},
                        {"j", 400, {values.begin() + 400, values.end()}, {2, 0, 0, 0}}};
  s->restore(j, {}, {},
             {unit_row(5, {Unit::Kind::bootstrap, 0, 200, 300}, UnitRow::State::leased),
              unit_row(6, {Unit::Kind::bootstrap, 0, 400, 500}, UnitRow::State::leased)},
             {}, now(), restored);
  EXPECT_EQ(s->job("j")->row.bootstrap_rejected[0], 3U);
  film::IndexSet redone;
  while (s->job("j")->in_bootstrap()) {
    const auto l = lease("a");
    ASSERT_TRUE(l);
    const Unit u = unit_of(*l);
    ASSERT_TRUE(redone.insert(u.begin, u.end));
    ASSERT_TRUE(complete(*l, u));
  }
  EXPECT_EQ(redone.ranges(), (std::map<std::uint64_t, std::uint64_t>{{200, 400}, {600, 1000}}));
  const JobRow before = s->job("j")->row;
  const std::vector<std::uint64_t> starts = s->job("j")->starts;

  // The film lost [5, 10) of half 0, which was merged, and with it the ground under [25, 30).
  constexpr std::uint64_t n = kChains / 2;
  std::array<film::IndexSet, 2> film;
  film[0].insert(0, 5);
  film[0].insert(10, n);
  film[0].insert(n, n + 5);
  Scheduler t(options(), 2, 100);
  WorkerRow w;
  w.id = "a";
  w.session = "session-a";
  w.isas = {"avx2"};
  t.restore_worker(w, now());
  t.restore(before, film, {},
            {unit_row(7, {Unit::Kind::segments, 0, n + 10, n + 15}, UnitRow::State::leased)},
            {unit_row(1, {Unit::Kind::segments, 0, 0, 5}, UnitRow::State::merged),
             unit_row(2, {Unit::Kind::segments, 0, 5, 10}, UnitRow::State::merged),
             unit_row(3, {Unit::Kind::segments, 0, 10, n}, UnitRow::State::merged),
             unit_row(4, {Unit::Kind::segments, 0, n, n + 5}, UnitRow::State::merged),
             unit_row(8, {Unit::Kind::segments, 0, n + 5, n + 10}, UnitRow::State::merged)},
            now(), {{}, starts, 100});
  const Job& job = *t.job("j");
  EXPECT_EQ(job.starts, starts);
  EXPECT_EQ(job.row.units_merged, 3U);
  ASSERT_EQ(job.units.size(), 2U) << "[5, 10) again, and [n+10, n+15)";
  EXPECT_TRUE(job.units.contains(2));
  EXPECT_TRUE(job.units.contains(7));
  EXPECT_EQ(t.check_delivery("a", 1, 8, "j", {Unit::Kind::segments, 0, n + 5, n + 10}, now()),
            Delivery::stale);
  s = std::make_unique<Scheduler>(std::move(t));
  while (const auto l = lease("a")) ASSERT_EQ(deliver(*l, unit_of(*l)), Delivery::ok);
  EXPECT_TRUE(s->job("j")->finishing);
  EXPECT_EQ(s->job("j")->row.iterations, 3 * kChains);
}

// The inputs of films that a test makes up.
class KnownInputs final : public FilmInputs {
 public:
  Answer chain_records(const std::string& job_id, const Unit& unit) const override {
    if (const auto it = states.find(job_id); it != states.end()) return {it->second, {}};
    Records records(unit.end - unit.begin, std::make_shared<const chains::ChainRecord>());
    return {State::whole, std::move(records)};
  }
  std::map<std::string, State> states;
};

// Claim: a lease of segments comes with one start for each index. A unit whose inputs are missing is not
// offered: nobody has a lease of it, its job says why, another job's units go out in the same call, and the
// unit itself goes out as soon as its inputs are there and its wait is over.
TEST_F(ChainSchedulerTest, LeasesComeWithTheirInputs) {
  worker("a");
  job("j", 2);
  bootstrap("a");
  s->submit(row("other", 4), now());
  KnownInputs films;
  const auto acquire = [&](bool prefetch) {
    s->authenticate("a", "session-a", now());
    return s->acquire("a", {}, {.prefetch = prefetch}, now(), &films);
  };
  for (const bool prefetch : {false, true})
    for (const auto missing : {FilmInputs::State::unread, FilmInputs::State::lost}) {
      films.states["j"] = missing;
      at(clock + 1000);
      s->authenticate("a", "session-a", now());
      const AcquireResult result = acquire(prefetch);
      ASSERT_TRUE(result.lease) << "another job starves";
      EXPECT_EQ(result.lease->row.job_id, "other");
      EXPECT_EQ(s->leases_of("j"), 0U);
      const bool lost = missing == FilmInputs::State::lost;
      EXPECT_EQ(result.unread, lost ? std::vector<std::string>() : std::vector<std::string>{"j"});
      EXPECT_EQ(result.lacking.empty(), !lost);
      if (lost) {
        EXPECT_NE(s->message_of(*s->job("j"), now()).find("does not hold the segments"), std::string::npos)
            << s->message_of(*s->job("j"), now());
      }
      s->return_lease("a", result.lease->row.token, now());
    }
  films.states.clear();
  at(clock + 1000);
  for (int i = 0; i < 20; ++i) {
    const AcquireResult result = acquire(false);
    ASSERT_TRUE(result.lease);
    const Unit unit = unit_of(*result.lease);
    if (result.lease->row.job_id != "j") {
      s->pause("other", now()).ok();
      continue;
    }
    ASSERT_EQ(result.input.chain_starts.size(), unit.end - unit.begin);
    for (std::uint64_t k = unit.begin; k < unit.end; ++k)
      EXPECT_EQ(result.input.chain_starts[k - unit.begin].bootstrap_sample,
                s->job("j")->starts[chains::chain_of(unit.half, k, kChains)]);
    return;
  }
  ADD_FAILURE() << "no lease of segments";
}

// Claim: a unit whose merge is on its way to the scheduler is not offered again, and nothing is told of it.
TEST_F(ChainSchedulerTest, AUnitThatTheFilmHasIsNotOffered) {
  worker("a");
  job("j", 2);
  bootstrap("a");
  KnownInputs films;
  films.states["j"] = FilmInputs::State::merged;
  s->authenticate("a", "session-a", now());
  const AcquireResult result = s->acquire("a", {}, {}, now(), &films);
  EXPECT_FALSE(result.lease);
  EXPECT_TRUE(result.unread.empty() && result.lacking.empty());
  EXPECT_FALSE(s->waiting_of(*s->job("j"), now()));
}

}  // namespace
}  // namespace candela::master
