// Sums beside the film: what a worker adds, what travels, what a master adds up.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <thread>

#include "common/film/accumulator_add.h"
#include "common/film/film.h"
#include "common/rng/stream.h"

namespace candela::film {
namespace {

using Per = AccumulatorSpec::Per;

constexpr std::uint32_t kWidth = 70, kHeight = 45;  // tiles that the border cuts
const AccumulatorSpec kSpec{"sums", 3, 12, Per::epoch};
const Layout kFilm{kWidth, kHeight, 1};

// Samples of one unit, at a few places.
void fill(UnitAccumulator& sums, std::uint64_t seed, int count, bool splat = false) {
  SampleCounts sample_counts;
  for (int i = 0; i < count; ++i) {
    const std::uint64_t key = rng::key(seed, static_cast<std::uint64_t>(i));
    const auto x = static_cast<std::uint32_t>(key % kWidth),
               y = static_cast<std::uint32_t>(key / 97 % kHeight);
    const std::array<double, 3> values{1, -0.3, std::ldexp(static_cast<double>(key % 1000), -5)};
    EXPECT_TRUE(splat ? sums.splat(x, y, 0, values, key, sample_counts)
                      : sums.add(x, y, 0, values, key, sample_counts));
  }
}

DeltaInfo info_of(std::uint64_t begin) {
  return {{Unit::Kind::iterations, 0, begin, begin + 1}, {}, 0, "job", "build"};
}
std::string encode(const UnitAccumulator& sums, std::uint64_t epoch, std::uint64_t begin = 0) {
  const UnitFilm film(kFilm, 4);
  DeltaWriter writer(info_of(begin));
  writer.film(film);
  writer.accumulator(sums, epoch);
  writer.counts({});
  return writer.finish();
}
const DeltaShape kShape{kFilm, {kSpec}};

// Claim: the sum of a sample's roundings is unbiased and depends on its key alone; two threads and one give
// the same integers; clear() leaves nothing behind.
TEST(Accumulator, SumsAreOfTheSamples) {
  UnitAccumulator one(kWidth, kHeight, kSpec), two(kWidth, kHeight, kSpec);
  fill(one, 7, 4000);
  fill(one, 8, 4000);
  {
    std::jthread other([&] { fill(two, 8, 4000, true); });
    fill(two, 7, 4000, true);
  }
  const std::size_t values = std::size_t{kWidth} * kHeight * kSpec.channels;
  EXPECT_TRUE(std::equal(one.sums(), one.sums() + values, two.sums()));
  two.clear();
  EXPECT_TRUE(std::all_of(two.sums(), two.sums() + values, [](std::int64_t v) { return v == 0; }));
  EXPECT_EQ(encode(two, 0), encode(UnitAccumulator(kWidth, kHeight, kSpec), 0));

  // Every channel by itself: the mean of many roundings of x is x within five standard errors.
  constexpr int kSamples = 100000;
  const AccumulatorSpec wide{"wide", kMaxAccumulatorChannels, 0, Per::job};
  UnitAccumulator coarse(1, 1, wide);
  SampleCounts sample_counts;
  std::array<double, kMaxAccumulatorChannels> x{};
  for (std::size_t c = 0; c < x.size(); ++c) x[c] = (static_cast<double>(c) + 0.5) / 64 - 0.25;
  for (std::uint64_t i = 0; i < kSamples; ++i) coarse.add(0, 0, 0, x, rng::key(3, i), sample_counts);
  for (std::size_t c = 0; c < x.size(); ++c) {
    const double mean = static_cast<double>(coarse.sums()[c]) / kSamples;
    EXPECT_NEAR(mean, x[c], 5 * 0.5 / std::sqrt(static_cast<double>(kSamples))) << "channel " << c;
  }
}

// Claim: add(), which takes few channels and moderate values four at a time, and splat(), which takes one
// after another, give the same integers: for any number of channels from any channel on, any sign and size,
// and values that are integers already.
TEST(Accumulator, FourAtATimeAreOneAfterAnother) {
  const AccumulatorSpec wide{"wide", 64, 10, Per::job};
  UnitAccumulator one(1, 1, wide), four(1, 1, wide);
  SampleCounts sample_counts;
  std::vector<double> values;
  for (std::uint64_t i = 0; i < 20000; ++i) {
    rng::Stream random(rng::key(11, i));
    values.resize(1 + i % 17);
    // Up to 2^45 times 2^10 units: below and above where the fast way ends.
    const int largest = static_cast<int>(random.next_u32() % 75) - 30;
    for (double& value : values) {
      value = std::ldexp(2 * random.next_double() - 1, largest);
      if (random.next_u32() % 8 == 0) value = std::ldexp(std::round(std::ldexp(value, 10)), -10);
    }
    const std::uint32_t first = random.next_u32() % (64 - static_cast<std::uint32_t>(values.size()));
    const std::uint64_t key = random.next_u64();
    ASSERT_TRUE(one.splat(0, 0, first, values, key, sample_counts));
    ASSERT_TRUE(four.add(0, 0, first, values, key, sample_counts));
    ASSERT_TRUE(std::equal(one.sums(), one.sums() + 64, four.sums())) << "sample " << i;
  }
}

// Values beyond kCount do not reach the sums, and a refused sample leaves no value.
template <std::size_t kCount>
void add_known_count() {
  const AccumulatorSpec spec{"sums", kCount + 5, 30, Per::job};
  UnitAccumulator array(kWidth, kHeight, spec), plain(kWidth, kHeight, spec);
  SampleCounts of_array, of_plain;
  for (std::uint64_t i = 0; i < 400; ++i) {
    const std::uint64_t key = rng::key(11, i);
    const auto x = static_cast<std::uint32_t>(key % kWidth),
               y = static_cast<std::uint32_t>(key / 97 % kHeight),
               first = static_cast<std::uint32_t>(key / 7 % 6);
    std::array<double, (kCount + 3) / 4 * 4> values{};
    for (std::size_t c = 0; c < values.size(); ++c)
      values[c] = std::ldexp(static_cast<double>(rng::key(key, c) % 2000) - 1000, -14);
    if (i % 50 == 7) values[i % kCount] = 1e30;
    if (i % 50 == 9) values[i % kCount] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(array.add_array<kCount>(array.place(x, y), first, values, key, dither_word(key), of_array),
              plain.add(x, y, first, std::span(values).template first<kCount>(), key, of_plain));
  }
  const std::size_t sums = std::size_t{kWidth} * kHeight * spec.channels;
  EXPECT_TRUE(std::equal(array.sums(), array.sums() + sums, plain.sums())) << kCount;
  EXPECT_EQ(of_array.rejected, of_plain.rejected);
}

// Claim: a number of values that the compiler knows has the sums of any number, at any first channel.
TEST(Accumulator, KnownCountsAreThoseOfSpans) {
  [&]<std::size_t... kLess>(std::index_sequence<kLess...>) {
    (add_known_count<kLess + 1>(), ...);
  }
  (std::make_index_sequence<14>());
}

// Claim: NaN, infinite and absurdly large values add nothing to any channel and count once, by cause; a sum
// that leaves 64 bits is noticed.
TEST(Accumulator, BadSamplesAreCountedAndOverflowNoticed) {
  UnitAccumulator sums(4, 4, kSpec);
  SampleCounts sample_counts;
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = HUGE_VAL, huge = 0x1p45;
  EXPECT_FALSE(sums.add(1, 1, 0, std::array<double, 3>{1, nan, inf}, 1, sample_counts));
  EXPECT_FALSE(sums.splat(1, 1, 1, std::array<double, 2>{-inf, 1}, 2, sample_counts));
  EXPECT_FALSE(sums.add(1, 1, 0, std::array<double, 3>{1, 1, -huge}, 3, sample_counts));
  EXPECT_EQ(sample_counts.rejected, (std::array<std::uint64_t, kRejectCauses>{1, 1, 0, 1}));
  EXPECT_TRUE(std::all_of(sums.sums(), sums.sums() + 48, [](std::int64_t v) { return v == 0; }));
  EXPECT_TRUE(sums.add(1, 1, 2, std::array<double, 1>{-5}, 4, sample_counts)) << "signs are free";
  EXPECT_EQ(sums.sums()[(4 + 1) * 3 + 2], -5 * 4096);
  EXPECT_FALSE(sums.overflowed());
  for (int i = 0; i < 300; ++i) sums.splat(0, 0, 0, std::array<double, 1>{0x1p44}, 5, sample_counts);
  EXPECT_TRUE(sums.overflowed());
  sums.clear();
  EXPECT_FALSE(sums.overflowed());
}

// Claim: what travels is what was added, in few bytes where little was; merging is exact, in any order and
// grouping, and the stored form is of the sums alone.
TEST(Accumulator, MergingIsExactInAnyOrder) {
  constexpr std::uint64_t kUnits = 12;
  std::vector<std::string> deltas;
  std::vector<std::int64_t> expected(std::size_t{kWidth} * kHeight * kSpec.channels);
  for (std::uint64_t u = 0; u < kUnits; ++u) {
    UnitAccumulator sums(kWidth, kHeight, kSpec);
    fill(sums, u, u % 3 == 0 ? 2 : 500);
    for (std::size_t i = 0; i < expected.size(); ++i) expected[i] += sums.sums()[i];
    deltas.push_back(encode(sums, 5, u));
  }
  EXPECT_LT(deltas[0].size(), 600U) << "two samples";
  std::mt19937 shuffle(1);
  std::string stored;
  for (int order = 0; order < 4; ++order) {
    MergedAccumulator all(kWidth, kHeight, kSpec), relay(kWidth, kHeight, kSpec);
    for (std::size_t u = 0; u < deltas.size(); ++u) {
      const auto delta = Delta::decode(deltas[u], kShape);
      ASSERT_TRUE(delta.ok()) << delta.error().to_string();
      ASSERT_EQ(delta->accumulators().size(), 1U);
      EXPECT_EQ(delta->accumulators()[0].epoch, 5U);
      (u % 2 == 0 ? all : relay).merge(delta->accumulators()[0].sums);
    }
    ASSERT_TRUE(all.merge(relay).ok());
    for (std::uint32_t y = 0; y < kHeight; ++y)
      for (std::uint32_t x = 0; x < kWidth; ++x)
        for (std::uint32_t c = 0; c < kSpec.channels; ++c)
          ASSERT_TRUE(all.sum(x, y, c) == expected[(std::size_t{y} * kWidth + x) * kSpec.channels + c]);
    if (stored.empty()) stored = all.serialise();
    EXPECT_TRUE(all.serialise() == stored);
    const auto back = MergedAccumulator::parse(stored, kWidth, kHeight, kSpec);
    ASSERT_TRUE(back.ok()) << back.error().to_string();
    EXPECT_TRUE(back->serialise() == stored);
    std::shuffle(deltas.begin(), deltas.end(), shuffle);
  }
  AccumulatorSpec other = kSpec;
  other.scale_log2 = 11;
  EXPECT_FALSE(
      MergedAccumulator(kWidth, kHeight, kSpec).merge(MergedAccumulator(kWidth, kHeight, other)).ok());
  EXPECT_FALSE(MergedAccumulator::parse(stored, kWidth, kHeight, other).ok());
  EXPECT_FALSE(MergedAccumulator::parse(stored, kHeight, kWidth, kSpec).ok());
  EXPECT_FALSE(MergedAccumulator::parse(stored + '\0', kWidth, kHeight, kSpec).ok());
  for (std::size_t i = 0; i < stored.size(); i += 7)
    EXPECT_FALSE(MergedAccumulator::parse(stored.substr(0, i), kWidth, kHeight, kSpec).ok()) << i;
}

// Claim: merged sums widen to 128 bits where 64 are too few, and stay exact there.
TEST(Accumulator, MergedSumsWiden) {
  const AccumulatorSpec spec{"sums", 1, 0, Per::epoch};
  UnitAccumulator unit(2, 1, spec);
  SampleCounts sample_counts;
  for (int i = 0; i < 127; ++i) unit.add(0, 0, 0, std::array<double, 1>{-0x1p56}, 1, sample_counts);
  unit.add(1, 0, 0, std::array<double, 1>{3}, 1, sample_counts);
  ASSERT_FALSE(unit.overflowed());
  const UnitFilm film({2, 1, 1}, 0);
  DeltaWriter writer(info_of(0));
  writer.film(film);
  writer.accumulator(unit, 0);
  writer.counts({});
  const auto delta = Delta::decode(writer.finish(), {Layout{2, 1, 1}, {spec}});
  ASSERT_TRUE(delta.ok()) << delta.error().to_string();
  MergedAccumulator sums(2, 1, spec);
  for (int i = 0; i < 1000; ++i) sums.merge(delta->accumulators()[0].sums);
  EXPECT_TRUE(sums.sum(0, 0, 0) == Int128{-127000} * (Int128{1} << 56));
  EXPECT_TRUE(sums.sum(1, 0, 0) == 3000);
  const auto back = MergedAccumulator::parse(sums.serialise(), 2, 1, spec);
  ASSERT_TRUE(back.ok());
  EXPECT_TRUE(back->sum(0, 0, 0) == sums.sum(0, 0, 0));
}

// Claim: a delta holds exactly the sections that its unit and the job's plan have, in order; changed and cut
// bytes are refused, also when their checksum was made right.
TEST(Accumulator, SectionsAreThoseOfThePlan) {
  UnitAccumulator sums(kWidth, kHeight, kSpec);
  fill(sums, 1, 40);
  const std::string good = encode(sums, 5);
  ASSERT_TRUE(Delta::decode(good, kShape).ok());
  const auto field = [&](const DeltaShape& shape) {
    const auto delta = Delta::decode(good, shape);
    return delta.ok() ? "accepted" : delta.error().field;
  };
  EXPECT_EQ(field(kFilm), "sections") << "a job without accumulators";
  EXPECT_EQ(field({kFilm, {kSpec, {"more", 1, 0, Per::epoch}}}), "sections");
  EXPECT_EQ(field({kFilm, {{"other", 3, 12, Per::epoch}}}), "sections");
  EXPECT_EQ(field({kFilm, {{"sums", 3, 12, Per::job}}}), "sections") << "of an epoch";
  EXPECT_NE(field({kFilm, {{"sums", 4, 12, Per::epoch}}}), "accepted");
  EXPECT_NE(field({kFilm, {{"sums", 2, 12, Per::epoch}}}), "accepted");
  EXPECT_FALSE(Delta::decode(encode(sums, kMaxEpochs), kShape).ok());

  for (std::size_t i = 0; i < good.size(); ++i) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 64);
    ASSERT_FALSE(Delta::decode(bad, kShape).ok()) << "byte " << i;
    ASSERT_FALSE(Delta::decode(std::string_view(good).substr(0, i), kShape).ok()) << "length " << i;
  }
  for (std::size_t i = 8; i < good.size() - 8; ++i) {
    std::string bad = good.substr(0, good.size() - 8);
    bad[i] = static_cast<char>(bad[i] ^ 255);
    seal(bad);
    const auto delta = Delta::decode(bad, kShape);
    if (!delta.ok()) {
      ASSERT_FALSE(delta.error().message.empty());
      continue;
    }
    MergedAccumulator merged(kWidth, kHeight, kSpec);
    for (const auto& accumulator : delta->accumulators()) merged.merge(accumulator.sums);
  }
}

// Claim: a unit of bootstrap samples brings a table and counts, and no film; its values come back bit by bit.
TEST(Accumulator, TablesTravelWithoutAFilm) {
  const DeltaInfo info{{Unit::Kind::bootstrap, 0, 10, 13}, {}, 0, "job", "build"};
  const std::vector<float> values{0, 2.5F, 1e-30F};
  SampleCounts counts;
  counts.rejected[1] = 2;
  DeltaWriter writer(info);
  writer.table(values);
  writer.counts(counts);
  const std::string good = writer.finish();
  const auto delta = Delta::decode(good, kShape);
  ASSERT_TRUE(delta.ok()) << delta.error().to_string();
  EXPECT_EQ(delta->table(), values);
  EXPECT_EQ(delta->sample_counts(), counts);
  EXPECT_TRUE(delta->accumulators().empty());
  MergedFilm film(kFilm, 0);
  EXPECT_FALSE(film.merge(*delta).ok());

  const UnitFilm unit(kFilm, 4);
  DeltaWriter with_film(info);
  with_film.film(unit);
  with_film.counts({});
  EXPECT_EQ(Delta::decode(with_film.finish(), kShape).error().field, "sections");
}

// Claim: specs are bounded: names, channels, scales, their number, and their size together.
TEST(Accumulator, SpecsAreBounded) {
  const auto valid = [](std::vector<AccumulatorSpec> specs, std::uint32_t size = 100) {
    const auto checked = validate(specs, size, size);
    EXPECT_EQ(checked.ok() ? "" : checked.error().field, checked.ok() ? "" : "accumulators");
    return checked.ok();
  };
  EXPECT_TRUE(valid({}));
  EXPECT_TRUE(valid({{"a", 64, 200, Per::job}, {"b.c", 1, -200, Per::epoch}}));
  EXPECT_FALSE(valid({{"", 1, 0, Per::job}}));
  EXPECT_FALSE(valid({{"a/b", 1, 0, Per::job}}));
  EXPECT_FALSE(valid({{"a", 1, 0, Per::job}, {"a", 2, 0, Per::job}}));
  EXPECT_FALSE(valid({{"a", 0, 0, Per::job}}));
  EXPECT_FALSE(valid({{"a", kMaxAccumulatorChannels + 1, 0, Per::job}}));
  EXPECT_FALSE(valid({{"a", 1, 201, Per::job}}));
  EXPECT_FALSE(valid(std::vector<AccumulatorSpec>(17, AccumulatorSpec{"a", 1, 0, Per::job})));
  EXPECT_TRUE(valid({{"a", 12, 0, Per::job}}, 16384));
  EXPECT_FALSE(valid({{"a", 13, 0, Per::job}}, 16384));
}

}  // namespace
}  // namespace candela::film
