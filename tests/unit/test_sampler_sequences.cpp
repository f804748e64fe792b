// The samplers' claims: nets, uniformity, independence, replay. All seeds are fixed; where a test is
// statistical its false-alarm rate over the choice of seed is stated.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "chi_squared.h"
#include "worker/samplers/sampler.h"

namespace candela {
namespace {

using samplers::Sampler;
using samplers::SamplerKind;

Vec2 draw_2d(Sampler& s, std::uint32_t half, std::uint64_t index, std::uint32_t x, std::uint32_t y,
             std::uint32_t dim) {
  s.start(half, index, x, y);
  s.set_dimension(dim);
  return s.next_2d();
}

// Claim: five shift-xor steps are the product with Pascal's triangle mod 2 (Sobol's second direction
// numbers).
TEST(Sampler, ButterflyIsPascalsMatrix) {
  rng::Stream stream(rng::key(1));
  for (int n = 0; n < 2000; ++n) {
    const std::uint32_t index = n < 1000 ? static_cast<std::uint32_t>(n) : stream.next_u32();
    // v_1 = 1/2, v_{k+1} = v_k xor v_k / 2, as 32-bit fractions.
    std::uint32_t direction = 0x80000000u;
    std::uint32_t value = 0;
    for (int bit = 0; bit < 32; ++bit) {
      if (((index >> bit) & 1) != 0) value ^= direction;
      direction ^= direction >> 1;
    }
    ASSERT_EQ(samplers::detail::reverse_bits(samplers::detail::sobol_second_reversed(index)), value) << index;
  }
}

// Claim: every aligned block of 2^k points of every 2D draw is a (0, k, 2)-net: each elementary interval of
// area 2^-k holds exactly one of them. And 1D draws are stratified alike.
TEST(Sampler, BlocksAreNets) {
  for (const std::uint64_t seed : {0ull, 1ull, 0xfedcba9876543210ull}) {
    Sampler sampler(SamplerKind::sobol, seed);
    for (std::uint32_t dim = 0; dim < 20; ++dim) {
      for (const int k : {1, 4, 7, 10}) {
        const std::uint64_t count = std::uint64_t{1} << k;
        for (const std::uint64_t start :
             {std::uint64_t{0}, 5 * count, (std::uint64_t{1} << 32) * 3 + count}) {
          std::vector<Vec2> points;
          std::vector<int> line(count);
          for (std::uint64_t i = 0; i < count; ++i) {
            points.push_back(draw_2d(sampler, 1, start + i, 17, 5, dim));
            sampler.set_dimension(dim);
            ++line[static_cast<std::size_t>(sampler.next_1d() * static_cast<float>(count))];
          }
          for (const int c : line) ASSERT_EQ(c, 1) << "1D, dimension " << dim << ", k " << k;
          for (int a = 0; a <= k; ++a) {
            std::vector<int> cells(count);
            for (const Vec2& p : points) {
              const auto x = static_cast<std::uint64_t>(std::ldexp(p.x, a));
              const auto y = static_cast<std::uint64_t>(std::ldexp(p.y, k - a));
              ++cells[(y << a) + x];
            }
            for (const int c : cells)
              ASSERT_EQ(c, 1) << "dimension " << dim << ", k " << k << ", 2^" << a << " columns";
          }
        }
      }
    }
  }
}

// Claim: over the iterations (index), every draw of a light path is a (0,2)-sequence as a pixel's is: aligned
// blocks of 2^k are nets, whatever the path's number.
TEST(Sampler, LightPathsAreNetsOverIterations) {
  Sampler sampler(SamplerKind::sobol, 77);
  constexpr int k = 6;
  constexpr std::uint64_t count = 1 << k;
  for (const std::uint64_t path : {0ull, 1ull, 921599ull, 1ull << 40, (1ull << 63) - 1}) {
    for (const std::uint64_t start : {std::uint64_t{0}, 3 * count, (std::uint64_t{1} << 33) + count}) {
      for (const std::uint32_t dim : {0u, 1u, 19u}) {
        std::vector<Vec2> points;
        for (std::uint64_t i = 0; i < count; ++i) {
          sampler.start_light(1, start + i, path);
          sampler.set_dimension(dim);
          points.push_back(sampler.next_2d());
        }
        for (int a = 0; a <= k; ++a) {
          std::vector<int> cells(count);
          for (const Vec2& p : points)
            ++cells[(static_cast<std::uint64_t>(std::ldexp(p.y, k - a)) << a) +
                    static_cast<std::uint64_t>(std::ldexp(p.x, a))];
          for (const int c : cells) ASSERT_EQ(c, 1) << "path " << path << ", 2^" << a << " columns";
        }
      }
    }
  }
}

// Claim: light paths and eye samples share no key, whichever numbers they have: half, index and path (or
// pixel) chosen so that equal words are where a careless naming would let them meet (path j and pixel j, path
// y << 32 | x, half 1 of one and half 0 of the other). And paths do not repeat each other.
TEST(Sampler, LightAndEyeStreamsShareNoKey) {
  Sampler sampler(SamplerKind::sobol, 3);
  std::vector<std::uint64_t> keys;
  for (std::uint32_t half = 0; half < 2; ++half) {
    for (std::uint64_t index = 0; index < 40; ++index) {
      for (std::uint32_t y = 0; y < 12; ++y) {
        for (std::uint32_t x = 0; x < 12; ++x) {
          sampler.start(half, index, x, y);
          keys.push_back(sampler.sample_key());
          sampler.start_light(half, index, (std::uint64_t{y} << 32) | x);
          keys.push_back(sampler.sample_key());
          if (y == 0) continue;  // those below have no bits above the 32nd
          sampler.start_light(half, index, 12 * y + x);
          keys.push_back(sampler.sample_key());
        }
      }
    }
  }
  std::sort(keys.begin(), keys.end());
  EXPECT_EQ(std::adjacent_find(keys.begin(), keys.end()), keys.end());
}

// Claim: draws of light path j are independent of those of pixel j, of the next path's, and of the other
// half's: their joint histograms over 16384 paths are flat. Chi-squared of 16 x 16 bins; 2 x 3 tests share 1
// % of false alarm over the choice of the seed.
TEST(Sampler, LightPathsAreIndependentOfPixels) {
  constexpr int kBins = 16;
  constexpr std::uint32_t kPaths = 16384;
  const auto first = [](Sampler sampler, std::uint32_t half, std::uint64_t path) {
    sampler.start_light(half, 5, path);
    return sampler.next_2d();
  };
  for (const SamplerKind kind : {SamplerKind::independent, SamplerKind::sobol}) {
    const Sampler sampler(kind, 4321);
    const auto p_of = [&](auto pair) {
      std::vector<double> observed(kBins * kBins);
      for (std::uint32_t path = 0; path < kPaths; ++path) {
        const Vec2 v = pair(path);
        ++observed[static_cast<std::size_t>(v.x * kBins) * kBins + static_cast<std::size_t>(v.y * kBins)];
      }
      return test::chi_squared_p(observed,
                                 std::vector<double>(observed.size(), double{kPaths} / (kBins * kBins)));
    };
    EXPECT_GT(p_of([&](std::uint32_t path) {
                Sampler eye = sampler;
                return Vec2{first(sampler, 0, path).x, draw_2d(eye, 0, 5, path, 0, 0).x};
              }),
              0.01 / 6);
    EXPECT_GT(p_of([&](std::uint32_t path) {
                return Vec2{first(sampler, 0, path).x, first(sampler, 0, path + 1).x};
              }),
              0.01 / 6);
    EXPECT_GT(p_of([&](std::uint32_t path) {
                return Vec2{first(sampler, 0, path).y, first(sampler, 1, path).y};
              }),
              0.01 / 6);
  }
}

// Claim: a sample depends on its names alone, not on the order of asking.
TEST(Sampler, ReplaysOutOfOrder) {
  for (const SamplerKind kind : {SamplerKind::independent, SamplerKind::sobol}) {
    Sampler sampler(kind, 42);
    std::vector<Vec2> first;
    std::vector<float> first_1d;
    for (std::uint32_t i = 0; i < 200; ++i) {
      sampler.start(i % 2, i, i * 3, i * 7);
      static_cast<void>(sampler.next_2d());
      first_1d.push_back(sampler.next_1d());
      first.push_back(sampler.next_2d());
    }
    Sampler again(kind, 42);
    for (std::uint32_t j = 0; j < 200; ++j) {
      const std::uint32_t i = (j * 77) % 200;
      again.start(i % 2, i, i * 3, i * 7);
      again.set_dimension(2);
      const Vec2 v = again.next_2d();
      again.set_dimension(1);
      EXPECT_EQ(v.x, first[i].x);
      EXPECT_EQ(v.y, first[i].y);
      EXPECT_EQ(again.next_1d(), first_1d[i]);
    }
  }
}

// Claim: keys of different samples differ, and values lie in [0, 1).
TEST(Sampler, KeysAndRange) {
  Sampler sampler(SamplerKind::sobol, 3);
  std::vector<std::uint64_t> keys;
  for (std::uint32_t half = 0; half < 2; ++half) {
    for (std::uint32_t p = 0; p < 20; ++p) {
      for (std::uint64_t i = 0; i < 20; ++i) {
        sampler.start(half, i + (p << 30), p, p / 3);
        keys.push_back(sampler.sample_key());
        for (int d = 0; d < 10; ++d) {
          const Vec2 v = sampler.next_2d();
          ASSERT_TRUE(v.x >= 0 && v.x < 1 && v.y >= 0 && v.y < 1);
        }
      }
    }
  }
  std::sort(keys.begin(), keys.end());
  EXPECT_EQ(std::adjacent_find(keys.begin(), keys.end()), keys.end());
}

// Claim: over pixels (scrambles), each point is uniform on the square, and two draws, two halves, two
// neighbouring pixels are independent: their joint histograms are flat. Chi-squared of 16 x 16 bins; 2 x 24
// tests share 1 % of false alarm.
TEST(Sampler, JointDistributionsAreFlat) {
  constexpr double kAlarm = 0.01 / 48;
  constexpr int kBins = 16;
  constexpr int kPixels = 128;
  for (const SamplerKind kind : {SamplerKind::independent, SamplerKind::sobol}) {
    Sampler sampler(kind, 1234);
    const auto p_of = [&](auto pair) {
      std::vector<double> observed(kBins * kBins);
      for (std::uint32_t y = 0; y < kPixels; ++y) {
        for (std::uint32_t x = 0; x < kPixels; ++x) {
          const Vec2 v = pair(x, y);
          ++observed[static_cast<std::size_t>(v.x * kBins) * kBins + static_cast<std::size_t>(v.y * kBins)];
        }
      }
      return test::chi_squared_p(
          observed, std::vector<double>(observed.size(), double{kPixels} * kPixels / (kBins * kBins)));
    };
    for (const std::uint64_t index : {0ull, 1ull, 255ull, (1ull << 32) + 7}) {
      EXPECT_GT(p_of([&](auto x, auto y) { return draw_2d(sampler, 0, index, x, y, 0); }), kAlarm);
      EXPECT_GT(p_of([&](auto x, auto y) { return draw_2d(sampler, 0, index, x, y, 13); }), kAlarm);
      EXPECT_GT(p_of([&](auto x, auto y) {
                  return Vec2{draw_2d(sampler, 0, index, x, y, 3).x, draw_2d(sampler, 0, index, x, y, 4).x};
                }),
                kAlarm);
      EXPECT_GT(p_of([&](auto x, auto y) {
                  return Vec2{draw_2d(sampler, 0, index, x, y, 3).y, draw_2d(sampler, 1, index, x, y, 3).y};
                }),
                kAlarm);
      EXPECT_GT(
          p_of([&](auto x, auto y) {
            return Vec2{draw_2d(sampler, 0, index, x, y, 5).x, draw_2d(sampler, 0, index, x + 1, y, 5).x};
          }),
          kAlarm);
      EXPECT_GT(p_of([&](auto x, auto y) {
                  return Vec2{draw_2d(sampler, 0, index, x, y, 2).x, draw_2d(sampler, 0, index, x, y, 2).y};
                }),
                kAlarm);
    }
  }
}

// Claim: within one pixel different draws are shuffled apart as far as two base-2 sequences can be: the mean
// of (u_a - 1/2)(u_b - 1/2) over 64 points is 0 on average, and over pixels its variance is 1.58 times that
// of independent points. (An aligned pair of points lies in opposite halves in both draws, so their products
// agree: the part of the variance that the leading bits carry, (3/4)^2, counts twice, and that of the second
// bits, (3/16)^2, one and a half times. Draws without shuffles of their own would be off by far more.) The
// mean within 4 standard errors, the ratio within 0.15 (4 standard errors of 4000 pixels are 0.14).
TEST(Sampler, DrawsOfOnePixelAreDecorrelated) {
  constexpr int kPixels = 4000;
  constexpr int kPoints = 64;
  Sampler sampler(SamplerKind::sobol, 99);
  for (std::uint32_t other = 1; other < 6; ++other) {
    double sum = 0;
    double sum2 = 0;
    for (std::uint32_t p = 0; p < kPixels; ++p) {
      double mean = 0;
      for (std::uint64_t i = 0; i < kPoints; ++i) {
        const Vec2 a = draw_2d(sampler, 0, i, p, 1, 0);
        const Vec2 b = draw_2d(sampler, 0, i, p, 1, other);
        mean += (static_cast<double>(a.x) - 0.5) * (static_cast<double>(b.y) - 0.5) / kPoints;
      }
      sum += mean;
      sum2 += mean * mean;
    }
    const double variance = sum2 / kPixels;
    const double independent = 1.0 / (144 * kPoints);
    EXPECT_LT(std::abs(sum / kPixels), 4 * std::sqrt(independent / kPixels)) << other;
    EXPECT_NEAR(variance / independent, 1.58, 0.15) << other;
  }
}

// Claim: the point of it all: a smooth integrand's error over 256 points is far below Monte Carlo's (here: a
// tenth).
TEST(Sampler, SobolBeatsIndependentOnSmoothIntegrands) {
  const auto error = [](SamplerKind kind) {
    Sampler sampler(kind, 5);
    double squares = 0;
    for (std::uint32_t p = 0; p < 200; ++p) {
      double mean = 0;
      for (std::uint64_t i = 0; i < 256; ++i) {
        const Vec2 v = draw_2d(sampler, 0, i, p, 0, 2);
        mean += static_cast<double>(v.x) * static_cast<double>(v.y) / 256;
      }
      squares += (mean - 0.25) * (mean - 0.25);
    }
    return std::sqrt(squares);
  };
  EXPECT_LT(error(SamplerKind::sobol), 0.1 * error(SamplerKind::independent));
}

}  // namespace
}  // namespace candela
