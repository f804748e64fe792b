// Rings and nested discs: which ring a photon is in, the tests at all levels, and the rule that carries them.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "common/adaptive/rings.h"
#include "tests/adaptive_toy.h"

namespace candela::adaptive {
namespace {

std::uint64_t critical(int sectors) {
  return critical_integer(chi_squared_quantile(0.01, sectors - 1) / (sectors - 1));
}

// Claim: ring g ends at r_1 2^(-g/2) and the last has the rest; a photon at the border of its pixel's disc is
// in a ring of that disc whatever rounding says; rings of a disc and weighted rings of a ball have the same
// shares.
TEST(Rings, HalveTheArea) {
  for (int g = 0; g < kRings; ++g) {
    const double border = std::exp2(-g / 2.0) * 3;
    EXPECT_EQ(ring_of(border * border * (1 - 1e-12), 9, 0), g);
    if (g > 0) {
      EXPECT_EQ(ring_of(border * border * (1 + 1e-12), 9, 0), g - 1);
      EXPECT_EQ(ring_of(border * border * (1 + 1e-12), 9, g), g);
    }
  }
  EXPECT_EQ(ring_of(0, 9, 0), kRings - 1);
  test::Draws draws(31);
  constexpr int kPhotons = 400000;
  std::array<double, kRings> disc{}, ball{}, ball_squares{};
  for (int i = 0; i < kPhotons; ++i) {
    disc[static_cast<std::size_t>(ring_of(draws.uniform(), 1, 0))] += 1.0 / kPhotons;
    const double u = draws.uniform();
    const int ring = ring_of(std::cbrt(u * u), 1, 0);
    const double weight = ball_ring_weight(ring) / kPhotons;
    ball[static_cast<std::size_t>(ring)] += weight;
    ball_squares[static_cast<std::size_t>(ring)] += weight * weight;
  }
  for (std::size_t g = 0; g < 8; ++g) {  // 5 standard deviations: 6e-7 each
    const double share = std::exp2(-static_cast<double>(g) - 1);
    EXPECT_NEAR(disc[g], share, 5 * std::sqrt(share / kPhotons)) << g;
    EXPECT_NEAR(ball[g], share, 5 * std::sqrt(ball_squares[g]) + 1e-3 * share) << g;
  }
}

// Photons of a field over the first disc, in rings of sectors.
struct Rings {
  std::array<Int128, kRingSectorChannels> sums{};
  std::array<Int128, kRings> squares{};
  void add(double x, double y, double phi) {
    const auto ring = static_cast<std::size_t>(ring_of(x * x + y * y, 1, 0));
    sums[ring * kSectorsPerRing + static_cast<std::size_t>(disc_sector(x, y))] += std::llround(phi * 4096);
    squares[ring] += std::llround(phi * phi * 65536);
  }
};

// Claim: the sectors at a level are those of the photons in that level's disc, two annuli of equal area, and
// the level that the test leads to is the first at which the test of these photons alone does not reject.
TEST(Rings, TestEveryLevel) {
  test::Draws draws(32);
  int fallen = 0, several = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Rings rings;
    struct Photon {
      double x, y, phi;
    };
    std::vector<Photon> photons;
    for (int i = 0; i < 2000; ++i) {
      const double rho = std::sqrt(draws.uniform()), angle = 6.283185307179586 * draws.uniform();
      Photon p{rho * std::cos(angle), rho * std::sin(angle), draws.lognormal(1)};
      if (p.x < -0.3 && draws.uniform() < 0.3 * (trial % 4)) continue;  // an edge, of four contrasts
      photons.push_back(p);
      rings.add(p.x, p.y, p.phi);
    }
    for (const bool pairs : {false, true}) {
      int expected = 0;
      for (; expected < 5; ++expected) {
        const double radius_squared = std::exp2(-expected);
        std::array<Int128, kSectorChannels> sums{};
        Int128 squares = 0;
        for (const Photon& p : photons) {
          if (p.x * p.x + p.y * p.y > radius_squared) continue;
          sums[static_cast<std::size_t>(disc_channel(p.x, p.y, radius_squared))] +=
              std::llround(p.phi * 4096);
          squares += std::llround(p.phi * p.phi * 65536);
        }
        EXPECT_TRUE(sums == sectors_at(rings.sums, expected));
        const auto of_pairs = antipodal(sums);
        if (!(pairs ? f_exceeds({of_pairs, squares, 8}, critical(6))
                    : f_exceeds({sums, squares, 8}, critical(12))))
          break;
      }
      const int level = ring_level(rings.sums, rings.squares, 8, critical(pairs ? 6 : 12), pairs, 0, 5);
      ASSERT_EQ(level, expected) << trial;
      fallen += level > 0 ? 1 : 0;
      several += level > 1 ? 1 : 0;
      EXPECT_EQ(ring_level(rings.sums, rings.squares, 8, 0, pairs, 2, 3), 3);  // no deeper than allowed
    }
  }
  EXPECT_GT(fallen, 100);
  EXPECT_GT(several, 20);
}

// Expected sums of a radial field after some passes, with equal photons of 1 / density.
DiscSums radial(double (*mean_over_ring)(int ring), double density, double passes) {
  DiscSums disc;
  for (int g = 0; g < kRings; ++g) {
    const auto i = static_cast<std::size_t>(g);
    const double area = std::exp2(g == kRings - 1 ? -g : -g - 1);
    disc.passes[i] = passes;
    disc.sums[i] = mean_over_ring(g) * area * passes;
    disc.squares[i] = disc.sums[i] / density;
  }
  return disc;
}

// Claim: nested discs keep the first radius in an even field and where too few photons are in, and find a dip
// smaller than the disc: the level is that of the dip, once it has photons enough.
TEST(NestedDiscs, FindDips) {
  const auto even = [](int) { return 1.0; };
  const auto dip = [](int ring) { return ring < 5 ? 1.0 : 0.2; };
  EXPECT_EQ(nested_level(radial(even, 100, 100), 3), 0);
  EXPECT_EQ(nested_level(radial(dip, 20, 1), 3), 0);
  EXPECT_EQ(nested_level(radial(dip, 100, 1e4), 3), 5);
  // A ring that was never reached makes no disc.
  DiscSums missing = radial(even, 100, 100);
  missing.passes[0] = missing.passes[1] = 0;
  EXPECT_EQ(nested_level(missing, 3), 2);
  // Rings of the same field that were reached for other times do not disagree.
  DiscSums uneven = radial(even, 100, 100);
  for (std::size_t g = 0; g < 4; ++g) {
    uneven.sums[g] /= 7;
    uneven.squares[g] /= 7;
    uneven.passes[g] /= 7;
  }
  EXPECT_EQ(nested_level(uneven, 3), 0);
}

// Claim: a pixel's rings count whatever its level was, iterations count for the rings that their radius
// reached, a pixel may fall by several levels in one look, and without the F test it may grow again.
TEST(RingsRule, CarriesAllEpochs) {
  for (const bool rings : {true, false}) {
    const test::ToyPlan plan =
        test::rings_plan(test::toy_epochs("fppm", 8, 16, 0), rings ? "sectors" : "nested", rings);
    Carry carry = empty_carry(plan.accumulators, 1, 1);
    auto sums = empty_carry(plan.accumulators, 1, 1).sums;
    const auto decided = [&](std::uint64_t epoch, const std::string& previous) {
      DecisionInput input{plan.epochs, epoch, 1, 1, previous, {}};
      if (epoch > 0) {
        input.folded = {epoch - 1, previous, {}};
        for (const auto& s : sums) input.folded->sums.push_back(&s);
      }
      const auto state = decide(input, carry);
      EXPECT_TRUE(state.ok()) << state.error().to_string();
      return state.ok() ? *state : std::string(1, '\0');
    };
    const std::string first = decided(0, "");
    // Bright rings 0 to 4, dark from there on; for rings all in one of the sectors.
    std::vector<Int128> of_rings(sums[0].spec().channels);
    std::array<Int128, kRings> squares{};
    const std::size_t per_ring = rings ? kSectorsPerRing : 1;
    const auto photons = [&](std::size_t g, double mean) {
      const auto n = static_cast<std::int64_t>(mean * 800000 * std::exp2(g == kRings - 1 ? -11.0 : -1.0 - g));
      of_rings[g * per_ring] = Int128{n} * 4096;
      squares[g] = Int128{n} * 65536;
    };
    for (std::size_t g = 0; g < kRings; ++g) photons(g, g < 5 ? 1 : 0.1);
    sums[0].set_pixel(0, 0, of_rings);
    sums[1].set_pixel(0, 0, squares);
    const std::string second = decided(1, first);
    EXPECT_EQ(second[0], rings ? kRings - 2 : 5);
    EXPECT_EQ(carry.memo[0], 1);  // looks
    EXPECT_EQ(carry.memo[1], 1);  // rejections
    const Int128 before = of_rings[5 * per_ring];
    // Now the inner disc alone, so bright that the mean of all 16 iterations is that of the outer rings.
    for (std::size_t g = 0; g < kRings; ++g) photons(g, g < 5 ? 0 : 1.9);
    sums[0].set_pixel(0, 0, of_rings);
    sums[1].set_pixel(0, 0, squares);
    const std::string third = decided(2, second);
    std::vector<Int128> carried(of_rings.size());
    carry.sums[0].get_pixel(0, 0, carried);
    EXPECT_TRUE(carried[5 * per_ring] == before + of_rings[5 * per_ring]);  // nothing was zeroed
    EXPECT_EQ(third[0], rings ? kRings - 2 : 0);
    if (rings) continue;
    for (std::size_t g = 0; g < kRings; ++g)
      EXPECT_EQ(carry.memo[2 + 5 * g], g < 5 ? 8 : 16) << g;  // iterations whose radius reached the ring
  }
}

}  // namespace
}  // namespace candela::adaptive
