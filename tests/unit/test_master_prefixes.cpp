// Stops by error: where they look, what they see, and what becomes of the rest.
#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <set>

#include "common/base/files.h"
#include "common/film/unit_film.h"
#include "common/rng/stream.h"
#include "common/stages/prefixes.h"
#include "common/stats/movement_sums.h"
#include "master/jobs/error_history.h"
#include "master/merge/checkpoint.h"
#include "master/merge/job_film.h"
#include "tests/temporary_folder.h"
#include "tests/unit/scheduler_fixture.h"

namespace candela::master {
namespace {

// Claim: prefixes are at most a twentieth apart, or 16 rounds (of chains 2), and each length leads to the
// first of the schedule that is no shorter.
TEST(Prefixes, AreAFewPerCentApart) {
  for (const bool chains : {false, true}) {
    std::set<std::uint64_t> schedule;
    for (std::uint64_t p = prefix_of(0, chains); p < 100'000; p = prefix_after(p, chains)) {
      const std::uint64_t step = prefix_after(p, chains) - p;
      EXPECT_GT(step, 0U);
      EXPECT_LE(step, std::max<std::uint64_t>(chains ? 2 : 16, p / 20)) << p;
      schedule.insert(p);
    }
    EXPECT_GE(*schedule.begin(), 8U);
    for (std::uint64_t rounds = 1; rounds < 5000; ++rounds)
      EXPECT_EQ(prefix_of(rounds, chains), *schedule.lower_bound(rounds)) << rounds;
  }
}

// Claim: a job ends at the second of two prefixes, the later a tenth longer at least, where the error was
// small enough at both and between; NaN is not small.
TEST(Prefixes, OneLuckyEstimateEndsNothing) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(ends_at({{100, 0.5}}, 100, 1)) << "one";
  EXPECT_FALSE(ends_at({{100, 0.5}, {105, 0.5}}, 105, 1)) << "too near";
  EXPECT_TRUE(ends_at({{100, 0.5}, {105, 1}, {110, 0.9}}, 110, 1));
  EXPECT_FALSE(ends_at({{100, 0.5}, {105, 1.01}, {110, 0.9}}, 110, 1)) << "a bad one between";
  EXPECT_FALSE(ends_at({{100, 0.5}, {105, nan}, {110, 0.9}}, 110, 1));
  EXPECT_FALSE(ends_at({{100, 0.5}, {110, 1.1}}, 110, 1)) << "the last one is bad";
  EXPECT_FALSE(ends_at({{100, 0.5}, {105, 1}, {110, 0.9}}, 105, 1)) << "what is longer is not known there";
}

// Claim: the history of the error comes back from its bytes; a decision anew replaces what came after it.
TEST(Prefixes, TheHistoryIsKept) {
  ErrorHistory history;
  for (const std::uint64_t rounds : {8, 24, 40}) history.decide({rounds, 1.0 / static_cast<double>(rounds)});
  history.decide({24, 0.25});
  EXPECT_EQ(history.prefixes, (std::vector<DecidedPrefix>{{8, 0.125}, {24, 0.25}}));
  const std::string bytes = history.serialise();
  ASSERT_TRUE(ErrorHistory::parse(bytes).ok());
  EXPECT_EQ(ErrorHistory::parse(bytes)->prefixes, history.prefixes);
  for (std::size_t length = 0; length < bytes.size(); ++length)
    EXPECT_FALSE(ErrorHistory::parse(bytes.substr(0, length)).ok()) << length;
}

constexpr film::Layout kLayout{8, 8, 1};
constexpr film::Layout kChainLayout{8, 8, 3};
constexpr std::uint32_t kChains = 6;

film::Delta delta_of(const Unit& unit, const film::Layout& layout = kLayout) {
  film::UnitFilm film(layout, 10);
  film::SampleCounts sample_counts;
  for (std::uint64_t i = unit.begin; i < unit.end; ++i) {
    film.splat(0, static_cast<std::uint32_t>(i % 8), unit.half, {1, 2, static_cast<float>(i)},
               rng::key(unit.half, i), sample_counts);
    ++sample_counts.eye_samples;
  }
  film.count(sample_counts);
  auto delta = film::Delta::decode(film::encode_delta(film, {unit, layout, 10, "j", "b"}), layout);
  EXPECT_TRUE(delta.ok());
  return std::move(*delta);
}
Unit iterations(std::uint32_t half, std::uint64_t begin, std::uint64_t end) {
  return {Unit::Kind::iterations, half, begin, end};
}
Unit segments(std::uint32_t half, std::uint64_t begin, std::uint64_t end) {
  return {Unit::Kind::segments, half, begin, end};
}
std::vector<chains::ChainRecord> records_of(const Unit& unit) {
  std::vector<chains::ChainRecord> out;
  for (std::uint64_t i = unit.begin; i < unit.end; ++i) {
    chains::ChainRecord r;
    r.segments = chains::segment_of(i, kChains) + 1;
    r.counts.mutations = 10 * r.segments;
    out.push_back(r);
  }
  return out;
}
PrefixBorder border_at(std::uint64_t end, std::uint64_t version) {
  return {{end, end}, version};
}

struct FilmOf {
  explicit FilmOf(const std::filesystem::path& folder, film::Layout layout = kLayout,
                  std::uint32_t chains = 0)
      : film(folder, layout, 10, &write_file_atomically, chains) {
    EXPECT_TRUE(film.ensure_loaded().ok());
  }
  std::string bytes() { return film.snapshot().film->serialise(); }
  JobFilm film;
};

// Claim: what is beyond the border is in nothing that is shown, counted or kept before the border moves; then
// the film is that of the same deltas without borders. What is dropped can be delivered again.
TEST(PrefixFilm, ShowsThePrefixAlone) {
  test::TemporaryFolder folder, other;
  FilmOf one(folder.path()), plain(other.path());
  const PrefixBorder first = border_at(4, 1);
  ASSERT_EQ(*one.film.merge(delta_of(iterations(0, 4, 6)), {}, first), JobFilm::Outcome::merged);
  EXPECT_EQ(one.film.snapshot().film->iterations(), 0U);
  EXPECT_EQ(*one.film.merge(delta_of(iterations(0, 5, 6)), {}, first), JobFilm::Outcome::duplicate);
  ASSERT_EQ(*one.film.merge(delta_of(iterations(0, 0, 4)), {}, first), JobFilm::Outcome::merged);
  ASSERT_EQ(*one.film.merge(delta_of(iterations(1, 0, 4)), {}, first), JobFilm::Outcome::merged);
  ASSERT_TRUE(plain.film.merge(delta_of(iterations(1, 0, 4))).ok());
  ASSERT_TRUE(plain.film.merge(delta_of(iterations(0, 0, 4))).ok());
  EXPECT_EQ(one.bytes(), plain.bytes());
  EXPECT_EQ(one.film.account().sample_counts.eye_samples, 8U);
  ASSERT_TRUE(one.film.checkpoint().ok());
  EXPECT_FALSE(one.film.dirty()) << "what is ahead is in no checkpoint";
  EXPECT_EQ(FilmOf(folder.path()).bytes(), plain.bytes());

  one.film.move_border(border_at(6, 2));
  EXPECT_TRUE(one.film.dirty());
  ASSERT_TRUE(plain.film.merge(delta_of(iterations(0, 4, 6))).ok());
  EXPECT_EQ(one.bytes(), plain.bytes());
  // A caller that has not heard of it changes nothing.
  ASSERT_EQ(*one.film.merge(delta_of(iterations(1, 4, 6)), {}, first), JobFilm::Outcome::merged);
  ASSERT_TRUE(plain.film.merge(delta_of(iterations(1, 4, 6))).ok());
  EXPECT_EQ(one.bytes(), plain.bytes());

  ASSERT_EQ(*one.film.merge(delta_of(iterations(1, 6, 7))), JobFilm::Outcome::merged);
  one.film.discard_ahead();
  EXPECT_EQ(one.bytes(), plain.bytes());
  ASSERT_EQ(*one.film.merge(delta_of(iterations(1, 6, 7))), JobFilm::Outcome::merged) << "again";
  one.film.release_ahead();
  ASSERT_TRUE(plain.film.merge(delta_of(iterations(1, 6, 7))).ok());
  EXPECT_EQ(one.bytes(), plain.bytes());
}

// Claim: what the film holds is what it has merged and what is ahead.
TEST(PrefixFilm, HoldsWhatIsAhead) {
  test::TemporaryFolder folder;
  FilmOf one(folder.path());
  const PrefixBorder border = border_at(4, 1);
  ASSERT_TRUE(one.film.merge(delta_of(iterations(0, 4, 6)), {}, border).ok());
  ASSERT_TRUE(one.film.merge(delta_of(iterations(1, 0, 2)), {}, border).ok());
  const HalfSets held = one.film.holds();
  EXPECT_EQ(held[0].ranges(), (std::map<std::uint64_t, std::uint64_t>{{4, 6}}));
  EXPECT_EQ(held[1].ranges(), (std::map<std::uint64_t, std::uint64_t>{{0, 2}}));
  EXPECT_EQ(one.film.account().merged[0].count(), 0U);
  ASSERT_TRUE(one.film.checkpoint().ok());
  one.film.close();
  one.film.unload_if_idle(1000, 1);
  EXPECT_TRUE(one.film.loaded()) << "that is in no checkpoint";
  one.film.discard_ahead();
  EXPECT_EQ(one.film.holds()[0].count(), 0U);
}

// Claim: a new version of the same border changes nothing of what is ahead.
TEST(PrefixFilm, TheSameBorderMergesNothing) {
  test::TemporaryFolder folder;
  FilmOf one(folder.path());
  ASSERT_TRUE(one.film.merge(delta_of(iterations(0, 4, 6)), {}, border_at(4, 1)).ok());
  one.film.move_border(border_at(4, 2));
  EXPECT_EQ(one.film.snapshot().film->iterations(), 0U);
  one.film.move_border(border_at(8, 1));
  EXPECT_EQ(one.film.snapshot().film->iterations(), 0U) << "an old version";
  one.film.move_border(border_at(8, 3));
  EXPECT_EQ(one.film.snapshot().film->iterations(), 2U);
}

// Claim: chains go on from records that are ahead, and the film's own are those of its segments.
TEST(PrefixFilm, ChainsGoOnAhead) {
  test::TemporaryFolder folder;
  FilmOf one(folder.path(), kChainLayout, kChains);
  const PrefixBorder border = border_at(3, 1);
  for (const Unit& unit : {segments(0, 0, 3), segments(0, 3, 6), segments(0, 6, 7)})
    ASSERT_EQ(*one.film.merge(delta_of(unit, kChainLayout), records_of(unit), border),
              JobFilm::Outcome::merged);
  EXPECT_EQ(one.film.snapshot().chain_segments, 3U);
  const auto starts = one.film.starts_of(segments(0, 7, 9));
  ASSERT_EQ(starts.state, JobFilm::Starts::State::whole);
  EXPECT_EQ(starts.records[0]->segments, 2U);
  ASSERT_TRUE(one.film.checkpoint().ok());
  EXPECT_EQ(FilmOf(folder.path(), kChainLayout, kChains).film.snapshot().chain_segments, 3U);
  one.film.move_border(border_at(100, 2));
  EXPECT_EQ(one.film.snapshot().chain_segments, 7U);
  ASSERT_TRUE(one.film.checkpoint().ok());
  EXPECT_EQ(FilmOf(folder.path(), kChainLayout, kChains).film.snapshot().chain_segments, 7U);
}

// Claim: the history of the error is in the checkpoint; one that is damaged is no checkpoint.
TEST(PrefixFilm, CheckpointsHaveTheHistory) {
  test::TemporaryFolder folder;
  const std::string history = "what the error was";
  {
    FilmOf one(folder.path());
    ASSERT_TRUE(one.film.merge(delta_of(iterations(0, 0, 2))).ok());
    one.film.remember_history(history);
    ASSERT_TRUE(one.film.checkpoint().ok());
    EXPECT_EQ(*FilmOf(folder.path()).film.snapshot().history, history);
  }
  const std::filesystem::path file = folder.path() / "film.1.ckpt";
  const std::string bytes = *read_file(file, 1 << 20);
  for (std::size_t back = 1; back <= 8 + 8 + 8 + history.size(); ++back) {
    std::string damaged = bytes;
    damaged[bytes.size() - back] ^= 1;
    EXPECT_FALSE(parse_checkpoint(damaged, 0).ok()) << back;
  }
  ASSERT_TRUE(parse_checkpoint(bytes, 0).ok());
}

// Claim: the sums of the image's movement are in the checkpoint and in no part beyond the border; a film that
// a build before has written has them as one group.
TEST(PrefixFilm, CheckpointsHaveTheMovement) {
  test::TemporaryFolder folder;
  const CheckpointShape shape(0, {}, {}, 0.7);
  const auto film_of = [&] {
    auto film = std::make_unique<JobFilm>(folder.path(), kLayout, 10, &write_file_atomically, shape);
    EXPECT_TRUE(film->ensure_loaded().ok());
    return film;
  };
  const auto film = film_of();
  for (const std::uint32_t half : {0, 1})
    for (const auto& [begin, end] : {std::pair(4, 6), std::pair(0, 2), std::pair(2, 4)})
      ASSERT_TRUE(film->merge(delta_of(iterations(half, begin, end)), {}, border_at(4, 1)).ok());
  film->remember_history("h");
  stats::MovementSums sums(kLayout, 0.7);
  film::SparseSums::TileBuffers buffers(film::kChannels);
  for (const std::uint32_t half : {0, 1})
    for (const auto& [begin, end] : {std::pair(0, 2), std::pair(2, 4)})
      sums.add(delta_of(iterations(half, begin, end)), buffers);
  EXPECT_EQ(film->snapshot().movement.serialise(), sums.serialise());
  ASSERT_TRUE(film->checkpoint().ok());
  EXPECT_EQ(film_of()->snapshot().movement.serialise(), sums.serialise());
  EXPECT_EQ(*film_of()->snapshot().history, "h");
  film->release_ahead();
  for (const std::uint32_t half : {0, 1}) sums.add(delta_of(iterations(half, 4, 6)), buffers);
  EXPECT_EQ(film->snapshot().movement.serialise(), sums.serialise());

  const std::string bytes = *read_file(folder.path() / "film.1.ckpt", 1 << 20);
  std::string plain = encode_checkpoint(*film->snapshot().film, {});
  const std::size_t trailer = plain.size();
  const auto adopted = parse_checkpoint(plain, shape);
  ASSERT_TRUE(adopted.ok());
  EXPECT_TRUE(adopted->movement.fits(adopted->film));
  append_movement(sums, plain);
  ASSERT_TRUE(parse_checkpoint(plain, shape).ok());
  EXPECT_TRUE(parse_checkpoint(plain, 0).ok()) << "a job without them passes them over";
  for (std::size_t at = trailer; at < plain.size(); ++at) {
    std::string damaged = plain;
    damaged[at] ^= 1;
    EXPECT_FALSE(parse_checkpoint(damaged, shape).ok()) << at;
  }
}

class PrefixScheduler : public SchedulerFixture {
 protected:
  void start(double relmse, std::uint64_t iterations = 0) {
    worker("a");
    JobRow j = row("j", iterations);
    j.stop.relmse = relmse;
    j.named_state = NamedState{1};
    j.thread_seconds_per_iteration = 1;
    s->restore(j, {}, {}, {}, {}, now());
  }
  // Delivers all that can be leased; what that was.
  HalfSets deliver_all() {
    HalfSets out;
    while (const auto l = lease("a")) {
      const Unit u = unit_of(*l);
      EXPECT_TRUE(out[u.half].insert(u.begin, u.end));
      film::SampleCounts sample_counts;
      sample_counts.eye_samples = u.end - u.begin;
      EXPECT_EQ(deliver(*l, u, sample_counts, static_cast<double>(u.end - u.begin)), Delivery::ok);
    }
    return out;
  }
  bool decide(bool ends) {
    const auto prefix = s->whole_prefix("j");
    EXPECT_TRUE(prefix);
    return prefix && s->prefix_decided("j", *prefix, ends, now());
  }
  const Job& job() { return *s->job("j"); }
};

// Claim: workers get the prefix and the step after it, in units that no border crosses, and no more until the
// prefix is decided; a job that ends has its prefix and nothing else.
TEST_F(PrefixScheduler, AJobEndsAtAPrefix) {
  start(1e-2);
  EXPECT_FALSE(s->whole_prefix("j")) << "nothing is merged";
  HalfSets had;
  std::uint64_t prefix = prefix_of(0, false);
  for (int step = 0; step < 4; ++step) {
    const std::uint64_t next = prefix_after(prefix, false);
    had = united(had, deliver_all());
    for (std::uint32_t half = 0; half < 2; ++half) {
      EXPECT_TRUE(contains(had[half], 0, next));
      EXPECT_EQ(end_of(had[half]), next);
    }
    ASSERT_TRUE(s->whole_prefix("j"));
    EXPECT_EQ(s->whole_prefix("j")->border.end[0], prefix);
    EXPECT_EQ(s->whole_prefix("j")->next.end[1], next);
    EXPECT_FALSE(decide(false));
    prefix = next;
  }
  deliver_all();
  s->take_changes();
  EXPECT_TRUE(decide(true));
  EXPECT_TRUE(job().finishing);
  EXPECT_EQ(job().row.stop_reason, "relmse");
  EXPECT_EQ(job().row.iterations, 2 * prefix);
  EXPECT_EQ(end_of(job().merged[0]), prefix);
  EXPECT_EQ(end_of(job().merged[1]), prefix);
  bool dropped = false;
  for (const Change& change : s->take_changes())
    if (const auto* drop = std::get_if<DropMergedFrom>(&change)) dropped = drop->begin[0] == prefix;
  EXPECT_TRUE(dropped) << "rows of what is no part of the image";
  // A delta that the film took before it dropped what was ahead.
  s->merged("a", 1 << 20, 1 << 20, "j", iterations(0, prefix, prefix + 1), {}, 1, 0, now());
  EXPECT_EQ(job().row.iterations, 2 * prefix);
  // Rendered again when it goes on.
  s->finish("j", now());
  ASSERT_TRUE(s->extend("j", 0, 0, 1e-3, now()).ok());
  ASSERT_TRUE(s->whole_prefix("j")) << "by the new rule the prefix is looked at again";
  EXPECT_EQ(s->whole_prefix("j")->border.end[0], prefix);
  EXPECT_FALSE(decide(false));
  EXPECT_TRUE(contains(deliver_all()[0], prefix, prefix_after(prefix_after(prefix, false), false)));
}

// Claim: a number of iterations does not overtake a prefix below it.
TEST_F(PrefixScheduler, IterationsWaitForThePrefix) {
  start(1e-2, 59);  // halves of 30 and 29: prefixes of 8, 24, then all
  deliver_all();
  EXPECT_FALSE(decide(false));
  const HalfSets rest = deliver_all();
  EXPECT_EQ(end_of(rest[0]), 30U);
  EXPECT_EQ(end_of(rest[1]), 29U);
  EXPECT_FALSE(job().finishing) << "the prefix of 24 may end it";
  EXPECT_FALSE(decide(false));
  EXPECT_TRUE(job().finishing);
  EXPECT_EQ(job().row.stop_reason, "iterations");
  EXPECT_EQ(job().row.iterations, 59U);
}

// Claim: a restart looks at the first prefix that the film does not have beyond, whatever units were out.
TEST_F(PrefixScheduler, ARestartLooksAtTheSamePrefix) {
  const auto prefix_with = [&](std::uint64_t merged) {
    s = std::make_unique<Scheduler>(options(), 1, 1);
    JobRow j = row("j", 0);
    j.stop.relmse = 1e-2;
    j.named_state = NamedState{1};
    HalfSets film;
    if (merged > 0) film[0].insert(0, merged);
    UnitRow out;
    out.id = 1;
    out.job_id = "j";
    out.unit = iterations(1, 100, 110);
    s->restore(j, film, {}, {out}, {}, now());
    return job().border().end[0];
  };
  EXPECT_EQ(prefix_with(0), 8U);
  EXPECT_EQ(prefix_with(8), 8U) << "it may not have been decided";
  EXPECT_EQ(prefix_with(9), 24U);
}

// Claim: a running job that is told to end by its error begins with a prefix that has all that was cut
// before.
TEST_F(PrefixScheduler, AnExtensionBeginsBehindWhatIsCut) {
  start(0, 100'000);
  const auto leased = lease("a");
  ASSERT_TRUE(leased);
  const std::uint64_t end = unit_of(*leased).end;
  ASSERT_TRUE(s->extend("j", 0, 0, 1e-2, now()).ok());
  EXPECT_GE(job().border().end[0], end);
  EXPECT_GE(job().border().end[1], end);
}

// Claim: a rule that changes while a prefix is looked at counts from then on, and no prefix is passed over:
// one that would have ended the job is looked at again, of one that would not the next.
TEST_F(PrefixScheduler, AChangedRuleLooksAgain) {
  start(1e-2);
  deliver_all();
  const auto prefix = s->whole_prefix("j");
  ASSERT_TRUE(prefix);
  ASSERT_TRUE(s->extend("j", 0, 0, 1e-3, now()).ok());
  EXPECT_FALSE(s->prefix_decided("j", *prefix, true, now()));
  EXPECT_FALSE(job().finishing);
  const auto again = s->whole_prefix("j");
  ASSERT_TRUE(again);
  EXPECT_EQ(again->border.end, prefix->border.end);
  EXPECT_GT(again->border.version, prefix->border.version) << "what was found by the old rule is void";
  ASSERT_TRUE(s->extend("j", 0, 0, 1e-4, now()).ok());
  EXPECT_FALSE(s->prefix_decided("j", *again, false, now()));
  EXPECT_EQ(job().border().end, again->next.end);
  EXPECT_GT(job().border().version, again->next.version) << "the film is there";
}

// Claim: more iterations move no border: a film that knows the version of a border knows its ends.
TEST_F(PrefixScheduler, MoreIterationsMoveNoBorder) {
  start(1e-2, 20);  // halves of 10, which end amid the prefix of 24
  auto beyond = lease("a");
  for (; beyond && unit_of(*beyond).begin < 8; beyond = lease("a"))
    ASSERT_EQ(deliver(*beyond, unit_of(*beyond), {}, 1), Delivery::ok);
  ASSERT_TRUE(beyond);
  EXPECT_FALSE(decide(false));
  const PrefixBorder before = job().border();
  ASSERT_TRUE(s->extend("j", 100, 0, 0, now()).ok());
  ASSERT_EQ(job().border().version, before.version);
  EXPECT_EQ(job().border().end, before.end);
  deliver_all();
  ASSERT_EQ(deliver(*beyond, unit_of(*beyond), {}, 1), Delivery::ok);
  ASSERT_TRUE(s->whole_prefix("j"));
  EXPECT_EQ(s->whole_prefix("j")->border.end[0], 24U);
}

// Claim: after a restart no unit lies across the prefix, or beyond the step after it: what is rendered there
// would be merged before it was looked at.
TEST_F(PrefixScheduler, ARestartKeepsTheSteps) {
  JobRow j = row("j", 0);
  j.stop.relmse = 1e-2;
  j.named_state = NamedState{1};
  j.thread_seconds_per_iteration = 1;
  std::vector<UnitRow> rows;
  for (const Unit& unit : {iterations(0, 0, 8), iterations(0, 8, 24), iterations(0, 24, 40),
                           iterations(1, 4, 12), iterations(1, 20, 28)}) {
    UnitRow row;
    row.id = rows.size() + 1;
    row.job_id = "j";
    row.unit = unit;
    row.state = UnitRow::State::merged;  // and the checkpoint does not have it
    rows.push_back(row);
  }
  s = std::make_unique<Scheduler>(options(), 1, 10);
  s->restore(j, {}, {}, {}, rows, now());
  worker("a");
  std::set<std::pair<std::uint32_t, std::uint64_t>> kept;
  for (const auto& [id, unit] : job().units) kept.emplace(unit.row.unit.half, unit.row.unit.begin);
  EXPECT_EQ(kept, (std::set<std::pair<std::uint32_t, std::uint64_t>>{{0, 0}, {0, 8}}));
  std::size_t dropped = 0;
  for (const Change& change : s->take_changes()) dropped += std::holds_alternative<DropUnit>(change) ? 1 : 0;
  EXPECT_EQ(dropped, 3U);
  EXPECT_EQ(end_of(deliver_all()[0]), 24U);
}

// Claim: a job that has lost some of what it had does not end before it has that again, and goes on to there.
TEST_F(PrefixScheduler, WhatIsPromisedComesBeforeTheEnd) {
  start(0, 200);
  deliver_all();
  s->finish("j", now());
  ASSERT_EQ(job().row.state, JobState::done);
  std::vector<UnitRow> rows;
  for (std::uint32_t half = 0; half < 2; ++half) {
    UnitRow row;
    row.id = half + 1;
    row.job_id = "j";
    row.unit = iterations(half, 0, 100);
    row.state = UnitRow::State::merged;
    rows.push_back(row);
  }
  s->reconcile("j", {}, {}, rows, 0, "all checkpoints are gone", now());
  ASSERT_EQ(count(job().lost()), 200U);
  ASSERT_TRUE(s->extend("j", 100, 0, 1e-2, now()).ok());
  for (int step = 0; step < 20 && !job().finishing; ++step) {
    deliver_all();
    const auto prefix = s->whole_prefix("j");
    ASSERT_TRUE(prefix) << "nothing goes on at " << job().border().end[0];
    EXPECT_EQ(prefix->may_end, prefix->border.end[0] >= 100) << prefix->border.end[0];
    s->prefix_decided("j", *prefix, prefix->may_end, now());
  }
  EXPECT_TRUE(job().finishing);
  EXPECT_EQ(job().row.stop_reason, "relmse");
  EXPECT_EQ(count(job().lost()), 0U);
}

// Claim: no unit of a job that merges photons crosses the border of a group of the movement's sums; others
// are as long as workers like.
TEST_F(PrefixScheduler, UnitsStayInTheirGroups) {
  worker("a");
  std::uint64_t longest = 0;
  for (const bool merges : {true, false}) {
    JobRow j = row(merges ? "merges" : "not", 400);
    if (merges) j.settings.integrator_settings = {{"radius", "0"}};
    j.plan = "use  photons on surfaces: x\n";
    j.named_state = NamedState{1};
    j.thread_seconds_per_iteration = 0.05;
    s->restore(j, {}, {}, {}, {}, now());
    while (const auto l = lease("a")) {
      const Unit u = unit_of(*l);
      if (merges) {
        EXPECT_LE(u.end, stats::end_of_group(u.begin)) << u.begin;
        longest = std::max(longest, u.end - u.begin);
      } else {
        longest = u.begin < 4 && u.end > 4 ? 0 : longest;
      }
      deliver(*l, u, {}, 0.05 * static_cast<double>(u.end - u.begin));
    }
    EXPECT_EQ(s->job(j.id)->row.iterations, 400U);
  }
  EXPECT_EQ(longest, 0U);
}

}  // namespace
}  // namespace candela::master
