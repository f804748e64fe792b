// The sums beside a job's film: merging with it, and in its checkpoints.
#include <gtest/gtest.h>

#include <array>
#include <filesystem>

#include "common/base/files.h"
#include "common/film/unit_film.h"
#include "common/rng/stream.h"
#include "master/merge/job_film.h"
#include "tests/temporary_folder.h"

namespace candela::master {
namespace {

namespace fs = std::filesystem;
using Per = film::AccumulatorSpec::Per;

constexpr film::Layout kWide{40, 8, 1};
const std::vector<film::AccumulatorSpec> kSpecs{{"moments", 2, 8, Per::epoch}, {"matrix", 1, 0, Per::job}};
const std::string kHash(64, 'a');

// Unit [i, i + 1) of a half, in epoch i / 4.
film::Delta delta_of(std::uint32_t half, std::uint64_t i) {
  film::UnitFilm film(kWide, 10);
  film::UnitAccumulator moments(kWide.width, kWide.height, kSpecs[0]);
  film::UnitAccumulator matrix(kWide.width, kWide.height, kSpecs[1]);
  film::SampleCounts sample_counts;
  const std::uint64_t key = rng::key(half, i);
  const auto x = static_cast<std::uint32_t>(key % kWide.width);
  film.splat(0, x, 3, {1, 2, 3}, key, sample_counts);
  moments.add(x, 3, 0, std::array<double, 2>{0.5, 0.25}, key, sample_counts);
  matrix.add(x, 3, 0, std::array<double, 1>{7}, key, sample_counts);
  film.count(sample_counts);
  film::DeltaWriter writer({{Unit::Kind::iterations, half, i, i + 1}, {}, 0, "j", "b"});
  writer.film(film);
  writer.accumulator(moments, i / 4);
  writer.accumulator(matrix, 0);
  writer.counts(sample_counts);
  auto delta = film::Delta::decode(writer.finish(), {kWide, kSpecs});
  EXPECT_TRUE(delta.ok()) << delta.error().to_string();
  return std::move(*delta);
}

std::int64_t total(const JobFilm& film, std::string_view name, std::uint64_t part) {
  const auto sums = film.accumulator(name, part);
  if (!sums) return -1;
  std::int64_t sum = 0;
  for (std::uint32_t y = 0; y < kWide.height; ++y)
    for (std::uint32_t x = 0; x < kWide.width; ++x) sum += static_cast<std::int64_t>(sums->sum(x, y, 0));
  return sum;
}

JobFilm job_film(const fs::path& folder) {
  return JobFilm(folder, kWide, 10, &write_file_atomically, CheckpointShape{0, kSpecs});
}

// Claim: film and accumulators change together or not at all; a sum of each epoch has the units of that epoch
// alone, a sum of the job one for each half; a reader's sums do not change.
TEST(JobAccumulators, FollowTheFilm) {
  test::TemporaryFolder folder;
  JobFilm film = job_film(folder.path());
  EXPECT_EQ(film.accumulator("moments", 0), nullptr) << "not loaded";
  ASSERT_TRUE(film.ensure_loaded().ok());
  EXPECT_EQ(total(film, "moments", 0), 0) << "nothing is merged";
  EXPECT_EQ(film.accumulator("unknown", 0), nullptr);
  for (std::uint64_t i = 0; i < 6; ++i) {
    EXPECT_EQ(*film.merge(delta_of(0, i)), JobFilm::Outcome::merged);
    EXPECT_EQ(*film.merge(delta_of(0, i)), JobFilm::Outcome::duplicate);
  }
  const auto held = film.accumulator("moments", 1);
  EXPECT_EQ(*film.merge(delta_of(1, 4)), JobFilm::Outcome::merged);
  EXPECT_EQ(total(film, "moments", 0), 4 * 128);
  EXPECT_EQ(total(film, "moments", 1), 3 * 128) << "of both halves";
  EXPECT_EQ(total(film, "moments", 2), 0);
  EXPECT_EQ(total(film, "matrix", 0), 6 * 7);
  EXPECT_EQ(total(film, "matrix", 1), 7);
  std::int64_t before = 0;
  for (std::uint32_t x = 0; x < kWide.width; ++x) before += static_cast<std::int64_t>(held->sum(x, 3, 0));
  EXPECT_EQ(before, 2 * 128);

  film::UnitFilm alone(kWide, 10);
  const auto plain = film::Delta::decode(
      film::encode_delta(alone, {{Unit::Kind::iterations, 1, 9, 10}, {}, 0, "j", "b"}), kWide);
  ASSERT_TRUE(plain.ok());
  EXPECT_EQ(film.merge(*plain).error().field, "accumulators");
  EXPECT_FALSE(film.account().merged[1].intersects(9, 10));
}

// Claim: pairs of pixel and key beyond those that there is memory for are refused, of one unit and of
// several, as a fault of what was asked for. The sums are those of before, and no pair is dropped.
TEST(JobAccumulators, TooManyKeysAreRefused) {
  constexpr film::Layout kFilm{256, 256, 1};
  film::AccumulatorSpec spec{"mattes", 1, 0, Per::job, film::AccumulatorSpec::Domain::keys};
  spec.key_names.assign(17, "name");  // in all pixels a few more than 2^20 pairs
  const auto delta_of = [&](std::uint64_t unit, std::uint32_t first, std::uint32_t last) {
    film::UnitAccumulator mattes(kFilm.width, kFilm.height, spec);
    film::SampleCounts sample_counts;
    for (std::uint32_t key = first; key < last; ++key)
      for (std::uint32_t p = 0; p < kFilm.pixel_count(); ++p)
        mattes.add_key(p % kFilm.width, p / kFilm.width, key, 1, 1, sample_counts);
    EXPECT_EQ(mattes.overfull(), last - first == 17);
    film::DeltaWriter writer({{Unit::Kind::iterations, 0, unit, unit + 1}, {}, 0, "j", "b"});
    writer.film(film::UnitFilm(kFilm, 10));
    writer.accumulator(mattes, 0);
    writer.counts({});
    return film::Delta::decode(writer.finish(), {kFilm, {spec}});
  };
  EXPECT_FALSE(delta_of(0, 0, 17).ok());
  const auto first = delta_of(0, 0, 9), second = delta_of(1, 8, 17);
  ASSERT_TRUE(first.ok() && second.ok());
  test::TemporaryFolder folder;
  JobFilm film(folder.path(), kFilm, 10, &write_file_atomically, CheckpointShape{0, {spec}});
  ASSERT_TRUE(film.ensure_loaded().ok());
  ASSERT_TRUE(film.merge(*first).ok());
  const std::string before = film.accumulator("mattes", 0)->serialise();
  const auto refused = film.merge(*second);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().kind, ErrorKind::usage);
  EXPECT_EQ(refused.error().field, "accumulators");
  EXPECT_TRUE(film.accumulator("mattes", 0)->serialise() == before);
  EXPECT_FALSE(film.account().merged[0].intersects(1, 2));
  // A refused delta takes no room from those that come after it.
  const auto third = delta_of(2, 0, 9);
  ASSERT_TRUE(third.ok());
  EXPECT_TRUE(film.merge(*third).ok());
  const std::string after = film.accumulator("mattes", 0)->serialise();
  ASSERT_TRUE(film.checkpoint().ok());
  JobFilm again(folder.path(), kFilm, 10, &write_file_atomically, CheckpointShape{0, {spec}});
  ASSERT_TRUE(again.ensure_loaded().ok());
  EXPECT_TRUE(again.accumulator("mattes", 0)->serialise() == after);
}

// Claim: one checkpoint holds film, accumulators and states; what is read is what was written, to the byte;
// a state that is remembered makes the job dirty; damaged and foreign bytes are refused, and checkpoints of
// films alone are read as before.
TEST(JobAccumulators, AreInTheCheckpoint) {
  test::TemporaryFolder folder;
  std::string bytes;
  {
    JobFilm film = job_film(folder.path());
    ASSERT_TRUE(film.ensure_loaded().ok());
    for (std::uint64_t i = 0; i < 6; ++i) ASSERT_TRUE(film.merge(delta_of(i % 2, i)).ok());
    ASSERT_TRUE(film.checkpoint().ok());
    EXPECT_FALSE(film.dirty());
    film.remember({"radius", 0, kHash, 0});
    film.remember({"radius", 0, std::string(64, 'b'), 0});
    EXPECT_TRUE(film.dirty());
    ASSERT_TRUE(film.checkpoint().ok());
    EXPECT_FALSE(film.dirty());
    bytes = *read_file(folder.path() / "film.2.ckpt", 1 << 20);
  }
  JobFilm film = job_film(folder.path());
  ASSERT_TRUE(film.ensure_loaded().ok());
  EXPECT_EQ(film.states(), (std::vector<DecidedState>{{"radius", 0, kHash, 0}}));
  EXPECT_EQ(total(film, "moments", 0), 4 * 128);
  EXPECT_EQ(total(film, "matrix", 1), 3 * 7);
  EXPECT_FALSE(film.dirty());
  ASSERT_TRUE(film.checkpoint().ok());
  EXPECT_TRUE(*read_file(folder.path() / "film.3.ckpt", 1 << 20) == bytes);

  const CheckpointShape shape{0, kSpecs};
  ASSERT_TRUE(parse_checkpoint(bytes, shape).ok());
  EXPECT_EQ(parse_checkpoint(bytes, 0).error().field, "accumulators");
  EXPECT_FALSE(parse_checkpoint(bytes, {6, kSpecs}).ok());
  EXPECT_FALSE(parse_checkpoint(bytes, {0, {{"moments", 3, 8, Per::epoch}, kSpecs[1]}}).ok());
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::string bad = bytes;
    bad[i] = static_cast<char>(bad[i] ^ 16);
    EXPECT_FALSE(parse_checkpoint(bad, shape).ok()) << i;
    EXPECT_FALSE(parse_checkpoint(std::string_view(bytes).substr(0, i), shape).ok()) << i;
  }
  const film::MergedFilm plain(kWide, 10);
  EXPECT_TRUE(encode_checkpoint(plain, {}) == plain.serialise());
  EXPECT_TRUE(parse_checkpoint(plain.serialise(), shape).ok());
}

// Claim: checkpoints and snapshots in memory that another, larger or smaller, film left there are those in
// fresh memory, to the byte.
TEST(JobAccumulators, CheckpointsInUsedMemoryAreTheSame) {
  test::TemporaryFolder folder;
  const film::Layout layouts[] = {{200, 90, 1}, {40, 33, 3}, {200, 90, 1}, {70, 70, 1}};
  JobFilm::Room room;
  for (std::size_t k = 0; k < std::size(layouts); ++k) {
    const film::Layout& layout = layouts[k];
    std::string bytes[2];
    for (const bool fresh : {false, true}) {
      const auto at = folder.path() / (std::to_string(k) + (fresh ? "fresh" : "used"));
      JobFilm film(at, layout, 10, &write_file_atomically);
      ASSERT_TRUE(film.ensure_loaded().ok());
      film::UnitFilm unit(layout, 10);
      film::SampleCounts sample_counts;
      for (std::uint32_t x = 0; x < layout.width; x += 1 + static_cast<std::uint32_t>(k))
        unit.add(0, x, x % layout.height, {1.5f, 2, static_cast<float>(k)}, x, sample_counts);
      const auto delta = film::Delta::decode(
          film::encode_delta(unit, {{Unit::Kind::iterations, 0, 3, 4}, {}, 0, "j", "b"}), layout);
      ASSERT_TRUE(delta.ok());
      ASSERT_TRUE(film.merge(*delta).ok());
      const auto written = fresh ? film.checkpoint() : film.checkpoint(room);
      ASSERT_TRUE(written.ok());
      bytes[fresh ? 1 : 0] = *read_file(at / "film.1.ckpt", 1 << 22);
      const JobFilm::Snapshot plain = film.snapshot(JobFilm::Part::image);
      const JobFilm::Snapshot inside = film.snapshot_in(room);
      EXPECT_TRUE(inside.film->serialise() == plain.film->serialise()) << k;
      EXPECT_EQ(inside.film->layout().layers, 1U);
    }
    EXPECT_TRUE(bytes[0] == bytes[1]) << k;
  }
}

}  // namespace
}  // namespace candela::master
