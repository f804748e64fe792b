// Energy redistribution on toy E [metropolis-photons note, section 2]: two numbers, a slope and three bright
// boxes, 16 pixels along x, and a second channel; all integrals are known.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "tests/statistical/moments.h"
#include "tests/unit/mcmc_targets.h"
#include "worker/mcmc/redistribution.h"

namespace candela::mcmc {
namespace {

constexpr std::size_t kPixels = 16;
constexpr std::uint64_t kSeeds = 64;  // of an iteration

struct Box {
  double x, y, half_x, half_y, height;
};
constexpr std::array kBoxes{Box{0.20, 0.30, 0.02, 0.03, 200.0 / 3}, Box{0.55, 0.70, 0.02, 0.02, 250},
                            Box{0.85, 0.50, 0.05, 0.02, 50}};

// I = 1/2 + x and the boxes; red = 2 y I.
class ToyTarget final : public PrimaryTarget {
 public:
  void evaluate(PrimaryState& numbers, SplatList& out) override {
    const Vec2 p = numbers.walk(PrimaryState::light).draw_2d(0, true);
    const auto x = static_cast<double>(p.x), y = static_cast<double>(p.y);
    double value = 0.5 + x;
    for (const Box& box : kBoxes)
      if (std::abs(x - box.x) < box.half_x && std::abs(y - box.y) < box.half_y) value += box.height;
    // The others such that the luminance is I.
    const Spectrum white(1.0f);
    const double red_share = static_cast<double>(luminance({1, 0, 0}) / luminance(white));
    const double red = 2 * y * value, other = (value - red_share * red) / (1 - red_share);
    out.add({p.x * kPixels, 0.5f},
            {static_cast<float>(red), static_cast<float>(other), static_cast<float>(other)});
  }
};

// Sums of I by pixel, and last of red over all.
std::array<double, kPixels + 1> exact() {
  std::array<double, kPixels + 1> out{};
  double& red = out[kPixels];
  for (std::size_t i = 0; i < kPixels; ++i) {
    const double from = static_cast<double>(i) / kPixels, to = from + 1.0 / kPixels;
    out[i] = 0.5 * (to - from) + 0.5 * (to * to - from * from);
    red += out[i];
    for (const Box& box : kBoxes)
      out[i] += box.height * 2 * box.half_y *
                std::max(0.0, std::min(to, box.x + box.half_x) - std::max(from, box.x - box.half_x));
  }
  for (const Box& box : kBoxes) red += box.height * 4 * box.half_x * box.half_y * 2 * box.y;
  return out;
}

class ToyFilm final : public Deposit {
 public:
  void add(std::uint32_t layer, const SplatList& list, double weight, std::uint64_t /*key*/) override {
    EXPECT_EQ(layer, kChainsLayer);
    for (const Splat& splat : list.splats()) {
      const auto pixel = std::min(static_cast<std::size_t>(splat.at.x), kPixels - 1);
      sums[pixel] += weight * static_cast<double>(luminance(splat.value));
      sums[kPixels] += weight * static_cast<double>(splat.value.r);
    }
  }
  std::array<double, kPixels + 1> sums{};
};

// Claim: every pixel, and red, have the exact mean, whatever the energy of a chain, its length, the limit to
// the chains of a seed, and the film's importance. 4.5 standard errors of 153 values: false alarm with
// probability 1e-3. In the
// note's table of planted errors the smallest bias is a quarter of a pixel; 10 standard errors here.
TEST(McmcRedistribution, ToyEIsExact) {
  const auto truth = exact();
  const double b = 1.76;  // the mean of I
  struct Case {
    double energy;  // over b
    std::uint64_t mutations;
    double max_chains;
    bool uneven = false;
  };
  // From 8 to 1/8 over four cells.
  const ImageImportance uneven(CoarseGrid(kPixels, 1), {176, 128, 96, 80});
  for (const Case& one : {Case{1, 1, 1000},
                          {1, 3, 1000},
                          {1, 10, 1000},
                          {1, 100, 1000},
                          {0.1, 10, 1000},
                          {30, 10, 1000},
                          {1, 10, 20},
                          {12, 24, 20},
                          {2, 10, 20, true}}) {
    SCOPED_TRACE(testing::Message() << "e_d = " << one.energy << " b, M = " << one.mutations << ", at most "
                                    << one.max_chains << " chains" << (one.uneven ? ", uneven" : ""));
    const RedistributionRules rules{one.energy * b, one.mutations, one.max_chains,
                                    one.uneven ? &uneven : nullptr};
    std::array<statistical::Moments, kPixels + 1> pixels;
    RedistributionCounts counts;
    const double work = 1 + static_cast<double>(one.mutations) / one.energy;
    const auto iterations = static_cast<std::uint64_t>(std::clamp(1.5e6 / work / kSeeds, 300.0, 6000.0));
    for (std::uint64_t i = 0; i < iterations; ++i) {
      PrimarySpace space(std::make_unique<ToyTarget>(), {1.0 / 1024, 1.0 / 16});
      film::SampleCounts sample_counts;
      ToyFilm film;
      for (std::uint64_t j = 0; j < kSeeds; ++j) {
        const auto key = [&](std::uint64_t purpose) {
          return rng::key(46, one.mutations, static_cast<std::uint64_t>(one.energy * 10), i, j, purpose);
        };
        ASSERT_TRUE(
            redistribute(space, {key(0), key(1), key(2)}, rules, {nullptr, sample_counts}, film, counts));
      }
      for (std::size_t p = 0; p < pixels.size(); ++p)
        pixels[p].add(film.sums[p] / static_cast<double>(kSeeds * one.mutations));
    }
    for (std::size_t p = 0; p < pixels.size(); ++p)
      EXPECT_NEAR(pixels[p].mean(), truth[p], 4.5 * pixels[p].error())
          << (p < kPixels ? "pixel " : "red ") << p;
    EXPECT_EQ(counts.mutations, counts.chains * one.mutations);
    EXPECT_GT(counts.accepted, 0u);
  }
}

// Claim: the number of chains has the mean I / e_d, whatever is rounded, and its chains have the energy I in
// all. 4e5 draws: 4.5 standard errors.
TEST(McmcRedistribution, RoundingKeepsTheMean) {
  for (const double share : {0.01, 0.3, 0.5, 1.2, 7.9, 20.0, 25.0, 1e6}) {
    const RedistributionRules rules{3, 1, 20};
    const double expected = std::min(share, rules.max_chains);
    statistical::Moments counts;
    rng::Stream stream(rng::key(46, static_cast<std::uint64_t>(share * 100)));
    for (int i = 0; i < 400000; ++i) {
      const ChainsOfSeed chains = chains_of_seed(3 * share, rules, stream.next_double());
      counts.add(static_cast<double>(chains.count));
      EXPECT_DOUBLE_EQ(chains.energy * expected, 3 * share);
    }
    EXPECT_NEAR(counts.mean(), expected, 4.5 * counts.error() + 1e-12) << share;
    const double fraction = expected - std::floor(expected);
    EXPECT_NEAR(counts.variance(), fraction * (1 - fraction), 0.01) << share;
  }
  EXPECT_EQ(chains_of_seed(0, {}, 0.9).count, 0u);
}

}  // namespace
}  // namespace candela::mcmc
