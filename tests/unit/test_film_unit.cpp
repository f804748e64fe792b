// Tests of the accumulator of one unit: what is added, what is refused, and that rounding is unbiased.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <thread>

#include "common/film/film.h"

namespace candela::film {
namespace {

using Rgb = std::array<float, kChannels>;

std::int64_t sum_at(const UnitFilm& film, std::uint32_t layer, std::uint32_t x, std::uint32_t y,
                    std::size_t c) {
  const Layout& l = film.layout();
  return film.sums()[((std::size_t{layer} * l.height + y) * l.width + x) * kChannels + c];
}

// Claim: rounding is unbiased even for values far below one film unit. For each scale of value, N samples are
// summed and compared with the exact sum; the rounding error of one sample is Bernoulli with variance f (1 -
// f), f the fraction. 3 channels x 6 values at 5 standard errors: false-alarm rate below 18 * 5.8e-7 = 1.1e-5
// (and the seeds are fixed).
TEST(UnitFilm, RoundingIsUnbiased) {
  constexpr int kSamples = 400000;
  for (const double units : {1e-3, 1e-2, 0.25, 0.5, 0.999, 1234.567}) {
    UnitFilm film({1, 1, 1}, 20);
    const auto value = static_cast<float>(units * 0x1p-20);
    SampleCounts sample_counts;
    for (int i = 0; i < kSamples; ++i) {
      ASSERT_TRUE(film.add(0, 0, 0, {value, value, value}, rng::key(7, i), sample_counts));
    }
    const double exact = double{value} * 0x1p20;
    const double fraction = exact - std::floor(exact);
    const double standard_error = std::sqrt(kSamples * fraction * (1 - fraction));
    for (std::size_t c = 0; c < kChannels; ++c) {
      const double error = static_cast<double>(sum_at(film, 0, 0, 0, c)) - kSamples * exact;
      EXPECT_LT(std::abs(error), 5 * standard_error) << units << " units, channel " << c;
    }
  }
}

// Claim: the dither is independent of the numbers that rng::Stream draws from the same key: rounding does not
// lean with the sampled path. Samples are added only where the stream's first number is in a narrow range. 6
// comparisons at 5 standard errors: false-alarm rate below 4e-6.
TEST(UnitFilm, RoundingIsIndependentOfTheSamplesOwnNumbers) {
  for (const double low : {0.0, 0.95}) {
    UnitFilm film({1, 1, 1}, 0);
    SampleCounts sample_counts;
    int added = 0;
    for (int i = 0; i < 400000; ++i) {
      const std::uint64_t key = rng::key(3, i);
      const double u = rng::Stream(key).next_double();
      if (u < low || u >= low + 0.05) continue;
      film.add(0, 0, 0, {0.5F, 0.5F, 0.5F}, key, sample_counts);
      ++added;
    }
    ASSERT_GT(added, 15000);
    for (std::size_t c = 0; c < kChannels; ++c) {
      EXPECT_LT(std::abs(static_cast<double>(sum_at(film, 0, 0, 0, c)) - 0.5 * added),
                5 * 0.5 * std::sqrt(added));
    }
  }
}

// Claim: whole numbers of units are exact, and signed values round the same way.
TEST(UnitFilm, WholeUnitsAreExact) {
  UnitFilm film({40, 3, 2}, 4);
  SampleCounts sample_counts;
  EXPECT_TRUE(film.add(1, 39, 2, {1.0F, 2.5F, 0.0F}, 11, sample_counts));
  EXPECT_TRUE(film.add(1, 39, 2, {-3.0F, -0.0625F, -0.0F}, 12, sample_counts, true));
  EXPECT_EQ(sum_at(film, 1, 39, 2, 0), 16 - 48);
  EXPECT_EQ(sum_at(film, 1, 39, 2, 1), 40 - 1);
  EXPECT_EQ(sum_at(film, 1, 39, 2, 2), 0);
  EXPECT_TRUE(film.touched(3));
  EXPECT_FALSE(film.touched(0));
  EXPECT_EQ(sample_counts, SampleCounts{});
  film.clear();
  EXPECT_FALSE(film.touched(3));
  EXPECT_EQ(sum_at(film, 1, 39, 2, 0), 0);
}

// Claim: each bad value is counted once under its cause and leaves all channels alone, for add and splat
// alike.
TEST(UnitFilm, BadValuesAreCountedAndKeptOut) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  struct Case {
    Rgb rgb;
    bool is_signed;
    int cause;  // -1: accepted
  };
  const float limit = 0x1p46F;  // 2^56 units at 2^10 units a value
  const Case cases[] = {
      {{1, kNan, 1}, false, 0},
      {{-1, -kInfinity, kNan}, false, 0},
      {{1, 1, -kNan}, true, 0},
      {{kInfinity, 1, 1}, false, 1},
      {{-1, -kInfinity, 1}, true, 1},
      {{1, 1, -1e-30F}, false, 2},
      {{-1, 1e30F, 1}, false, 2},
      {{1, 1e30F, 1}, false, 3},
      {{1, std::nextafter(limit, kInfinity), 1}, false, 3},
      {{1, -1e30F, 1}, true, 3},
      {{1, limit, 1}, false, -1},
      {{1, -limit, 1}, true, -1},
      {{-0.0F, 0.0F, 1}, false, -1},
      {{std::numeric_limits<float>::denorm_min(), 0, 0}, false, -1},
  };
  for (const Case& c : cases) {
    for (const bool splat : {false, true}) {
      UnitFilm film({1, 1, 1}, 10);
      SampleCounts sample_counts;
      const bool added = splat ? film.splat(0, 0, 0, c.rgb, 5, sample_counts, c.is_signed)
                               : film.add(0, 0, 0, c.rgb, 5, sample_counts, c.is_signed);
      EXPECT_EQ(added, c.cause < 0);
      SampleCounts expected;
      if (c.cause >= 0) {
        expected.rejected[static_cast<std::size_t>(c.cause)] = 1;
        for (std::size_t i = 0; i < kChannels; ++i) EXPECT_EQ(sum_at(film, 0, 0, 0, i), 0);
      }
      EXPECT_EQ(sample_counts, expected) << c.rgb[0] << " " << c.rgb[1] << " " << c.rgb[2];
      EXPECT_FALSE(film.overflowed());
    }
  }
  EXPECT_EQ(name(RejectCause::saturated), "saturated");
}

// Claim: a sum that wraps around is noticed, in both directions, by add and splat.
TEST(UnitFilm, OverflowIsNoticed) {
  for (const float sign : {1.0F, -1.0F}) {
    for (const bool splat : {false, true}) {
      UnitFilm film({1, 1, 1}, 0);
      SampleCounts sample_counts;
      const Rgb rgb{0, sign * 0x1p56F, 0};
      const auto once = [&](std::uint64_t key) {
        return splat ? film.splat(0, 0, 0, rgb, key, sample_counts, true)
                     : film.add(0, 0, 0, rgb, key, sample_counts, true);
      };
      for (std::uint64_t i = 0; i < 127; ++i) ASSERT_TRUE(once(i));
      EXPECT_FALSE(film.overflowed());
      ASSERT_TRUE(once(127));  // 128 * 2^56 = 2^63; -2^63 still fits
      if (sign < 0) {
        EXPECT_FALSE(film.overflowed());
        ASSERT_TRUE(once(128));
      }
      EXPECT_TRUE(film.overflowed());
      film.clear();
      EXPECT_FALSE(film.overflowed());
    }
  }
}

// Claim: splats from several threads sum to the same integers as from one, in any order.
TEST(UnitFilm, SplatsFromThreadsAreExact) {
  constexpr std::uint32_t kSplats = 60000;
  const auto splat = [](UnitFilm& film, std::uint32_t i) {
    const std::uint64_t key = rng::key(1, i);
    rng::Stream stream(key);
    SampleCounts sample_counts;
    film.splat(0, stream.next_u32() % 5, stream.next_u32() % 3,
               {stream.next_float(), stream.next_float(), stream.next_float()}, key, sample_counts);
    film.count({1, 2, 3, {}});
  };
  UnitFilm alone({5, 3, 1}, 12);
  for (std::uint32_t i = 0; i < kSplats; ++i) splat(alone, i);
  UnitFilm shared({5, 3, 1}, 12);
  std::vector<std::thread> threads;
  for (std::uint32_t t = 0; t < 3; ++t) {
    threads.emplace_back([&shared, &splat, t] {
      for (std::uint32_t i = kSplats; i-- > 0;) {
        if (i % 3 == t) splat(shared, i);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_TRUE(std::equal(alone.sums(), alone.sums() + 45, shared.sums()));
  EXPECT_EQ(shared.sample_counts(), (SampleCounts{kSplats, 2 * kSplats, 3 * kSplats, {}}));
}

// Claim: scales at both ends of the allowed range work, and beyond them nothing is built.
TEST(UnitFilm, ScalesAndLayoutsAreBounded) {
  for (const int scale : {-kMaxScaleLog2, kMaxScaleLog2}) {
    UnitFilm film({1, 1, 1}, scale);
    SampleCounts sample_counts;
    const float value = scale < 0 ? 0x1p127F : 0x1p-149F;
    ASSERT_TRUE(film.add(0, 0, 0, {value, 0, 0}, 1, sample_counts));
    EXPECT_EQ(sum_at(film, 0, 0, 0, 0), scale < 0 ? 0 : std::int64_t{1} << 51);
  }
  EXPECT_TRUE(validate({65536, 4096, 4}, 0).ok());
  EXPECT_FALSE(validate({65536, 4096, 5}, 0).ok());
  EXPECT_FALSE(validate({65536, 4097, 1}, 0).ok());
  EXPECT_FALSE(validate({65537, 1, 1}, 0).ok());
  EXPECT_FALSE(validate({0, 1, 1}, 0).ok());
  EXPECT_FALSE(validate({1, 1, 0}, 0).ok());
  EXPECT_FALSE(validate({1, 1, 65}, 0).ok());
  EXPECT_FALSE(validate({1, 1, 1}, 201).ok());
  EXPECT_FALSE(validate({1, 1, 1}, -201).ok());
}

// Claim: index sets join neighbours, refuse overlaps and find gaps, as compared with a plain array of flags.
TEST(IndexSet, AgreesWithFlags) {
  rng::Stream stream(99);
  for (int round = 0; round < 200; ++round) {
    IndexSet set;
    std::array<bool, 40> flags{};
    for (int step = 0; step < 30; ++step) {
      const std::uint64_t begin = stream.next_u32() % 40;
      const std::uint64_t end = std::min<std::uint64_t>(40, begin + stream.next_u32() % 6);
      bool overlap = false;
      for (std::uint64_t i = begin; i < end; ++i) overlap |= flags[i];
      EXPECT_EQ(set.intersects(begin, end), overlap);
      EXPECT_EQ(set.insert(begin, end), begin < end && !overlap);
      if (!overlap)
        std::fill(flags.begin() + static_cast<int>(begin), flags.begin() + static_cast<int>(end), true);
      const std::uint64_t from = stream.next_u32() % 40, limit = stream.next_u32() % 41;
      std::uint64_t gap = from;
      while (gap < limit && flags[gap]) ++gap;
      std::uint64_t gap_end = gap;
      while (gap_end < limit && !flags[gap_end]) ++gap_end;
      const auto found = set.first_gap(from, limit);
      EXPECT_EQ(found.second - found.first, gap_end - gap);
      if (gap < gap_end) {
        EXPECT_EQ(found.first, gap);
      }
    }
    EXPECT_EQ(set.count(), static_cast<std::uint64_t>(std::count(flags.begin(), flags.end(), true)));
    std::uint64_t last = 0;
    bool first = true;
    for (const auto& [begin, end] : set.ranges()) {
      EXPECT_TRUE(first || begin > last);  // never touching
      last = end;
      first = false;
    }
  }
}

}  // namespace
}  // namespace candela::film
