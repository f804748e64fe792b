// Tests of the job's film: merging is commutative, associative and idempotent by refusal, to the last bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/film/codec.h"
#include "common/film/film.h"

namespace candela::film {
namespace {

constexpr Layout kLayout{70, 41, 2};
constexpr int kScale = 8;

// One iteration of a made-up integrator: pure in (half, index), some samples bad.
void render_iteration(UnitFilm& film, std::uint32_t half, std::uint64_t index, float brightness) {
  const std::uint64_t key = rng::key(77, half, index);
  rng::Stream stream(key);
  SampleCounts sample_counts;
  for (std::uint64_t i = 0; i < 150; ++i) {
    const float weight = i == 13 ? std::nanf("") : brightness * stream.next_float();
    film.splat(stream.next_u32() % 2, stream.next_u32() % 50, stream.next_u32() % 41,
               {weight, stream.next_float(), -stream.next_float()}, rng::combine(key, i), sample_counts,
               true);
    ++sample_counts.eye_samples;
  }
  film.count(sample_counts);
}

std::string unit_bytes(std::uint32_t half, std::uint64_t begin, std::uint64_t end, float brightness) {
  UnitFilm film(kLayout, kScale);
  for (std::uint64_t i = begin; i < end; ++i) render_iteration(film, half, i, brightness);
  EXPECT_FALSE(film.overflowed());
  DeltaInfo info;
  info.unit = {Unit::Kind::iterations, half, begin, end};
  return encode_delta(film, info);
}

Delta decode(const std::string& bytes) {
  auto delta = Delta::decode(bytes, kLayout);
  EXPECT_TRUE(delta.ok());
  return std::move(delta).value();
}

// Claim (law 3): however the iterations are cut into units, in whatever order they are merged, and through
// however many partial films (relays), the checkpoint bytes and the image are the same. Bright values make
// some tiles leave 64 bits.
TEST(MergedFilm, IsTheSameInAnyOrderAndGrouping) {
  for (const float brightness : {1.0F, 0x1p47F}) {
    std::string expected;
    std::vector<float> image;
    rng::Stream stream(4);
    for (int trial = 0; trial < 8; ++trial) {
      std::vector<Delta> deltas;
      for (std::uint32_t half = 0; half < 2; ++half) {
        for (std::uint64_t begin = 0; begin < 24;) {
          const std::uint64_t end = std::min<std::uint64_t>(24, begin + 1 + stream.next_u32() % 7);
          deltas.push_back(decode(unit_bytes(half, begin, end, brightness)));
          begin = end;
        }
      }
      for (std::size_t i = deltas.size(); i > 1; --i) std::swap(deltas[i - 1], deltas[stream.next_u32() % i]);
      std::vector<MergedFilm> relays(1 + stream.next_u32() % 4, MergedFilm(kLayout, kScale));
      for (const Delta& delta : deltas) {
        MergedFilm& relay = relays[stream.next_u32() % relays.size()];
        ASSERT_TRUE(relay.merge(delta).ok());
        // A duplicate is refused and changes nothing.
        const std::string before = relay.serialise();
        const auto again = relay.merge(delta);
        ASSERT_FALSE(again.ok());
        EXPECT_EQ(again.error().kind, ErrorKind::refused);
        EXPECT_EQ(relay.serialise(), before);
      }
      MergedFilm film(kLayout, kScale);
      for (const MergedFilm& relay : relays) ASSERT_TRUE(film.merge(relay).ok());
      for (std::uint32_t half = 0; half < 2; ++half) {
        EXPECT_EQ(film.merged(half).ranges(), (std::map<std::uint64_t, std::uint64_t>{{0, 24}}));
        EXPECT_EQ(film.sample_counts(half).eye_samples, 24U * 150U);
        EXPECT_EQ(film.sample_counts(half).rejected[0], 24U);
      }
      EXPECT_EQ(film.iterations(), 48U);
      if (trial == 0) {
        expected = film.serialise();
        image = film.develop(1);
      }
      EXPECT_EQ(film.serialise(), expected);
      EXPECT_EQ(film.develop(1), image);
      const auto parsed = MergedFilm::parse(expected);
      ASSERT_TRUE(parsed.ok()) << parsed.error().to_string();
      EXPECT_EQ(parsed->serialise(), expected);
      EXPECT_EQ(parsed->develop(1), image);
    }
  }
}

UnitFilm& add_units(UnitFilm& film, std::int64_t sign, int times) {
  SampleCounts sample_counts;
  for (int i = 0; i < times; ++i) {
    film.add(0, 3, 4, {static_cast<float>(sign) * 0x1p48F, 0, 0}, static_cast<std::uint64_t>(i),
             sample_counts, true);
  }
  return film;
}

// Claim: films of the first and the second form, whose sample counts had seven and ten counts, are read as
// they were; the counts that they lack are 0.
TEST(MergedFilm, ReadsEarlierForms) {
  MergedFilm film(kLayout, kScale);
  for (std::uint32_t half = 0; half < 2; ++half)
    ASSERT_TRUE(film.merge(decode(unit_bytes(half, 0, 3, 1))).ok());
  for (const auto& [magic, bytes] : {std::pair{"CANFILM1", 56U}, {"CANFILM2", 80U}}) {
    SCOPED_TRACE(magic);
    std::string old = film.serialise();
    ASSERT_TRUE(old.starts_with("CANFILM3"));
    old.resize(old.size() - sizeof(std::uint64_t));
    old.replace(0, 8, magic);
    for (std::uint32_t half = 0; half < 2; ++half) {
      std::string sample_counts;
      put_sample_counts(sample_counts, film.sample_counts(half));
      ASSERT_EQ(sample_counts.size(), 88U);
      const std::size_t at = old.find(sample_counts);
      ASSERT_NE(at, std::string::npos);
      old.erase(at + bytes, 88 - bytes);
    }
    seal(old);
    const auto read = MergedFilm::parse(old);
    ASSERT_TRUE(read.ok()) << read.error().to_string();
    EXPECT_EQ(read->serialise(), film.serialise());
    old.replace(0, 8, "CANFILM4");
    EXPECT_FALSE(MergedFilm::parse(old).ok());
  }
}

// Claim: sums leave 64 bits without wrapping, exactly, and come back to the same bytes as a film that never
// left them.
TEST(MergedFilm, WidensAndStaysCanonical) {
  const auto delta = [](std::uint64_t index, std::int64_t sign) {
    UnitFilm film(kLayout, kScale);
    add_units(film, sign, 127);  // +-127 * 2^56
    EXPECT_FALSE(film.overflowed());
    DeltaInfo info;
    info.unit = {Unit::Kind::iterations, 0, index, index + 1};
    return decode(encode_delta(film, info));
  };
  MergedFilm film(kLayout, kScale);
  const Int128 once = Int128{127} << 56;
  for (std::uint64_t i = 0; i < 10; ++i) {
    ASSERT_TRUE(film.merge(delta(i, 1)).ok());
    ASSERT_TRUE(film.sum(0, 0, 3, 4, 0) == once * static_cast<int>(i + 1));
  }
  EXPECT_EQ(film.develop(0)[(4 * 70 + 3) * 3], 127.0F * 0x1p48F);
  const auto wide = MergedFilm::parse(film.serialise());
  ASSERT_TRUE(wide.ok());
  EXPECT_TRUE(wide->sum(0, 0, 3, 4, 0) == once * 10);
  // Back below 64 bits by negative contributions; another order never leaves 64 bits.
  MergedFilm narrow(kLayout, kScale);
  for (std::uint64_t i = 0; i < 10; ++i) {
    ASSERT_TRUE(film.merge(delta(10 + i, -1)).ok());
    ASSERT_TRUE(narrow.merge(delta(i, 1)).ok());
    ASSERT_TRUE(narrow.merge(delta(10 + i, -1)).ok());
  }
  EXPECT_TRUE(film.sum(0, 0, 3, 4, 0) == 0);
  EXPECT_EQ(film.serialise(), narrow.serialise());
  EXPECT_EQ(film.develop(0), narrow.develop(0));
}

// Claim: what does not belong is refused whole: other scale, other layout, a pilot, an overlap in the second
// half only.
TEST(MergedFilm, RefusesWhatDoesNotBelong) {
  MergedFilm film(kLayout, kScale);
  ASSERT_TRUE(film.merge(decode(unit_bytes(0, 0, 4, 1))).ok());
  ASSERT_TRUE(film.merge(decode(unit_bytes(1, 2, 4, 1))).ok());
  const std::string before = film.serialise();
  const auto expect_refused = [&](const Result<void>& result) {
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().kind, ErrorKind::refused);
    EXPECT_EQ(film.serialise(), before);
  };
  expect_refused(film.merge(decode(unit_bytes(0, 3, 5, 1))));
  UnitFilm other(kLayout, kScale + 1);
  DeltaInfo info;
  info.unit = {Unit::Kind::iterations, 0, 9, 10};
  expect_refused(film.merge(decode(encode_delta(other, info))));
  UnitFilm same(kLayout, kScale);
  info.unit.kind = Unit::Kind::pilot;
  expect_refused(film.merge(decode(encode_delta(same, info))));
  info.unit.kind = Unit::Kind::iterations;
  same.count({~0ULL, 0, 0, {}});
  expect_refused(film.merge(decode(encode_delta(same, info))));
  expect_refused(film.merge(MergedFilm({70, 41, 1}, kScale)));
  MergedFilm partial(kLayout, kScale);
  ASSERT_TRUE(partial.merge(decode(unit_bytes(0, 4, 5, 1))).ok());
  ASSERT_TRUE(partial.merge(decode(unit_bytes(1, 3, 6, 1))).ok());
  expect_refused(film.merge(partial));
  expect_refused(film.merge(film));
}

// Claim: the image is the sum over the iterations of the halves asked for; nothing merged gives black.
TEST(MergedFilm, DevelopsMeans) {
  MergedFilm film({3, 2, 1}, 4);
  EXPECT_EQ(film.develop(0), std::vector<float>(18, 0.0F));
  const auto merge = [&](std::uint32_t half, std::uint64_t begin, std::uint64_t end, float value) {
    UnitFilm unit({3, 2, 1}, 4);
    SampleCounts sample_counts;
    unit.add(0, 2, 1, {value, 0, 0}, 1, sample_counts);
    DeltaInfo info;
    info.unit = {Unit::Kind::iterations, half, begin, end};
    const auto delta = Delta::decode(encode_delta(unit, info), Layout{3, 2, 1});
    ASSERT_TRUE(delta.ok());
    ASSERT_TRUE(film.merge(*delta).ok());
  };
  merge(0, 0, 3, 12);
  merge(1, 5, 6, 2);
  EXPECT_EQ(film.develop(0)[15], 3.5F);
  EXPECT_EQ(film.develop(0, MergedFilm::Which::half0)[15], 4.0F);
  EXPECT_EQ(film.develop(0, MergedFilm::Which::half1)[15], 2.0F);
  EXPECT_EQ(film.develop(0)[0], 0.0F);
}

// Claim: any damaged checkpoint is refused; a resealed one never crashes, and what is accepted has the same
// bytes again.
TEST(MergedFilm, DamagedCheckpointsAreRefused) {
  MergedFilm film({34, 3, 1}, kScale);
  UnitFilm unit({34, 3, 1}, kScale);
  SampleCounts sample_counts;
  for (std::uint32_t i = 0; i < 12; ++i)
    unit.add(0, 3 * i % 34, i % 3, {1, 1.0F * static_cast<float>(i), 0}, i, sample_counts);
  DeltaInfo info;
  info.unit = {Unit::Kind::iterations, 0, 2, 5};
  ASSERT_TRUE(film.merge(Delta::decode(encode_delta(unit, info), Layout{34, 3, 1}).value()).ok());
  const std::string good = film.serialise();
  ASSERT_TRUE(MergedFilm::parse(good).ok());
  ASSERT_FALSE(MergedFilm::parse(good + '\0').ok());
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 0x10);
    ASSERT_FALSE(MergedFilm::parse(bad).ok());
    ASSERT_FALSE(MergedFilm::parse(std::string_view(good).substr(0, i)).ok());
    if (i < 24 || i + 8 >= good.size()) continue;  // the layout is tested by validate()
    bad.resize(bad.size() - 8);
    seal(bad);
    const auto parsed = MergedFilm::parse(bad);
    if (parsed.ok()) {
      EXPECT_TRUE(MergedFilm::parse(parsed->serialise()).ok());
    }
  }
}

}  // namespace
}  // namespace candela::film
