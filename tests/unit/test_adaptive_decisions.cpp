// Decisions of adaptive kernels in integers: against doubles, against planted sums, and at the ends of their
// range. Sections, equations and CSV rows are those of ../shared/theory/adaptive-kernels.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "common/adaptive/channels.h"
#include "common/adaptive/chi_squared_counts.h"
#include "common/adaptive/f_test.h"
#include "common/adaptive/levels.h"
#include "common/adaptive/plug_in.h"
#include "common/adaptive/quantile.h"
#include "tests/laplacian_stencil.h"
#include "tests/random_draws.h"
#include "tests/statistical/quantiles.h"
#include "tests/unit/adaptive_statistics.h"

namespace candela::adaptive {
namespace {

constexpr int kCases = 100000;

std::uint64_t critical(double alpha, int sectors) {
  return critical_integer(chi_squared_quantile(alpha, sectors - 1) / (sectors - 1));
}

// Sums of photons with 12 fractional bits, as accumulators keep them.
struct Sectors {
  std::array<Int128, kSectorChannels> sums{};
  Int128 squares = 0;
  void add(int sector, double phi) {
    sums[static_cast<std::size_t>(sector)] += static_cast<std::int64_t>(std::floor(phi * 0x1p12 + 0.5));
    squares += static_cast<std::int64_t>(std::floor(phi * phi * 0x1p16 + 0.5));
  }
  SectorSums view() const { return {sums, squares, kSquareShift}; }
};

// Claim: the tail and the quantile of chi-squared agree with Boost's for every degree and alpha that a test
// may have, and critical values are the note's (section 5.1; CSV h0/critical, sequential/spending).
TEST(Quantile, IsChiSquared) {
  for (int degrees = 1; degrees <= 23; ++degrees)
    for (const double alpha : {1e-12, 1e-5, 1e-3, 0.01, 0.05, 0.2, 0.5, 0.9, 0.999}) {
      const double expected = statistical::chi_squared_quantile(alpha, degrees);
      EXPECT_NEAR(chi_squared_quantile(alpha, degrees) / expected, 1, 1e-10) << degrees << ' ' << alpha;
      EXPECT_NEAR(chi_squared_tail(expected, degrees) / alpha, 1, 1e-10) << degrees << ' ' << alpha;
    }
  EXPECT_NEAR(chi_squared_quantile(0.01, 11), 24.72497, 1e-5);
  EXPECT_NEAR(chi_squared_quantile(0.01, 5), 15.086272, 1e-6);
  EXPECT_NEAR(chi_squared_quantile(0.01, 11) / 11, 2.2477246, 1e-7);
  EXPECT_NEAR(chi_squared_quantile(0.01, 5) / 5, 3.0172545, 1e-7);
  EXPECT_NEAR(static_cast<double>(critical(0.01, 12)),
              statistical::chi_squared_quantile(0.01, 11) / 11 * 0x1p32, 1.5);
}

// Claim: M(-h, (n-1)/2, c/2) = 0 at the note's hazards (section 5.3; CSV sequential): the survival of a pixel
// that is tested at all times falls as t^-h, for the critical values that the product takes.
TEST(Quantile, HasTheNotesSurvivalExponents) {
  const auto kummer = [](double a, double b, double z) {
    double term = 1, sum = 1;
    for (int n = 0; n < 400; ++n) {
      term *= (a + n) / (b + n) * z / (n + 1);
      sum += term;
    }
    return sum;
  };
  struct Row {
    int degrees;
    double alpha, hazard;
  };
  for (const Row& row : {Row{11, 0.01, 0.0443}, Row{11, 0.05, 0.152}, Row{11, 0.001, 0.0070}}) {
    const double half = chi_squared_quantile(row.alpha, row.degrees) / 2;
    double low = 1e-9, high = 0.99;
    for (int i = 0; i < 100; ++i) {
      const double middle = (low + high) / 2;
      (kummer(-middle, row.degrees / 2.0, half) > 0 ? low : high) = middle;
    }
    EXPECT_NEAR(low / row.hazard, 1, 0.01) << row.alpha;
  }
}

// Claim: the F test in integers decides as doubles do on 10^5 random pixels, of all sizes of sums and all
// numbers of photons, for 12 sums and for 6.
TEST(FTest, AgreesWithDoubles) {
  test::Draws draws(1);
  const std::uint64_t full = critical(0.01, 12), half = critical(0.01, 6);
  int rejected = 0, rejected_pairs = 0;
  for (int i = 0; i < kCases; ++i) {
    Sectors pixel;
    const double scale = std::exp2(24 * draws.uniform() - 8), sigma = 2 * draws.uniform();
    const double tilt = draws.uniform();
    const std::uint64_t photons = 1 + draws.below(60);
    for (std::uint64_t p = 0; p < photons; ++p) {
      // A share of the pixels has an uneven field.
      const bool first = i % 4 == 0 && draws.uniform() < tilt;
      pixel.add(static_cast<int>(draws.below(first ? 3 : 12)), scale * draws.lognormal(sigma));
    }
    const double f = f_statistic(pixel.view());
    const double of_critical = f / (static_cast<double>(full) * 0x1p-32);
    if (std::abs(of_critical - 1) > 1e-12) {
      ASSERT_EQ(f_exceeds(pixel.view(), full), of_critical > 1) << i << " F " << f;
    }
    rejected += f_exceeds(pixel.view(), full) ? 1 : 0;
    std::array<Int128, kSectorChannels / 2> pairs{};
    for (std::size_t s = 0; s < pixel.sums.size(); ++s) pairs[s % pairs.size()] += pixel.sums[s];
    const SectorSums of_pairs{pairs, pixel.squares, kSquareShift};
    ASSERT_EQ(f_exceeds(of_pairs, half), f_statistic(of_pairs) > static_cast<double>(half) * 0x1p-32) << i;
    rejected_pairs += f_exceeds(of_pairs, half) ? 1 : 0;
  }
  EXPECT_GT(rejected, kCases / 20);
  EXPECT_GT(rejected_pairs, kCases / 20);
  EXPECT_LT(rejected, kCases / 2);
}

// Claim: no photons and Q = 0 are no evidence; one photon has F = 1 exactly; c equal photons in one sector
// have F = c exactly, so that two keep the radius and three shrink it (section 8).
TEST(FTest, KnowsPlantedSums) {
  const std::uint64_t usual = critical(0.01, 12), one = std::uint64_t{1} << 32;
  Sectors none;
  EXPECT_FALSE(f_exceeds(none.view(), 0));
  EXPECT_EQ(f_statistic(none.view()), 0);
  none.sums[3] = 5;  // squares may round to 0
  EXPECT_FALSE(f_exceeds(none.view(), 0));
  for (const double w : {1.0, 3.5, 1000.0, 0x1p20}) {
    Sectors single;
    single.add(7, w);
    EXPECT_FALSE(f_exceeds(single.view(), one)) << w;
    EXPECT_TRUE(f_exceeds(single.view(), one - 1)) << w;
    EXPECT_FALSE(f_exceeds(single.view(), usual)) << w;
    Sectors several;
    for (std::uint64_t c = 1; c <= 5; ++c) {
      several.add(4, w);
      EXPECT_FALSE(f_exceeds(several.view(), c * one)) << c;
      EXPECT_TRUE(f_exceeds(several.view(), c * one - 1)) << c;
      EXPECT_EQ(f_exceeds(several.view(), usual), c >= 3) << c;
    }
  }
}

// Claim: with equal contributions 11 F is Pearson's chi-squared of the counts (section 5.1).
TEST(FTest, IsPearsonsForEqualContributions) {
  test::Draws draws(2);
  for (int i = 0; i < 200; ++i) {
    std::array<Int128, kSectorChannels> counts{};
    Sectors pixel;
    for (int p = 0; p < 40; ++p) {
      const auto s = draws.below(12);
      counts[s] += 1;
      pixel.add(static_cast<int>(s), 0.75);
    }
    EXPECT_NEAR(11 * f_statistic(pixel.view()), counts_statistic(counts), 1e-9);
  }
}

// Claim: with sums near 2^42, and beyond, as of 2^33 photons and more, nothing overflows and the decision is
// that of doubles; the factor by which all sums are divided changes no decision (section 8).
TEST(FTest, DoesNotOverflow) {
  test::Draws draws(3);
  const std::uint64_t usual = critical(0.01, 12);
  int rejected = 0;
  for (int i = 0; i < 20000; ++i) {
    const double size = std::exp2(30 + 60 * draws.uniform());  // of a sector's sum
    const double photon = std::exp2(40 * draws.uniform() - 20);
    const double count = size / photon;  // per sector
    if (count < 1) continue;
    std::array<Int128, kSectorChannels> sums{};
    double squares = 0;
    for (Int128& sum : sums) {
      const double photons = std::max(0.0, count + 1.3 * std::sqrt(count) * draws.normal());
      sum = static_cast<Int128>(photons * photon);
      squares += photons * photon * photon;
    }
    const SectorSums pixel{sums, static_cast<Int128>(squares / 256), kSquareShift};
    if (pixel.squares < 1 << 20) continue;
    const double ratio = f_statistic(pixel) / (static_cast<double>(usual) * 0x1p-32);
    // Sums that were divided have lost their bits below 2^-41; deviations are the root of n of them.
    if (std::abs(ratio - 1) < 1e-9 + 0x1p-36 * std::sqrt(count)) continue;
    ASSERT_EQ(f_exceeds(pixel, usual), ratio > 1) << i;
    rejected += ratio > 1 ? 1 : 0;
  }
  EXPECT_GT(rejected, 1000);
  // The ends: one sector with all; all equal; squares that no photons can have.
  std::array<Int128, kSectorChannels> ends{};
  ends[0] = Int128{1} << 103;
  EXPECT_TRUE(f_exceeds({ends, Int128{1} << 103, 8}, usual));
  ends.fill(Int128{1} << 103);
  EXPECT_FALSE(f_exceeds({ends, Int128{1} << 103, 8}, usual));
  ends.fill(1);
  EXPECT_FALSE(f_exceeds({ends, Int128{1} << 103, 20}, std::uint64_t{1} << 59));
}

// Claim: a photon that is opposite to another is in the opposite sector of the same ring; rings have equal
// areas or volumes; sectors are sixty degrees from the first axis on.
TEST(Channels, AreEqualAndOpposite) {
  test::Draws draws(4);
  std::array<int, kSectorChannels> disc{}, ball{};
  for (int i = 0; i < 120000;) {
    const double u = 2 * draws.uniform() - 1, v = 2 * draws.uniform() - 1, w = 2 * draws.uniform() - 1;
    if (u * u + v * v < 1) {
      const int c = disc_channel_of(3 * u, 3 * v, 9.0);
      double angle = std::atan2(v, u) / 1.0471975511965976;
      if (angle < 0) angle += 6;
      ASSERT_EQ(c % 6, static_cast<int>(angle));
      ASSERT_EQ(disc_channel_of(-u, -v, 1.0), c / 6 * 6 + (c + 3) % 6);
      ++disc[static_cast<std::size_t>(c)];
    }
    if (u * u + v * v + w * w >= 1) continue;
    const int c = ball_channel(2 * u, 2 * v, 2 * w, 2);
    ASSERT_EQ(ball_channel(-u, -v, -w, 1), c / 6 * 6 + (c + 3) % 6);
    ++ball[static_cast<std::size_t>(c)];
    ++i;
  }
  for (std::size_t c = 0; c < disc.size(); ++c) {  // 6 standard deviations: false alarm 5e-8
    EXPECT_NEAR(ball[c], 10000, 6 * 96);
    EXPECT_NEAR(disc[c], 15000, 6 * 118 + 6 * 70);  // their number varies too
  }
  EXPECT_EQ(disc_sector_of(1.0, 0.0), 0);
  EXPECT_EQ(disc_sector_of(-1.0, 0.0), 3);
}

// Claim: CPPM's decisions agree with doubles on 10^5 random pixels, at counts up to 2^60, and its verdict is
// the published pipeline's: wait for the batch, keep, go to the inner disc, or shrink (section 4).
TEST(Counts, AgreeWithDoubles) {
  test::Draws draws(5);
  const CountsTest rule{critical_integer(chi_squared_quantile(0.01, 11)),
                        critical_integer(chi_squared_quantile(0.01, 5)), 10, 1024 * 100};
  std::array<int, 4> verdicts{};
  for (int i = 0; i < kCases; ++i) {
    const double mean = std::exp2(i % 2 == 0 ? 6 * draws.uniform() : 60 * draws.uniform());
    std::array<Int128, kSectorChannels> counts{};
    const double inner = i % 3 == 0 ? 0.5 + draws.uniform() : 1;
    for (std::size_t s = 0; s < counts.size(); ++s) {
      const double here = mean * (s < 6 ? inner : 1);
      counts[s] = static_cast<Int128>(std::max(0.0, here + std::sqrt(here) * draws.normal() + 0.5));
    }
    const double outer = counts_statistic(counts);
    const std::span<const Int128> of_inner(counts.data(), 6);
    const Uint128 batch = draws.below(100);
    Uint128 total = 0;
    for (const Int128 c : counts) total += static_cast<Uint128>(c);
    const bool fails = outer > static_cast<double>(rule.critical_outer) * 0x1p-32;
    const bool inner_fails = counts_statistic(of_inner) > static_cast<double>(rule.critical_inner) * 0x1p-32;
    const CountsVerdict expected = total == 0 || total < batch ? CountsVerdict::waits
                                   : !fails                    ? CountsVerdict::keeps
                                   : inner_fails               ? CountsVerdict::shrinks
                                                               : CountsVerdict::halves;
    // Beyond 2^42 counts are divided and the rest is lost: 2^-41 of them, or 2^-20 of their root.
    const double off = std::abs(outer / (static_cast<double>(rule.critical_outer) * 0x1p-32) - 1);
    if (mean > 0x1p40 && off < 1e-3) continue;
    ASSERT_EQ(static_cast<int>(test_counts(rule, counts, batch)), static_cast<int>(expected))
        << i << " chi-squared " << outer;
    ++verdicts[static_cast<std::size_t>(expected)];
  }
  for (const int n : verdicts) EXPECT_GT(n, 50);
}

// Claim: batches grow by beta each time, and never beyond their bound.
TEST(Counts, BatchesGrow) {
  const auto sizes = batch_sizes({0, 0, 10, critical_integer(1.5625) >> 16});
  ASSERT_EQ(sizes.size(), 256U);
  double exact = 10;
  for (std::size_t i = 0; i < 60; ++i, exact *= 1.5625)
    EXPECT_NEAR(static_cast<double>(sizes[i]) / std::ceil(exact), 1, 0.1 / exact + 1e-4) << i;
  EXPECT_TRUE(sizes[255] == Uint128{1} << 100);
  EXPECT_TRUE(batch_sizes({0, 0, 0, 1 << 16})[200] == 0);
}

// Claim: the plug-in radius is the level nearest to c6 A2 / D1^2's sixth root, on 10^5 random sums, within
// its bounds; photons without curvature get the largest radius, and no photons keep the present one.
TEST(PlugIn, IsTheNearestLevel) {
  test::Draws draws(6);
  const Levels levels{std::exp2(-1.0 / 16), 255, {}};
  const double c6 = plug_in_constant(0.25, 1 / 3.14159265358979323846);
  EXPECT_NEAR(c6, 32, 1e-12);
  const PlugIn rule(levels, c6, 0.001, 4);
  int at_zero = 0, at_bound = 0;
  for (int i = 0; i < kCases; ++i) {
    const double a2 = std::exp2(40 * draws.uniform() - 20), d1 = std::exp2(80 * draws.uniform() - 40);
    const std::uint64_t n = 1 + draws.below(i % 3 == 0 ? 4000 : 1 << 20);
    const double bound = std::pow(static_cast<double>(n), -1.0 / 6);
    const double r = std::clamp(std::pow(c6 * a2 / (d1 * d1), 1.0 / 6), 0.001 * bound, 4 * bound);
    const double exact = std::max(0.0, -16 * std::log2(r));
    const int level = rule.level(a2, i % 2 == 0 ? d1 : -d1, n, 7);
    if (std::abs(exact - std::floor(exact) - 0.5) < 1e-9) continue;
    ASSERT_EQ(level, std::min(255, static_cast<int>(std::floor(exact + 0.5)))) << i;
    at_zero += level == 0 ? 1 : 0;
    at_bound += r <= 0.001 * bound ? 1 : 0;
  }
  EXPECT_GT(at_zero, 1000);
  EXPECT_GT(at_bound, 1000);
  EXPECT_EQ(rule.level(0, 1, 10, 7), 7);
  EXPECT_EQ(rule.level(0, 0, 10, 7), 7);
  EXPECT_EQ(rule.level(1, 1, 0, 7), 7);
  EXPECT_EQ(rule.level(1, 0, 10, 7), 0);
  EXPECT_EQ(rule.level(1, 0, 1 << 30, 7), 16 * 3);  // 4 N^(-1/6) = 2^-3
}

// Claim: against the exact optimum of the note's toy (section 3; CSV amse/constant) the formula has the
// note's radius: m2 = e / 2500, Laplacian 8, constant kernel.
TEST(PlugIn, HasTheNotesRadius) {
  const Levels levels{std::exp2(-1.0 / 16), 255, {}};
  const double kPi = 3.14159265358979323846, r1 = 0.5;
  const PlugIn rule(levels, plug_in_constant(0.25, 1 / kPi), 1e-6, 1e6);
  const struct { double n, radius; } rows[] = {{1e3, 0.074649878}, {1e5, 0.034649404}, {1e7, 0.016082829}};
  for (const auto& row : rows) {
    const double m2 = std::exp(1.0) / 2500;
    // A2 = sum k_r phi^2 pi r_1^2 of phi / (pi r_1^2); D1 likewise.
    const int level =
        rule.level(row.n * m2 / (kPi * r1 * r1), row.n * 8 * r1 * r1, static_cast<std::uint64_t>(row.n), 0);
    EXPECT_NEAR(r1 * std::exp2(-level / 16.0) / row.radius, 1, 0.022) << row.n;  // half a level
  }
}

// Claim: where photons merge on surfaces and in media the level is the nearest to the radius of least error
// of their sum, found by trying all, on 2000 random sums; with one kind alone the exponent is 6 or 7.
TEST(PlugIn, AddsSurfacesAndMedia) {
  constexpr double kPi = 3.14159265358979323846;
  const double disc_k2 = 0.25, ball_k2 = 0.2, disc_k3 = 1 / kPi, ball_k3 = 0.75 / kPi;
  const Levels levels{std::exp2(-1.0 / 16), 255, {}};
  const double c6 = plug_in_constant(disc_k2, disc_k3);
  const PlugInMedia media = plug_in_media(disc_k2, ball_k2, ball_k3);
  const PlugIn plug_in(levels, c6, 1e-3, 1e3, media);
  test::Draws draws(7);
  for (int trial = 0; trial < 2000; ++trial) {
    const auto random = [&](double low, double high) {
      return std::exp2(low + (high - low) * draws.uniform());
    };
    const double a = trial % 3 == 0 ? 0 : random(-20, 0), m = trial % 3 == 1 ? 0 : random(-20, 0);
    const double d = random(-2, 4), e = random(-2, 4) * (trial % 2 == 0 ? 1 : -0.3);
    const double bias = (disc_k2 * d * (a > 0 ? 1 : 0) + ball_k2 * e * (m > 0 ? 1 : 0)) / 2;
    const auto error = [&](double x) {
      const double surface = disc_k3 * kPi * a / (x * x);
      const double medium = ball_k3 * 4 / 3 * kPi * m / (x * x * x);
      return surface + medium + bias * bias * x * x * x * x;
    };
    double best = 1, least = error(1);
    for (int k = 1; k < 4096; ++k) {
      const double x = std::exp2(-k / 256.0);
      if (error(x) >= least) continue;
      least = error(x);
      best = x;
    }
    const int level = plug_in.level(a, a > 0 ? d : 0, m, m > 0 ? e : 0, 64, 0);
    EXPECT_NEAR(level, -16 * std::log2(best), 0.5 + 0.1) << trial << ' ' << a << ' ' << m;
  }
  // Bounds fall as N^(-1/7) where there are no surfaces.
  const PlugIn bounded(levels, 32, 0.25, 4, plug_in_media(disc_k2, ball_k2, ball_k3));
  EXPECT_EQ(bounded.level(0, 0, 1, 1e9, 1 << 14, 0), 16 * (2 + 2));
  EXPECT_EQ(bounded.level(0, 0, 1, 0, 1 << 28, 0), 16 * 2);
  EXPECT_EQ(bounded.level(1e-30, 0, 1, 1e9, 1 << 12, 0), 16 * (2 + 2));
  EXPECT_EQ(bounded.level(0, 0, 0, 0, 64, 5), 5);
  EXPECT_EQ(bounded.level(0, 0, 1, 1, 0, 5), 5);
}

// Claim: against the exact error of a field with terms of second and fourth order in three dimensions, the
// formula has the exponent 1/7 and the radius of least error.
TEST(PlugIn, HasTheRadiusOfMedia) {
  // Irradiance 1 + 2 y^2 + y^4 (|y| = r), 25 photons per volume and iteration, E[phi^2] = e E[phi]^2. Over a
  // ball of radius r: mean 1 + 6/5 r^2 + 3/7 r^4, variance e (...) / (25 V N); Laplacian at 0: 12.
  const double ball_k3 = 0.75 / 3.14159265358979323846;
  const PlugInMedia media = plug_in_media(0.25, 0.2, ball_k3);
  const Levels levels{std::exp2(-1.0 / 16), 255, {}};
  const PlugIn plug_in(levels, 32, 1e-6, 1e6, media);
  for (const double n : {1e4, 1e6, 1e8}) {
    double best = 0, least = 1e300;
    for (double r = 0.5; r > 1e-3; r *= 0.999) {
      const double bias = 1.2 * r * r + 3.0 / 7 * r * r * r * r;
      const double error = bias * bias + std::exp(1.0) * (1 + bias) * ball_k3 / (25 * r * r * r * n);
      if (error < least) {
        least = error;
        best = r;
      }
    }
    // Sums of N iterations for r_1 = 1/2: phi in units of the film is f / (25 V_1), A2' = N m2 / V_1 with m2
    // = e / 25, D1' = N L r_1^2.
    const double volume = 0.125 / ball_k3;
    const int level =
        plug_in.level(0, 0, n * std::exp(1.0) / 25 / volume, n * 12 * 0.25, static_cast<std::uint64_t>(n), 0);
    EXPECT_NEAR(0.5 * std::exp2(-level / 16.0) / best, 1, n < 1e5 ? 0.06 : 0.03) << n;
  }
}

// Claim: the pilot's bandwidth by a normal reference minimizes the squared error of the Laplacian of a bell
// of width s, its bias in leading order and its variance (note, Eq. 8 and 9), and is bounded.
TEST(PlugIn, HasAReferencePilot) {
  constexpr double kEnergy = 2.84615, kI = 3, kPi = 3.14159265358979323846;
  const ReferencePilot pilot(reference_constant(0.25, kEnergy));
  for (const double s : {0.3, 0.6, 1.2})  // in first radii, as h
    for (const double n : {1e2, 1e4, 1e6}) {
      double best = 0, least = 1e300;
      for (double h = 0.5; h > 0.02; h *= 0.999) {
        const double bias = 1.5 * h * h * kI / std::pow(s, 4), m2 = 0.7;
        const double error = bias * bias + kEnergy * m2 / (n * std::pow(h, 6));
        if (error >= least) continue;
        least = error;
        best = h;
      }
      const int level = pilot.level(n * kI, n * 0.7 / kPi, -2 * n * kI / (s * s), 0);
      EXPECT_NEAR(pilot_of_level(level) / best, 1, 0.025) << s << ' ' << n;
    }
  EXPECT_EQ(pilot.level(1, 1, 0, 7), 0);         // even light, few photons
  EXPECT_EQ(pilot.level(1, 1e-30, 1e9, 7), 74);  // 1 / 50
  EXPECT_EQ(pilot.level(0, 1, 1, 7), 7);         // no light
  EXPECT_NEAR(pilot_of_level(74), 0.02, 0.0005);
  // s is at most 2: what is wider counts as even.
  EXPECT_EQ(pilot.level(1, 1e-9, 0.5, 0), pilot.level(1, 1e-9, 0, 0));
}

// Claim: stencils of the other kernels have the energies that plans of work use.
TEST(PlugIn, StencilsOfKernelsHaveTheirEnergies) {
  constexpr int kCells = 1200;
  const double norm[] = {2 / 3.14159265358979323846, 3.5 / 3.14159265358979323846};
  const double energy[] = {4.79888, 11.4011};
  for (int kernel = 0; kernel < 2; ++kernel) {
    const auto k = [&](double u, double v) {
      const double t2 = u * u + v * v, t = std::sqrt(t2);
      if (t2 >= 1) return 0.0;
      return norm[kernel] * (kernel == 0 ? 1 - t2 : 1 - t * t2 * (10 - 15 * t + 6 * t2));
    };
    double sum = 0;
    for (int i = 0; i < kCells; ++i)
      for (int j = 0; j < kCells; ++j) {
        const double u = (i + 0.5) * 4 / kCells - 2, v = (j + 0.5) * 4 / kCells - 2;
        const double d = k(u - 1, v) + k(u + 1, v) + k(u, v - 1) + k(u, v + 1) - 4 * k(u, v);
        sum += d * d * 16 / (static_cast<double>(kCells) * kCells);
      }
    EXPECT_NEAR(sum / energy[kernel], 1, 1e-4) << kernel;
  }
}

// Claim: the pilot's bandwidth is N^(-1/10)/2 of the first radius, without pow.
TEST(PlugIn, HasAPilot) {
  EXPECT_EQ(pilot_bandwidth(0), 0.5);
  EXPECT_EQ(pilot_bandwidth(1), 0.5);
  for (const std::uint64_t n : {2ULL, 3ULL, 31ULL, 32ULL, 1024ULL, 1000000ULL, 1ULL << 40}) {
    const auto x = static_cast<double>(n);
    EXPECT_NEAR(pilot_bandwidth(n) / (0.5 * std::pow(x, -0.1)), 1, 1e-14) << n;
    EXPECT_NEAR(fifth_root(x) / std::pow(x, 0.2), 1, 1e-14) << n;
    EXPECT_NEAR(fifth_root(1 / x) * std::pow(x, 0.2), 1, 1e-14) << n;
  }
}

// Claim: the stencil of discs has the note's energy C = 2.84615 (section 2), hence its noise (Eq. 8).
TEST(PlugIn, StencilHasItsEnergy) {
  constexpr int kGrid = 1600;
  double energy = 0;
  for (int i = 0; i < kGrid; ++i)
    for (int j = 0; j < kGrid; ++j) {
      const double value = laplacian_stencil((i + 0.5) / kGrid * 4 - 2, (j + 0.5) / kGrid * 4 - 2, 1);
      energy += value * value;
    }
  const double kPi = 3.14159265358979323846;
  EXPECT_NEAR(energy * 16 / (double{kGrid} * kGrid) / (kPi * kPi), 2.84615, 1e-3);
}

// Claim: a level begins where the schedules' ratio is half a level before it, up to the most iterations of a
// job; there is none where the other schedule shrinks no faster.
TEST(Levels, LieBesideAnotherAlpha) {
  const auto beside = levels_beside(0.7, 0.9, 0.75, 10);
  ASSERT_EQ(beside.size(), 6U);
  for (std::size_t g = 0; g < beside.size(); ++g) {
    const double share = std::pow(static_cast<double>(beside[g]), -0.075);
    EXPECT_NEAR(std::log(share) / std::log(0.7), static_cast<double>(g) + 0.5, 0.03);
  }
  EXPECT_EQ(levels_beside(0.7, 0.9, 0.75, 2).size(), 2U);
  EXPECT_TRUE(levels_beside(0.7, 0.75, 0.75, 10).empty());
  EXPECT_EQ(iterations_text({11, 116}), "11,116");
}

// Claim: contributions are counted as equal ones, at every size of the sums; sums without squares are few.
TEST(FTest, CountsContributions) {
  for (const int bits : {0, 15, 30}) {
    const Int128 unit = Int128{4096} << bits, square = (unit / 16) * (unit / 16);
    std::array<Int128, kSectorChannels> sums{};
    sums[3] = 40 * unit;
    sums[8] = 20 * unit;
    EXPECT_TRUE(few_contributions({sums, 60 * square}, 60)) << bits;
    EXPECT_FALSE(few_contributions({sums, 60 * square}, 59)) << bits;
    // One contribution that is much larger.
    sums[0] = 10000 * unit;
    EXPECT_TRUE(few_contributions({sums, 100000000 * square}, 2)) << bits;
    EXPECT_TRUE(few_contributions({sums, 0}, 2)) << bits;
  }
}

// Claim: floors are the first iterations at which the paper's least radius allows a level; levels survive
// their text, and a wrong constant is named.
TEST(Levels, HaveFloors) {
  const Levels levels = levels_above(0.7, 0.001, 0.75);
  EXPECT_EQ(levels.floors[18], 0U);  // 0.7^19 = 0.00114
  for (const double alpha : {0.75, 2.0 / 3, 0.3, 0.999}) {
    const Levels some = levels_above(0.7, 0.001, alpha);
    const auto radii = some.radii(1);
    const auto at = [&](double i) { return 0.001 * std::pow(i + 1, (alpha - 1) / 2); };
    for (int g = 1; g <= some.max_level; ++g) {
      const auto floor = static_cast<double>(some.floors[static_cast<std::size_t>(g) - 1]);
      EXPECT_GE(radii[static_cast<std::size_t>(g)], at(floor) * (1 - 1e-12)) << g;
      if (floor > 0) {
        EXPECT_LT(radii[static_cast<std::size_t>(g)], at(floor - 1) * (1 + 1e-12)) << g;
        EXPECT_EQ(some.deepest(static_cast<std::uint64_t>(floor) - 1), g - 1);
      }
      EXPECT_GE(some.deepest(static_cast<std::uint64_t>(floor)), g);
    }
    EXPECT_GT(radii.back() * 0.7, 0);
    EXPECT_LT(radii.back() * 0.7, at(0x1p40)) << alpha;
  }
  SettingsMap constants;
  put_levels(levels, constants);
  const auto again = get_levels(constants);
  ASSERT_TRUE(again.ok()) << again.error().to_string();
  EXPECT_EQ(*again, levels);
  for (const auto& [name, value] :
       SettingsMap{{"factor", "1"}, {"factor", "x"}, {"max_level", "256"}, {"floors", "3,2,1"}}) {
    SettingsMap wrong = constants;
    wrong[name] = value;
    const auto refused = get_levels(wrong);
    ASSERT_FALSE(refused.ok()) << name;
    EXPECT_EQ(refused.error().field, "work.epochs.constants." + name);
  }
  constants.erase("max_level");
  EXPECT_EQ(get_levels(constants).error().field, "work.epochs.constants.max_level");
}

}  // namespace
}  // namespace candela::adaptive
