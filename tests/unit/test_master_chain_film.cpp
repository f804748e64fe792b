// The film with the records of its chains, and the store with jobs of Markov chains.
#include <gtest/gtest.h>

#include <filesystem>

#include "common/base/files.h"
#include "common/film/unit_film.h"
#include "common/rng/stream.h"
#include "master/merge/job_film.h"
#include "master/store/store.h"
#include "tests/temporary_folder.h"
#include "tests/unit/store_file.h"

namespace candela::master {
namespace {

namespace fs = std::filesystem;

constexpr film::Layout kLayout{8, 8, 3};
constexpr std::uint32_t kFew = 6;  // chains

film::Delta delta_of(const Unit& unit) {
  film::UnitFilm film(kLayout, 10);
  film::SampleCounts sample_counts;
  for (std::uint64_t i = unit.begin; i < unit.end; ++i)
    film.splat(0, static_cast<std::uint32_t>(i % 8), unit.half, {1, 2, 3}, rng::key(unit.half, i),
               sample_counts);
  film.count(sample_counts);
  auto delta = film::Delta::decode(film::encode_delta(film, {unit, kLayout, 10, "j", "b"}), kLayout);
  EXPECT_TRUE(delta.ok());
  return std::move(*delta);
}
std::vector<chains::ChainRecord> records_of(const Unit& unit) {
  std::vector<chains::ChainRecord> out;
  for (std::uint64_t i = unit.begin; i < unit.end; ++i) {
    chains::ChainRecord r;
    r.segments = chains::segment_of(i, kFew) + 1;
    r.counts.mutations = 10 * r.segments;
    r.counts.large_steps = 3 * r.segments;
    r.counts.large_sum = 0.1 * static_cast<double>(r.segments * (i + 1));
    r.state = "chain " + std::to_string(chains::chain_of(unit.half, i, kFew));
    out.push_back(r);
  }
  return out;
}
Unit segments(std::uint32_t half, std::uint64_t begin, std::uint64_t end) {
  return {Unit::Kind::segments, half, begin, end};
}

// Claim: records change with the sums or not at all, and are those of exactly the merged segments; each that
// contradicts its chain is refused.
TEST(ChainFilm, RecordsFollowTheSums) {
  test::TemporaryFolder folder;
  JobFilm film(folder.path(), kLayout, 10, &write_file_atomically, kFew);
  ASSERT_TRUE(film.ensure_loaded().ok());
  const auto merge = [&](const Unit& unit, std::vector<chains::ChainRecord> records) {
    return film.merge(delta_of(unit), std::move(records));
  };
  EXPECT_FALSE(merge({Unit::Kind::iterations, 0, 0, 2}, records_of(segments(0, 0, 2))).ok());
  EXPECT_EQ(merge(segments(0, 3, 5), records_of(segments(0, 3, 5))).error().kind, ErrorKind::refused)
      << "the second segments before the first";
  EXPECT_FALSE(merge(segments(0, 0, 2), records_of(segments(0, 0, 1))).ok()) << "a record is missing";
  EXPECT_FALSE(merge(segments(0, 0, 4), records_of(segments(0, 0, 4))).ok()) << "a chain twice";
  EXPECT_EQ(film.snapshot().film->iterations(), 0U);

  ASSERT_EQ(*merge(segments(0, 0, 2), records_of(segments(0, 0, 2))), JobFilm::Outcome::merged);
  EXPECT_EQ(*merge(segments(0, 1, 2), records_of(segments(0, 1, 2))), JobFilm::Outcome::duplicate);
  const auto spoiled = [&](auto spoil) {
    auto records = records_of(segments(0, 3, 5));
    spoil(records[1]);
    return merge(segments(0, 3, 5), records);
  };
  for (const auto& result : {spoiled([](chains::ChainRecord& r) { r.segments = 1; }),
                             spoiled([](chains::ChainRecord& r) { r.segments = 3; }),
                             spoiled([](chains::ChainRecord& r) { r.counts.large_sum = 0; }),
                             spoiled([](chains::ChainRecord& r) { r.counts.mutations = 9; })}) {
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().kind, ErrorKind::input);
    EXPECT_EQ(result.error().field, "chain_records");
  }
  EXPECT_EQ(film.snapshot().chain_segments, 2U) << "refusals change nothing";
  ASSERT_EQ(*spoiled([](chains::ChainRecord&) {}), JobFilm::Outcome::merged);

  const auto starts = film.starts_of(segments(0, 6, 8));
  using State = JobFilm::Starts::State;
  ASSERT_EQ(starts.state, State::whole);
  EXPECT_EQ(starts.records[1]->segments, 2U);
  EXPECT_EQ(starts.records[1]->state, "chain 2");
  EXPECT_EQ(film.starts_of(segments(0, 3, 5)).state, State::merged) << "they are done";
  EXPECT_EQ(film.starts_of(segments(0, 5, 6)).state, State::lost) << "chain 4 has no first segment yet";
  ASSERT_EQ(film.starts_of(segments(1, 0, 3)).state, State::whole);
  EXPECT_EQ(film.starts_of(segments(1, 0, 3)).records[0]->segments, 0U);
}

// Claim: a checkpoint brings back sums and records as they were; a film read from it takes the next segments
// and no others.
TEST(ChainFilm, CheckpointsHoldTheRecords) {
  test::TemporaryFolder folder;
  {
    JobFilm film(folder.path(), kLayout, 10, &write_file_atomically, kFew);
    ASSERT_TRUE(film.ensure_loaded().ok());
    for (const Unit& unit : {segments(0, 0, 3), segments(1, 1, 3), segments(0, 3, 5)})
      ASSERT_TRUE(film.merge(delta_of(unit), records_of(unit)).ok());
    ASSERT_TRUE(film.checkpoint().ok());
  }
  JobFilm film(folder.path(), kLayout, 10, &write_file_atomically, kFew);
  ASSERT_EQ(film.ensure_loaded()->trouble, "");
  const JobFilm::Snapshot copy = film.snapshot(JobFilm::Part::image);
  EXPECT_EQ(copy.film->iterations(), 7U);
  EXPECT_EQ(copy.film->layout().layers, 2U);
  EXPECT_EQ(copy.chain_segments, 7U);
  EXPECT_EQ(copy.counts[1].mutations, 0U);
  EXPECT_EQ(copy.counts[2].mutations, 20U);
  EXPECT_EQ(film.largest_record_bytes(), chains::encoded_bytes(records_of(segments(0, 0, 1))[0]));
  EXPECT_FALSE(film.merge(delta_of(segments(1, 3, 4)), records_of(segments(1, 3, 4))).ok());
  EXPECT_TRUE(film.merge(delta_of(segments(1, 0, 1)), records_of(segments(1, 0, 1))).ok());
  EXPECT_TRUE(film.merge(delta_of(segments(1, 3, 4)), records_of(segments(1, 3, 4))).ok());
}

// Claim: a checkpoint whose records are not of its merged segments, of other chains, or damaged is not read.
TEST(ChainFilm, ContradictoryCheckpointsAreRefused) {
  film::MergedFilm film(kLayout, 10);
  ASSERT_TRUE(film.merge(delta_of(segments(0, 0, 2))).ok());
  ChainRecords records(kFew, std::make_shared<const chains::ChainRecord>());
  const auto two = records_of(segments(0, 0, 2));
  records[0] = std::make_shared<const chains::ChainRecord>(two[0]);
  EXPECT_EQ(parse_checkpoint(encode_checkpoint(film, records), kFew).error().field, "chain_records");
  records[2] = std::make_shared<const chains::ChainRecord>(two[1]);
  const std::string good = encode_checkpoint(film, records);
  ASSERT_TRUE(parse_checkpoint(good, kFew).ok());
  EXPECT_FALSE(parse_checkpoint(good, kFew + 2).ok());
  EXPECT_FALSE(parse_checkpoint(good, 0).ok());
  EXPECT_FALSE(parse_checkpoint(film.serialise(), kFew).ok());
  EXPECT_TRUE(parse_checkpoint(encode_checkpoint(film, {}), 0).ok());
  for (std::size_t i = 0; i < good.size(); i += 7) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 4);
    EXPECT_FALSE(parse_checkpoint(bad, kFew).ok()) << i;
    EXPECT_FALSE(parse_checkpoint(std::string_view(good).substr(0, i), kFew).ok()) << i;
  }
}

// ---- the store

JobRow chain_row() {
  JobRow job;
  job.id = "j";
  job.settings.width = 30;
  job.settings.height = 20;
  job.stop.iterations = 7;
  job.layers = {"independent"};
  job.chains = ChainPlan{1000, 300, 5000};
  job.pilot_scale_log2 = -3;
  job.bootstrap_rejected = {1, 2, 3, 4, 5};
  return job;
}

// Claim: plan, bootstrap, starts and figures come back to the last bit, and the bootstrap's rows go when the
// starts are there.
TEST(ChainStore, KeepsWhatItIsTold) {
  test::TemporaryFolder folder;
  const fs::path path = folder.path() / "s.sqlite";
  JobRow job = chain_row();
  UnitRow unit;
  unit.id = 3;
  unit.job_id = "j";
  unit.unit = {Unit::Kind::bootstrap, 0, 20, 30};
  const BootstrapRow first{"j", 0, {0.1F, 0, 3e30F}, {5, 0, 0, 1}}, second{"j", 3, {7}, {}};
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE(store.ok());
    ASSERT_TRUE((*store)
                    ->write(std::vector<Change>{PutJob{job}, PutUnit{unit}, PutBootstrap{first},
                                                PutBootstrap{second}})
                    .ok());
    const auto state = (*store)->load();
    ASSERT_TRUE(state.ok()) << state.error().to_string();
    const JobRow& row = state->jobs.at(0);
    EXPECT_FALSE(row.named_state);
    ASSERT_TRUE(row.chains);
    EXPECT_EQ(row.chains->segment_mutations, 5000U);
    EXPECT_EQ(row.pilot_scale_log2, -3);
    EXPECT_EQ(row.bootstrap_rejected, job.bootstrap_rejected);
    EXPECT_EQ(state->unmerged_units.at(0).unit.kind, Unit::Kind::bootstrap);
    ASSERT_EQ(state->bootstraps.size(), 2U);
    EXPECT_EQ(state->bootstraps[0].contributions, first.contributions);
    EXPECT_EQ(state->bootstraps[0].rejected, first.rejected);
    EXPECT_EQ(state->bootstraps[1].begin, 3U);
  }
  job.named_state = NamedState{12, 0.1};
  job.bootstrap = {0.1 + 0.2, 1e-300, 300};
  job.chain_summary.normalisation = {0.3, 0.01, 999};
  job.chain_summary.groups[5].longest_stay = 17;
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE((*store)->write(std::vector<Change>{PutStarts{"j", {5, 1ULL << 40, 0}}, PutJob{job}}).ok());
  }
  auto store = open_sqlite_store(path);
  const auto state = (*store)->load();
  ASSERT_TRUE(state.ok()) << state.error().to_string();
  EXPECT_TRUE(state->bootstraps.empty());
  EXPECT_EQ(state->chain_starts.at("j"), (std::vector<std::uint64_t>{5, 1ULL << 40, 0}));
  EXPECT_EQ(state->jobs[0].named_state->bootstrap_b, 0.1);
  EXPECT_EQ(state->jobs[0].bootstrap, job.bootstrap);
  EXPECT_EQ(state->jobs[0].chain_summary.normalisation.samples, 999U);
  EXPECT_EQ(state->jobs[0].chain_summary.groups[5].longest_stay, 17U);
}

// Claim: a plan that cannot be is refused when the store is read.
TEST(ChainStore, ImpossiblePlansAreRefused) {
  test::TemporaryFolder folder;
  const fs::path path = folder.path() / "s.sqlite";
  ASSERT_TRUE((*open_sqlite_store(path))->write(std::vector<Change>{PutJob{chain_row()}}).ok());
  ASSERT_TRUE((*open_sqlite_store(path))->load().ok());
  execute(path, "UPDATE jobs SET chains = 3");
  EXPECT_FALSE((*open_sqlite_store(path))->load().ok());
}

}  // namespace
}  // namespace candela::master
