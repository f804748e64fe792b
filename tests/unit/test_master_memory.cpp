// A master's memory: which jobs may have it, and films that it does not suffice for.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "common/base/files.h"
#include "common/base/memory_limit.h"
#include "common/film/unit_film.h"
#include "common/rng/stream.h"
#include "master/jobs/image_memory.h"
#include "master/merge/job_film.h"
#include "tests/temporary_folder.h"
#include "tests/unit/failing_allocation.inc"
#include "tests/unit/scheduler_fixture.h"

namespace candela::master {
namespace {

class MemorySchedulerTest : public SchedulerFixture {
 protected:
  // Jobs of these tests are of 1000 x 1000 pixels: a film of 48 MB, and twice that to work with.
  static JobRow large(const std::string& id, std::int64_t submitted = 0, std::int32_t priority = 0) {
    JobRow row = SchedulerFixture::row(id, 100);
    row.settings.width = row.settings.height = 1000;
    row.submitted_unix_ms = submitted;
    row.priority = priority;
    return row;
  }
  static std::uint64_t need() { return need_of(large("x")).all(); }
  void limit(std::uint64_t memory_bytes, std::uint64_t statistics_bytes = 0) {
    SchedulerOptions o = options();
    o.memory_bytes = memory_bytes;
    o.statistics_bytes = statistics_bytes;
    s = std::make_unique<Scheduler>(o, 1, 1);
    worker("w");
  }
  // The job's pilot, before what others offer.
  void pilot(const std::string& id, const WorkPlan& work = {}) {
    const std::int32_t priority = s->job(id)->row.priority;
    ASSERT_TRUE(s->set_priority(id, 1000, now()).ok());
    const auto l = lease("w");
    ASSERT_TRUE(l);
    ASSERT_EQ(l->row.job_id, id);
    ASSERT_EQ(unit_of(*l).kind, Unit::Kind::pilot);
    ASSERT_TRUE(s->set_priority(id, priority, now()).ok());
    const PilotResult result{NamedState{17}, "", 1.0, work};
    ASSERT_TRUE(s->complete_pilot("w", l->row.token, result, now()));
  }
  std::string offered() {
    const auto l = lease("w");
    if (!l) return "";
    s->return_lease("w", l->row.token, now());
    return l->row.job_id;
  }
  std::string message(const std::string& id) { return s->message_of(*s->job(id), now()); }
};

// Claim: a job whose memory does not fit beside the others' gets its pilot and then waits, with figures in
// its status and an event; it goes on by itself when another job has ended.
TEST_F(MemorySchedulerTest, WhatDoesNotFitWaits) {
  limit(need() * 5 / 4);  // two films, but not with the room to work with one
  s->submit(large("a", 1), now());
  pilot("a");
  s->submit(large("b", 2), now());
  pilot("b");
  EXPECT_EQ(offered(), "a");
  EXPECT_TRUE(s->job("a")->admitted);
  EXPECT_FALSE(s->job("b")->admitted);
  EXPECT_TRUE(s->short_of_memory());
  EXPECT_NE(message("b").find("waits for the master's memory: it needs 145 MB"), std::string::npos)
      << message("b");
  const auto changes = s->take_changes();
  EXPECT_EQ(std::count_if(changes.begin(), changes.end(),
                          [](const Change& c) {
                            const auto* e = std::get_if<AddEvent>(&c);
                            return e != nullptr && e->row.kind == "memory" && e->row.job_id == "b";
                          }),
            1);
  ASSERT_TRUE(s->cancel("a", now()).ok());
  EXPECT_EQ(offered(), "b");
  EXPECT_EQ(message("b"), "");
}

// Claim: those who wait come by priority, then by the time of their submission; a small job does not pass a
// large one that only waits for running jobs, but does pass one that paused jobs keep out.
TEST_F(MemorySchedulerTest, JobsThatWaitHaveAnOrder) {
  limit(need() * 5 / 4);
  s->submit(large("a", 1), now());
  pilot("a");
  EXPECT_EQ(offered(), "a");
  for (const auto& [id, priority] : {std::pair("b", 0), std::pair("c", 5)}) {
    s->submit(large(id, 2, priority), now());
    pilot(id);
  }
  JobRow small = row("small", 100);
  small.submitted_unix_ms = 9;
  s->submit(small, now());
  pilot("small");
  EXPECT_EQ(offered(), "a");
  EXPECT_FALSE(s->job("small")->admitted);
  EXPECT_NE(message("small").find("job c has its turn before"), std::string::npos) << message("small");
  ASSERT_TRUE(s->pause("a", now()).ok());
  s->tick(at(clock + 2));
  EXPECT_TRUE(s->job("small")->admitted) << "nobody knows when the paused job ends";
  ASSERT_TRUE(s->cancel("a", now()).ok());
  s->tick(now());
  EXPECT_TRUE(s->job("c")->admitted);
  EXPECT_FALSE(s->job("b")->admitted);
}

// Claim: the statistics of all jobs together count against their own limit.
TEST_F(MemorySchedulerTest, StatisticsOfAllJobsCount) {
  WorkPlan work;
  work.accumulators = {{"moments", 2, 8, film::AccumulatorSpec::Per::job}};
  limit(std::uint64_t{1} << 40, 40'000'000);  // each job: 2 * 2 * 8 bytes a pixel
  for (const char* id : {"a", "b"}) {
    s->submit(large(id, id[0]), now());
    pilot(id, work);
  }
  s->tick(at(clock + 1));
  EXPECT_TRUE(s->job("a")->admitted);
  EXPECT_FALSE(s->job("b")->admitted);
  EXPECT_NE(message("b").find("of statistics 32 MB, others have 32 MB of 40 MB"), std::string::npos)
      << message("b");
}

// Claim: a job that can never fit says so and names the option, and keeps nobody waiting.
TEST_F(MemorySchedulerTest, WhatNeverFitsKeepsNobodyWaiting) {
  limit(need() / 2);
  s->submit(large("a", 1), now());
  pilot("a");
  s->submit(row("small", 100), now());
  pilot("small");
  EXPECT_EQ(offered(), "small");
  EXPECT_NE(message("a").find("--memory"), std::string::npos) << message("a");
}

// Claim: a job that is to end by its error needs a second film and the sums of its halves twice, from the
// moment on that it is told to.
TEST_F(MemorySchedulerTest, TheErrorTakesASecondFilm) {
  JobRow by_error = large("e");
  by_error.accumulators = {{"matrix", 2, 0, film::AccumulatorSpec::Per::job}};
  const MemoryNeed plain = need_of(by_error);
  by_error.stop.relmse = 1e-2;
  EXPECT_EQ(need_of(by_error).film, 2 * plain.film + plain.statistics);
  limit(need() * 100);
  s->submit(large("a", 1), now());
  pilot("a");
  ASSERT_EQ(s->job("a")->need.film, plain.film);
  ASSERT_TRUE(s->extend("a", 0, 0, 1e-2, now()).ok());
  EXPECT_EQ(s->job("a")->need.film, 2 * plain.film);
}

// Claim: a job for which the system had less than was counted waits for some seconds, and is tried again.
TEST_F(MemorySchedulerTest, ALackIsTriedAgain) {
  limit(std::uint64_t{1} << 40);
  s->submit(large("a", 1), now());
  pilot("a");
  EXPECT_EQ(offered(), "a");
  s->lack_memory("a", "the film cannot be read: out of memory", now());
  EXPECT_EQ(offered(), "");
  EXPECT_NE(message("a").find("the film cannot be read: out of memory"), std::string::npos) << message("a");
  at(clock + 11);
  EXPECT_EQ(offered(), "a");
}

// --- films ---

constexpr film::Layout kLayout{70, 40, 1};
const std::vector<film::AccumulatorSpec> kSpecs{{"moments", 2, 8, film::AccumulatorSpec::Per::job},
                                                {"matrix", 1, 0, film::AccumulatorSpec::Per::job}};

film::Delta delta_of(std::uint64_t begin) {
  film::UnitFilm film(kLayout, 10);
  film::UnitAccumulator moments(kLayout.width, kLayout.height, kSpecs[0]);
  film::UnitAccumulator matrix(kLayout.width, kLayout.height, kSpecs[1]);
  film::SampleCounts sample_counts;
  for (std::uint32_t y = 0; y < kLayout.height; ++y)
    for (std::uint32_t x = 0; x < kLayout.width; ++x) {
      const std::uint64_t key = rng::key(begin, y, x);
      const double u = 1 + rng::to_double(key);
      moments.add(x, y, 0, std::array<double, 2>{u, u * u}, key, sample_counts);
      matrix.add(x, y, 0, std::array<double, 1>{u}, key, sample_counts);
      film.add(0, x, y, {1.0F, 2.0F, static_cast<float>(u)}, key, sample_counts);
    }
  film.count(sample_counts);
  film::DeltaWriter writer({{Unit::Kind::iterations, 0, begin, begin + 1}, {}, 0, "j", "b"});
  writer.film(film);
  writer.accumulator(moments, 0);
  writer.accumulator(matrix, 0);
  writer.counts(sample_counts);
  auto delta = film::Delta::decode(writer.finish(), {kLayout, kSpecs});
  EXPECT_TRUE(delta.ok()) << delta.error().to_string();
  return std::move(*delta);
}

std::string bytes_of(JobFilm& film) {
  const JobFilm::Snapshot s = film.snapshot();
  std::string all = s.film->serialise();
  for (const auto& halves : s.accumulators)
    for (const auto& sums : halves)
      if (sums) all += sums->serialise();
  return all;
}

JobFilm job_film(const std::filesystem::path& folder) {
  return JobFilm(folder, kLayout, 10, &write_file_atomically, CheckpointShape{0, kSpecs});
}

// Claim: a delta that runs out of memory at any allocation changes neither film nor accumulators, also while
// readers hold the sums, and is merged when it is sent again; the film is then what it is without any lack.
TEST(JobFilmMemory, AMergeIsWholeOrNotAtAll) {
  const test::TemporaryFolder folder;
  JobFilm film = job_film(folder.path() / "a"), plain = job_film(folder.path() / "b");
  ASSERT_TRUE(film.ensure_loaded().ok() && plain.ensure_loaded().ok());
  std::uint64_t failures = 0;
  for (std::uint64_t i = 0; i < 3; ++i) {
    const film::Delta delta = delta_of(i);
    const JobFilm::Snapshot reader = film.snapshot();
    const std::string before = i == 0 ? "" : bytes_of(film);
    bool merged = false;
    for (std::uint64_t skip = 0; !merged; ++skip) {
      ASSERT_LT(skip, 1000U);
      try {
        const test::FailingAllocations failing(1, skip);
        const auto outcome = film.merge(delta);
        ASSERT_TRUE(outcome.ok() && *outcome == JobFilm::Outcome::merged);
        merged = true;
      } catch (const std::bad_alloc&) {
        ++failures;
        if (i > 0) {
          ASSERT_EQ(bytes_of(film), before) << "after " << skip << " allocations";
        }
      }
    }
    ASSERT_TRUE(plain.merge(delta).ok());
  }
  EXPECT_GT(failures, 10U);
  EXPECT_EQ(bytes_of(film), bytes_of(plain));
}

// Claim: what is ahead of a border that moves is merged whole or not at all, wherever memory runs out, and
// whole when it is tried again.
TEST(JobFilmMemory, ABorderMovesOrNot) {
  for (const std::uint64_t border : {0, 1}) {  // of 4, the others are ahead
    const test::TemporaryFolder folder;
    JobFilm film = job_film(folder.path() / "a"), plain = job_film(folder.path() / "b");
    ASSERT_TRUE(film.ensure_loaded().ok() && plain.ensure_loaded().ok());
    for (std::uint64_t i = 0; i < 4; ++i) {
      ASSERT_TRUE(film.merge(delta_of(i), {}, {{border, border}, 1}).ok());
      ASSERT_TRUE(plain.merge(delta_of(i)).ok());
    }
    const std::string before = bytes_of(film);
    std::uint64_t failures = 0;
    for (bool moved = false; !moved;) {
      ASSERT_LT(failures, 1000U);
      try {
        const test::FailingAllocations failing(1, failures);
        film.move_border({{10, 10}, 2});
        moved = true;
      } catch (const std::bad_alloc&) {
        ASSERT_TRUE(bytes_of(film) == before) << "after " << failures << " allocations";
        ++failures;
      }
    }
    EXPECT_GT(failures, 4U);
    EXPECT_EQ(bytes_of(film), bytes_of(plain));
  }
}

// Claim: a checkpoint for which there is no copy is made without one; one for which there is no memory at all
// is an error, the generation before stays, and nothing is lost once there is memory again; a film that
// cannot be read for want of memory is an error too, and its files stay as they are.
TEST(JobFilmMemory, CheckpointsWaitForMemory) {
  const test::TemporaryFolder folder;
  JobFilm film = job_film(folder.path());
  ASSERT_TRUE(film.ensure_loaded().ok());
  ASSERT_TRUE(film.merge(delta_of(0)).ok());
  const auto first = film.checkpoint();
  ASSERT_TRUE(first.ok());
  EXPECT_EQ(first->generation, 1U);

  ASSERT_TRUE(film.merge(delta_of(1)).ok());
  {
    const test::FailingAllocations failing(4096, 0);
    const auto none = film.checkpoint();
    ASSERT_FALSE(none.ok());
    EXPECT_EQ(none.error().kind, ErrorKind::resource);
    EXPECT_NE(none.error().to_string().find("out of memory"), std::string::npos);
  }
  EXPECT_TRUE(film.dirty());
  EXPECT_EQ(film.generation(), 1U);

  const std::string expected = bytes_of(film);
  std::optional<JobFilm::Checkpoint> second;
  bool failed = false;
  for (std::uint64_t skip = 0; !second;
       ++skip) {  // the copy fails at some place, and what needs none succeeds
    ASSERT_LT(skip, 1000U);
    const test::FailingAllocations failing(20000, skip);
    const auto made = film.checkpoint();
    failed = failed || test::FailingAllocations::failed() > 0;
    if (made.ok()) second = *made;
  }
  EXPECT_TRUE(failed);
  EXPECT_EQ(second->iterations, 2U);
  EXPECT_FALSE(film.dirty());

  JobFilm again = job_film(folder.path());
  {
    const test::FailingAllocations failing(4096, 0);
    const auto loading = again.ensure_loaded();
    ASSERT_FALSE(loading.ok());
    EXPECT_EQ(loading.error().kind, ErrorKind::resource);
    const auto verified = again.verify_files();
    ASSERT_FALSE(verified.ok());
    EXPECT_EQ(verified.error().kind, ErrorKind::resource);
  }
  EXPECT_FALSE(again.loaded());
  const auto loading = again.ensure_loaded();
  ASSERT_TRUE(loading.ok());
  EXPECT_EQ(loading->trouble, "") << "no checkpoint is damaged";
  EXPECT_EQ(bytes_of(again), expected);
}

// Claim: images share their memory: one is always made, and more as long as they fit.
TEST(ImageMemory, OneAlwaysFits) {
  ImageMemory memory(100);
  auto huge = memory.take(1000);
  ASSERT_TRUE(huge.ok());
  const auto refused = memory.take(1);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().kind, ErrorKind::resource);
  huge = refused_error("gone");
  const auto a = memory.take(60), b = memory.take(40);
  EXPECT_TRUE(a.ok() && b.ok());
  EXPECT_FALSE(memory.take(1).ok());
}

}  // namespace
}  // namespace candela::master
