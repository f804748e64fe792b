// Short chains inside a unit, on toy P [metropolis-photons note, section 7]: photons uniform in a cube, two
// islands of which they are visible, one of a size that an iteration's coin decides; a film of four pixels
// that are exactly 1 in expectation.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "tests/statistical/moments.h"
#include "tests/unit/mcmc_targets.h"
#include "worker/mcmc/short_chain.h"

namespace candela::mcmc {
namespace {

using Film = std::array<double, 4>;

// The visible set of an iteration, and its film.
class Islands {
 public:
  explicit Islands(bool large) : width_(large ? 0.3 : 0.1) {}

  void start(PrimaryState& numbers) { present_ = photon(numbers); }
  bool propose(PrimaryState& numbers) {
    proposal_ = photon(numbers);
    return proposal_.pixel >= 0;
  }
  void accept() { present_ = proposal_; }
  static void reject() {}
  void deposit(double weight) {
    film_[static_cast<std::size_t>(present_.pixel)] += weight * present_.value;
    weights_ += weight;
  }
  const Film& film() const { return film_; }
  double weights() const { return weights_; }

 private:
  struct Photon {
    int pixel = -1;  // -1: it is invisible
    double value = 0;
  };
  // The flux of a photon is 0.65 + y; a kernel spreads it over the part of its island that is its pixel's.
  Photon photon(PrimaryState& numbers) const {
    const auto at = [&](std::uint32_t d) { return static_cast<double>(test::draw(numbers, d)); };
    const double x = at(0), y = at(1), z = at(2), flux = 0.65 + y;
    if (y <= 0.2 || y >= 0.5 || z <= 0.3 || z >= 0.6) return {};
    if (x > 0.6 && x < 0.7) return {3, flux / 0.009};
    if (x <= 0.1 || x >= 0.1 + width_) return {};
    const int third = std::clamp(static_cast<int>((x - 0.1) / width_ * 3), 0, 2);
    return {third, flux / (0.03 * width_)};
  }

  double width_;
  Photon present_, proposal_;
  Film film_{};
  double weights_ = 0;
};

// One iteration of `paths` independent photons and `mutations`.
Film iteration(std::uint64_t key, std::uint64_t paths, std::uint64_t mutations, StepSizes steps) {
  Islands islands(rng::Stream(rng::key(key, 0)).next_double() < 0.5);
  PrimaryState numbers(steps);
  std::vector<std::uint64_t> visible;
  for (std::uint64_t j = 0; j < paths; ++j) {
    numbers.start(rng::key(key, 1, j));
    if (islands.propose(numbers)) visible.push_back(j);
  }
  for (std::uint64_t c = 0; c < visible.size(); ++c)
    run_short_chain(
        numbers,
        {rng::key(key, 1, visible[c]), rng::key(key, 2, c), short_chain_length(mutations, visible.size(), c)},
        islands);
  EXPECT_NEAR(islands.weights(), static_cast<double>(visible.size()), 1e-9);
  Film film = islands.film();
  for (double& pixel : film) pixel /= static_cast<double>(paths);
  return film;
}

// Claim: the mean of iterations, black ones included, is exact in each pixel, whatever the numbers of photons
// and mutations and the step, whether chains cross to the other island or not. 4.5 standard errors of 36
// values: false alarm with probability 2.5e-4. Table: a rejection that deposits nothing -40 to -50 %, black
// iterations drawn again +10 %, a visible set too small by a sixth -19 %, all beyond 10 standard errors here.
// Steps are not those of the table, so variances are near it alone.
TEST(McmcShortChain, IslandsAreExact) {
  struct Case {
    std::uint64_t paths, mutations;
    double step;
    // Variance times evaluations of pixels 0 to 2, and of pixel 3, in the note's table; 0: not there.
    double variance = 0, variance_of_last = 0;
  };
  for (const Case& one : {Case{100, 100, 0.08, 195, 218},
                          {100, 0, 0.08, 224, 112},
                          {100, 1000, 0.5},
                          {100, 100, 0.002},
                          {400, 100, 0.08},
                          {100, 7, 0.08},
                          {10, 300, 0.08},
                          {3, 1000, 0.03},
                          {1, 50, 0.2}}) {
    std::array<statistical::Moments, 4> pixels;
    const std::uint64_t iterations = 8000000 / (one.paths + one.mutations + 20);
    for (std::uint64_t i = 0; i < iterations; ++i) {
      const Film film = iteration(rng::key(45, one.paths, one.mutations, i), one.paths, one.mutations,
                                  {one.step / 16, one.step});
      for (std::size_t p = 0; p < film.size(); ++p) pixels[p].add(film[p]);
    }
    for (std::size_t p = 0; p < pixels.size(); ++p) {
      const double error = pixels[p].error();
      EXPECT_NEAR(pixels[p].mean(), 1, 4.5 * error)
          << one.paths << " photons, " << one.mutations << " mutations, step " << one.step << ", pixel " << p;
      const double table = p < 3 ? one.variance : one.variance_of_last;
      if (table == 0) continue;
      const double variance = pixels[p].variance() * static_cast<double>(one.paths + one.mutations);
      EXPECT_NEAR(variance, table, 0.12 * table) << "pixel " << p;
    }
  }
}

// Claim: the lengths of all chains add up to the mutations, differ by one at most, and do not grow with the
// rank.
TEST(McmcShortChain, LengthsShareTheMutations) {
  for (const std::uint64_t mutations : {0ULL, 1ULL, 7ULL, 100ULL, 12345ULL})
    for (const std::uint64_t chains : {1ULL, 2ULL, 7ULL, 99ULL, 1000ULL}) {
      std::uint64_t sum = 0, before = mutations / chains + 1;
      for (std::uint64_t c = 0; c < chains; ++c) {
        const std::uint64_t length = short_chain_length(mutations, chains, c);
        EXPECT_LE(length, before);
        EXPECT_GE(length, mutations / chains);
        before = length;
        sum += length;
      }
      EXPECT_EQ(sum, mutations);
    }
}

}  // namespace
}  // namespace candela::mcmc
