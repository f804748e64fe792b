// The decisions of a job of epochs in its film: folding, checkpoints, and films that went back.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <ctime>
#include <filesystem>

#include "common/adaptive/channels.h"
#include "common/adaptive/levels.h"
#include "common/base/files.h"
#include "common/base/hash.h"
#include "common/film/unit_film.h"
#include "common/rng/stream.h"
#include "master/merge/job_film.h"
#include "tests/temporary_folder.h"

namespace candela::master {
namespace {

namespace fs = std::filesystem;
using Per = film::AccumulatorSpec::Per;

constexpr film::Layout kLayout{40, 36, 1};
const std::vector<film::AccumulatorSpec> kSpecs{{"moments", 2, 8, Per::epoch}, {"matrix", 1, 0, Per::job}};
const EpochPlan kPlan{4, 1U << 16, 1, "rule", {}};  // epoch e: indices [2e, 2e + 2) of both halves
const CheckpointShape kShape{0, kSpecs, kPlan};

film::Delta delta_of(std::uint32_t half, std::uint64_t epoch) {
  film::UnitFilm film(kLayout, 10);
  film::UnitAccumulator moments(kLayout.width, kLayout.height, kSpecs[0]);
  film::UnitAccumulator matrix(kLayout.width, kLayout.height, kSpecs[1]);
  film::SampleCounts sample_counts;
  for (std::uint32_t y = 0; y < kLayout.height; ++y)
    for (std::uint32_t x = 0; x < kLayout.width; ++x) {
      const std::uint64_t key = rng::key(half, epoch, y, x);
      const double u = rng::to_double(key);
      moments.add(x, y, 0, std::array<double, 2>{u, u * u}, key, sample_counts);
    }
  film.count(sample_counts);
  film::DeltaWriter writer({{Unit::Kind::iterations, half, 2 * epoch, 2 * epoch + 2}, {}, 0, "j", "b"});
  writer.film(film);
  writer.accumulator(moments, epoch);
  writer.accumulator(matrix, 0);
  writer.counts(sample_counts);
  auto delta = film::Delta::decode(writer.finish(), {kLayout, kSpecs});
  EXPECT_TRUE(delta.ok()) << delta.error().to_string();
  return std::move(*delta);
}

JobFilm job_film(const fs::path& folder) {
  return JobFilm(folder, kLayout, 10, &write_file_atomically, kShape);
}

std::string hash_of(std::uint64_t epoch) {
  return sha256_hex(fmt::format("state {}", epoch));
}

// A decision by a rule that adds up all sums.
MadeDecision made_of(const NextDecision& next) {
  MadeDecision made{{"rule", next.epoch, {}, 0}, fmt::format("state {}", next.epoch), *next.carry};
  made.state.sha256 = sha256_hex(made.bytes);
  made.state.size_bytes = made.bytes.size();
  for (std::size_t i = 0; i < next.sums.size(); ++i)
    EXPECT_TRUE(made.carry.sums.at(i).merge(*next.sums[i]).ok());
  made.carry.memo += static_cast<char>('a' + next.epoch % 26);
  return made;
}
// Makes all decisions that can be made, at most to `limit`.
void decide(JobFilm& film, std::uint64_t limit = ~0ULL) {
  while (film.decisions() < limit) {
    const auto next = film.next_decision();
    if (!next || next->epoch > 40) return;
    const auto folded = film.fold(made_of(*next));
    ASSERT_TRUE(folded.ok()) << folded.error().to_string();
    ASSERT_TRUE(*folded);
  }
}
void merge(JobFilm& film, std::uint64_t epoch) {
  for (std::uint32_t half = 0; half < 2; ++half)
    ASSERT_EQ(*film.merge(delta_of(half, epoch)), JobFilm::Outcome::merged);
}
std::string newest(const fs::path& folder, const JobFilm& film) {
  return *read_file(folder / fmt::format("film.{}.ckpt", film.generation()), 1 << 24);
}

// Claim: a decision waits until the epoch it folds is whole; the state, the carry and the end of the epoch's
// sums become visible together; a delta of a folded epoch is a duplicate and changes no sum; readers keep
// what they hold.
TEST(FilmDecisions, FoldAWholeEpochOnce) {
  test::TemporaryFolder folder;
  JobFilm film = job_film(folder.path());
  EXPECT_FALSE(film.next_decision()) << "not loaded";
  ASSERT_TRUE(film.ensure_loaded().ok());
  decide(film);
  EXPECT_EQ(film.decisions(), 2U) << "lag 1: the third needs epoch 0";
  ASSERT_EQ(*film.merge(delta_of(0, 0)), JobFilm::Outcome::merged);
  ASSERT_EQ(*film.merge(delta_of(1, 1)), JobFilm::Outcome::merged);
  EXPECT_FALSE(film.next_decision()) << "half of epoch 0";
  ASSERT_EQ(*film.merge(delta_of(1, 0)), JobFilm::Outcome::merged);
  const auto next = film.next_decision();
  ASSERT_TRUE(next);
  EXPECT_EQ(next->epoch, 2U);
  EXPECT_EQ(next->folded, 0U);
  EXPECT_EQ(*next->previous, "state 1");
  EXPECT_EQ(*next->folded_state, "state 0");
  const std::string sums = next->sums.at(0)->serialise();
  const MadeDecision made = made_of(*next);
  EXPECT_TRUE(*film.fold(made));
  EXPECT_FALSE(*film.fold(made)) << "a second time";
  EXPECT_EQ(film.decisions(), 3U);
  EXPECT_TRUE(film.latest().carry->sums.at(0).serialise() == sums);
  EXPECT_EQ(film.latest().carry->memo, "abc");
  EXPECT_FALSE(film.state_bytes(0));
  ASSERT_TRUE(film.state_bytes(1));
  EXPECT_TRUE(next->carry->memo == "ab") << "of the reader";
  const auto zeros = film::MergedAccumulator(kLayout.width, kLayout.height, kSpecs[0]).serialise();
  EXPECT_TRUE(film.accumulator("moments", 0)->serialise() == zeros);
  EXPECT_FALSE(film.accumulator("moments", 1)->serialise() == zeros);
  EXPECT_EQ(*film.merge(delta_of(0, 0)), JobFilm::Outcome::duplicate);
  EXPECT_TRUE(film.accumulator("moments", 0)->serialise() == zeros);
}

// Claim: the carry, and the sums of the epochs that are not in it, are together all that was merged.
TEST(FilmDecisions, CarryAndOpenEpochsAreAll) {
  test::TemporaryFolder folder;
  JobFilm film = job_film(folder.path());
  ASSERT_TRUE(film.ensure_loaded().ok());
  EXPECT_FALSE(film.latest().carry);
  decide(film);
  merge(film, 0);
  merge(film, 1);
  ASSERT_EQ(*film.merge(delta_of(1, 2)), JobFilm::Outcome::merged);
  const auto zeros = film::MergedAccumulator(kLayout.width, kLayout.height, kSpecs[0]).serialise();
  const auto epoch_sums = [&](std::uint64_t epoch) { return film.accumulator("moments", epoch); };
  const auto count = [&] {
    auto sums = film::MergedAccumulator(kLayout.width, kLayout.height, kSpecs[0]);
    EXPECT_TRUE(sums.merge(film.latest().carry->sums.at(0)).ok());
    for (std::uint64_t epoch = 0; epoch < 3; ++epoch) EXPECT_TRUE(sums.merge(*epoch_sums(epoch)).ok());
    return sums.serialise();
  };
  for (std::uint64_t epoch = 0; epoch < 3; ++epoch) EXPECT_FALSE(epoch_sums(epoch)->serialise() == zeros);
  const std::string all = count();
  const auto before = film.latest().carry;
  const std::string of_reader = before->sums.at(0).serialise();
  decide(film);
  EXPECT_TRUE(epoch_sums(0)->serialise() == zeros) << "folded";
  EXPECT_TRUE(epoch_sums(1)->serialise() == zeros) << "folded";
  EXPECT_FALSE(epoch_sums(2)->serialise() == zeros);
  EXPECT_TRUE(count() == all);
  EXPECT_TRUE(before->sums.at(0).serialise() == of_reader) << "the reader keeps what it has";
}

// Claim: a checkpoint is as large after thirty epochs as after eight, but for the list of states.
TEST(FilmDecisions, CheckpointsStayBounded) {
  test::TemporaryFolder folder;
  JobFilm film = job_film(folder.path());
  ASSERT_TRUE(film.ensure_loaded().ok());
  std::size_t early = 0;
  std::uint64_t early_memory = 0;
  for (std::uint64_t e = 0; e < 30; ++e) {
    decide(film);
    merge(film, e);
    ASSERT_TRUE(film.checkpoint().ok());
    if (e == 7) early = newest(folder.path(), film).size();
    if (e == 7) early_memory = film.latest().statistics_bytes;
  }
  EXPECT_LT(newest(folder.path(), film).size(), early + early / 5 + 30 * 100);
  EXPECT_LT(film.latest().statistics_bytes, early_memory + 100);
}

// Claim: what is read is what was written, to the byte; a checkpoint with other bytes is damaged, also where
// its own checksum says nothing.
TEST(FilmDecisions, AreInTheCheckpoint) {
  test::TemporaryFolder folder;
  std::string bytes;
  {
    JobFilm film = job_film(folder.path());
    ASSERT_TRUE(film.ensure_loaded().ok());
    for (std::uint64_t e = 0; e < 4; ++e) {
      decide(film);
      merge(film, e);
    }
    ASSERT_TRUE(film.checkpoint().ok());
    EXPECT_FALSE(film.dirty());
    decide(film, film.decisions() + 1);
    EXPECT_TRUE(film.dirty()) << "a decision alone";
    ASSERT_TRUE(film.checkpoint().ok());
    bytes = newest(folder.path(), film);
  }
  JobFilm film = job_film(folder.path());
  ASSERT_TRUE(film.ensure_loaded().ok());
  EXPECT_EQ(film.decisions(), 6U);
  EXPECT_EQ(film.states().size(), 6U);
  EXPECT_EQ(film.latest().carry->memo, "abcdef");
  ASSERT_TRUE(film.checkpoint().ok());
  EXPECT_TRUE(newest(folder.path(), film) == bytes);

  EXPECT_FALSE(parse_checkpoint(bytes, {0, kSpecs}).ok()) << "a job without epochs";
  for (std::size_t i = 0; i < bytes.size(); i += 97) {
    std::string bad = bytes;
    bad[i] = static_cast<char>(bad[i] ^ 16);
    EXPECT_FALSE(parse_checkpoint(bad, kShape).ok()) << i;
    EXPECT_FALSE(parse_checkpoint(std::string_view(bytes).substr(0, i), kShape).ok()) << i;
  }
  ParsedCheckpoint parsed = *parse_checkpoint(bytes, kShape);
  parsed.decisions.bytes[4] = std::make_shared<const std::string>("another");
  const auto encoded = encode_checkpoint(parsed.film, {}, parsed.accumulators, parsed.decisions);
  EXPECT_EQ(parse_checkpoint(encoded, kShape).error().field, "decisions");
}

// Claim: a film that went back to an older checkpoint makes its decisions again from it, and refuses a state
// other than the one it has been told of.
TEST(FilmDecisions, AreMadeAgain) {
  test::TemporaryFolder folder;
  std::string carry;
  {
    JobFilm film = job_film(folder.path());
    ASSERT_TRUE(film.ensure_loaded().ok());
    for (std::uint64_t e = 0; e < 5; ++e) {
      decide(film);
      merge(film, e);
      if (e == 2) {
        ASSERT_TRUE(film.checkpoint().ok());
      }
    }
    decide(film);
    EXPECT_EQ(film.decisions(), 7U);
    carry = film.latest().carry->sums[0].serialise();
  }
  JobFilm film = job_film(folder.path());
  ASSERT_TRUE(film.ensure_loaded().ok());
  EXPECT_EQ(film.decisions(), 4U);
  film.remember({"rule", 4, hash_of(4), 7});
  film.remember({"rule", 5, std::string(64, 'b'), 7});
  film.remember({"rule", 9, hash_of(9), 7});
  EXPECT_EQ(film.states().size(), 6U);
  decide(film);
  merge(film, 3);
  const auto next = film.next_decision();
  ASSERT_TRUE(next);
  EXPECT_EQ(film.fold(made_of(*next)).error().kind, ErrorKind::failed) << "epoch 5 was another state";
  EXPECT_EQ(film.decisions(), 5U);
}

// Claim: a checkpoint of the form before carries has the sums of all epochs: they are folded again, and give
// the states that it names.
TEST(FilmDecisions, OldCheckpointsAreFoldedAgain) {
  test::TemporaryFolder folder;
  JobFilm film = job_film(folder.path() / "new");
  ASSERT_TRUE(film.ensure_loaded().ok());
  film::MergedFilm old(kLayout, 10);
  Accumulators accumulators;
  Decisions decisions;
  for (std::uint64_t e = 0; e < 4; ++e) {
    decide(film);
    merge(film, e);
    auto sums = std::make_shared<film::MergedAccumulator>(kLayout.width, kLayout.height, kSpecs[0]);
    for (std::uint32_t half = 0; half < 2; ++half) {
      const film::Delta delta = delta_of(half, e);
      ASSERT_TRUE(old.merge(delta).ok());
      sums->merge(delta.accumulators()[0].sums);
    }
    accumulators[{0, e}] = sums;
    decisions.states.push_back({"rule", e, hash_of(e), 0});
  }
  decide(film);
  ASSERT_TRUE(make_directories(folder.path() / "old").ok());
  ASSERT_TRUE(write_file_atomically(folder.path() / "old" / "film.3.ckpt",
                                    encode_checkpoint(old, {}, accumulators, decisions))
                  .ok());
  JobFilm again = job_film(folder.path() / "old");
  ASSERT_TRUE(again.ensure_loaded().ok());
  EXPECT_EQ(again.decisions(), 0U);
  EXPECT_EQ(again.states().size(), 4U);
  decide(again);
  EXPECT_EQ(again.states(), film.states());
  EXPECT_TRUE(again.latest().carry->sums[0].serialise() == film.latest().carry->sums[0].serialise());
  EXPECT_TRUE(again.dirty());
}

// Claim: verification compares what two generations carry: a carry that was changed is found even where its
// checkpoint is sealed.
TEST(FilmDecisions, VerificationComparesCarries) {
  test::TemporaryFolder folder;
  JobFilm film = job_film(folder.path());
  ASSERT_TRUE(film.ensure_loaded().ok());
  for (std::uint64_t e = 0; e < 3; ++e) {
    decide(film);
    merge(film, e);
    ASSERT_TRUE(film.checkpoint().ok());
  }
  ASSERT_EQ(*film.merge(delta_of(0, 3)), JobFilm::Outcome::merged);
  ASSERT_TRUE(film.checkpoint().ok());
  EXPECT_TRUE(film.verify_files()->contradiction.empty());
  const fs::path path = folder.path() / "film.4.ckpt";
  ParsedCheckpoint parsed = *parse_checkpoint(*read_file(path, 1 << 24), kShape);
  Carry carry = *parsed.decisions.carry;
  const std::array<film::Int128, 2> sums{1, 2};
  carry.sums[0].set_pixel(3, 5, sums);
  parsed.decisions.carry = std::make_shared<const Carry>(carry);
  ASSERT_TRUE(
      write_file_atomically(path, encode_checkpoint(parsed.film, {}, parsed.accumulators, parsed.decisions))
          .ok());
  const auto found = film.verify_files();
  ASSERT_TRUE(found.ok());
  EXPECT_TRUE(found->damage.empty()) << found->damage;
  EXPECT_NE(found->contradiction.find("carried"), std::string::npos) << found->contradiction;
}

// Prints the master's CPU seconds for one epoch of fppm at 1920 x 1080, all pixels with photons. Run with
// --gtest_also_run_disabled_tests.
TEST(FilmDecisions, DISABLED_SecondsOfAnEpoch) {
  constexpr film::Layout kLarge{1920, 1080, 1};
  const std::vector<film::AccumulatorSpec> specs{adaptive::sectors_spec(20), adaptive::squares_spec(20)};
  EpochPlan plan{8, 16, 1, "fppm", {{"critical", "12345678901"}, {"test", "sectors"}}};
  adaptive::put_levels({0.7, 18, {}}, plan.constants);
  const auto seconds = [last = std::clock()](const char* what) mutable {
    const std::clock_t now = std::clock();
    std::printf("%-28s %.3f CPU s\n", what, static_cast<double>(now - last) / CLOCKS_PER_SEC);
    last = std::clock();
  };
  auto clock = seconds;
  film::UnitFilm film(kLarge, 20);
  film::UnitAccumulator sectors(kLarge.width, kLarge.height, specs[0]);
  film::UnitAccumulator squares(kLarge.width, kLarge.height, specs[1]);
  film::SampleCounts sample_counts;
  for (std::uint32_t y = 0; y < kLarge.height; ++y)
    for (std::uint32_t x = 0; x < kLarge.width; ++x) {
      const std::uint64_t key = rng::key(y, x);
      std::array<double, adaptive::kSectorChannels> values;
      for (std::size_t s = 0; s < values.size(); ++s) values[s] = rng::to_double(rng::key(key, s)) * 0.1;
      sectors.add(x, y, 0, values, key, sample_counts);
      const double square = 0.01;
      squares.add(x, y, 0, {&square, 1}, key, sample_counts);
      film.add(0, x, y, {1, 1, 1}, key, sample_counts);
    }
  const auto bytes_of = [&](std::uint32_t half, std::uint64_t epoch) {
    film::DeltaWriter writer({{Unit::Kind::iterations, half, 4 * epoch, 4 * epoch + 4}, {}, 0, "j", "b"});
    writer.film(film);
    writer.accumulator(sectors, epoch);
    writer.accumulator(squares, epoch);
    writer.counts(sample_counts);
    return writer.finish();
  };
  clock("making the sums");
  const std::string first = bytes_of(0, 0), second = bytes_of(1, 0);
  clock("two encoded deltas");
  std::printf("%.1f MB each\n", static_cast<double>(first.size()) * 1e-6);
  test::TemporaryFolder folder;
  JobFilm job(folder.path(), kLarge, 20, &write_file_atomically, {0, specs, plan});
  ASSERT_TRUE(job.ensure_loaded().ok());
  const auto step = [&] {
    const auto next = job.next_decision();
    ASSERT_TRUE(next);
    auto made = make(*next, plan, kLarge);
    ASSERT_TRUE(made.ok()) << made.error().to_string();
    clock("decided");
    ASSERT_TRUE(*job.fold(std::move(*made)));
    clock("folded");
  };
  step();
  step();
  for (const std::string* bytes : {&first, &second}) {
    auto delta = film::Delta::decode(*bytes, {kLarge, specs});
    ASSERT_TRUE(delta.ok()) << delta.error().to_string();
    clock("delta decoded");
    ASSERT_EQ(*job.merge(*delta), JobFilm::Outcome::merged);
    clock("delta merged");
  }
  step();
  ASSERT_TRUE(job.checkpoint().ok());
  clock("checkpoint");
  std::printf("%.1f MB of statistics\n", static_cast<double>(job.latest().statistics_bytes) * 1e-6);
}

}  // namespace
}  // namespace candela::master
