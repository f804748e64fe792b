// Chains whose target changes between segments, as that of mollified paths does: the disk of the theory's
// counterexample [regularisation note, section 8].
#include <gtest/gtest.h>

#include <numbers>

#include "tests/statistical/moments.h"
#include "tests/unit/mcmc_targets.h"
#include "worker/mcmc/chain.h"

namespace candela::mcmc {
namespace {

// A regular part of mass 1, at place 0, and a disk of mass 1/2, whatever its radius, at place 1. A coin
// chooses the part.
test::FunctionTarget two_parts(const double& radius) {
  return test::FunctionTarget([&radius](PrimaryState& numbers) {
    if (test::draw(numbers, 0) < 0.5f) return std::pair(2.0, transport::FilmPosition{0, 0});
    const double x = static_cast<double>(test::draw(numbers, 1)) - 0.5,
                 y = static_cast<double>(test::draw(numbers, 2)) - 0.5, r2 = radius * radius;
    const bool inside = x * x + y * y < r2;
    return std::pair(inside ? 1 / (std::numbers::pi * r2) : 0.0, transport::FilmPosition{1, 0});
  });
}

// Claim: chains whose disk shrinks between segments stay in it for a third of the time, although a state
// falls out of it with the probability 1 - (r' / r)^2: then it contributes nothing until the next proposal
// that does. Without leave to vanish such a state is an error.
TEST(McmcVanishing, SharesStayThoseOfTheTarget) {
  constexpr std::uint64_t kChains = 300, kSegments = 40, kMutations = 400;
  constexpr double kFirst = 0.4;
  double radius = kFirst;
  auto target = two_parts(radius);
  film::Tallies tallies;
  ChainRules rules;
  rules.seed = 45;
  rules.b0 = 1.5;
  rules.prob_large = 0.1;
  rules.segment_mutations = kMutations;
  rules.states_vanish = true;
  PrimarySpace space(target, {});
  SplatList list;
  statistical::Moments share;
  std::uint64_t sample = 0, vanished = 0, refused = 0;
  rng::Stream random(rng::key(45, 3));
  for (std::uint64_t chain = 0; chain < kChains; ++chain) {
    radius = kFirst;
    // A start in proportion to its contribution, which is at most 2.
    do space.start(bootstrap_key(rules.seed, ++sample), list);
    while (2 * random.next_double() >= list.scalar());
    chains::ChainStart start{sample, {}};
    double inside = 0;
    for (std::uint64_t segment = 0; segment < kSegments; ++segment) {
      radius = kFirst / std::cbrt(1 + static_cast<double>(segment));
      if (segment > 0) {
        ASSERT_TRUE(space.restore(start.record.state, list).ok());
        if (list.splats().empty()) {
          ++vanished;
          rules.states_vanish = false;
          chains::ChainRecord unused;
          refused += run_segment(space, rules, chain, start, {nullptr, tallies}, unused).ok() ? 0 : 1;
          rules.states_vanish = true;
        }
      }
      chains::ChainRecord after;
      const auto done = run_segment(space, rules, chain, start, {nullptr, tallies}, after);
      ASSERT_TRUE(done.ok()) << done.error().to_string();
      ASSERT_EQ(after.counts.mutations, (segment + 1) * kMutations);
      start.record = after;
      ASSERT_TRUE(space.restore(start.record.state, list).ok());
      ASSERT_FALSE(list.splats().empty());
      if (segment >= kSegments / 2) inside += static_cast<double>(list.splats()[0].at.x);
    }
    share.add(inside / (kSegments - kSegments / 2));
  }
  EXPECT_GT(vanished, 200U);
  EXPECT_EQ(refused, vanished);
  EXPECT_NEAR(share.mean(), 1.0 / 3, 5 * share.error());
  EXPECT_LT(share.error(), 0.015);
}

}  // namespace
}  // namespace candela::mcmc
