// Chains whose target changes between segments, as that of mollified paths does: the disk of the theory's
// counterexample [regularisation note, section 8].
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "common/chains/chains.h"
#include "tests/long_form.h"
#include "tests/statistical/moments.h"
#include "tests/unit/mcmc_targets.h"
#include "worker/integrators/regularise.h"
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
  film::SampleCounts sample_counts;
  ChainRules rules;
  rules.seed = 45;
  rules.b0 = 1.5;
  rules.prob_large = 0.1;
  rules.segment_mutations = kMutations;
  rules.states_vanish = true;
  PrimarySpace space(target, {});
  SplatList list;
  statistical::Moments share;
  std::uint64_t sample = 0, vanished = 0, refused = 0, lost = 0;
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
          refused += run_segment(space, rules, chain, start, {nullptr, sample_counts}, unused).ok() ? 0 : 1;
          rules.states_vanish = true;
        }
      }
      chains::ChainRecord after;
      const auto done = run_segment(space, rules, chain, start, {nullptr, sample_counts}, after);
      ASSERT_TRUE(done.ok()) << done.error().to_string();
      ASSERT_EQ(after.counts.mutations, (segment + 1) * kMutations);
      start.record = after;
      ASSERT_TRUE(space.restore(start.record.state, list).ok());
      ASSERT_FALSE(list.splats().empty());
      if (segment >= kSegments / 2) inside += static_cast<double>(list.splats()[0].at.x);
    }
    lost += start.record.counts.mollified->lost;
    share.add(inside / (kSegments - kSegments / 2));
  }
  EXPECT_GT(vanished, 200U);
  EXPECT_EQ(refused, vanished);
  EXPECT_EQ(lost, vanished);
  EXPECT_NEAR(share.mean(), 1.0 / 3, 5 * share.error());
  EXPECT_LT(share.error(), 0.015);
}

// The two parts by numbers that small steps never change: a mutation changes the part by large steps alone.
test::FunctionTarget two_fixed_parts(const double& radius) {
  return test::FunctionTarget([&radius](PrimaryState& numbers) {
    const PrimarySampler& walk = numbers.walk(PrimaryState::eye);
    if (walk.draw_fixed(0) < 0.5) return std::pair(2.0, transport::FilmPosition{0, 0});
    const double x = walk.draw_fixed(1) - 0.5, y = walk.draw_fixed(2) - 0.5, r2 = radius * radius;
    const bool inside = x * x + y * y < r2;
    return std::pair(inside ? 1 / (std::numbers::pi * r2) : 0.0, transport::FilmPosition{1, 0});
  });
}

constexpr double kLarge = 0.1, kFirstRadius = 0.1;

// Schedules as chains of pssmlt and mmlt have them.
double radius_at(std::uint64_t mutation) {
  return integrators::ChainRegularization(integrators::Regularization(kFirstRadius, 1.0 / 6), false)
      .bandwidth(mutation);
}
// The same by the theory: epochs of 10^4 mutations. [regularisation note, section 8]
double radius_by_theory(std::uint64_t mutation) {
  return kFirstRadius * std::pow(1 + std::floor(static_cast<double>(mutation) / 1e4), -1.0 / 6);
}

// A chain of two_fixed_parts is one of three states: regular part, disk, lost outside of the disk. Mean and
// variance of the share of the ends of `segments` segments, of `mutations` each, that find it in the disk.
struct Share {
  double mean, variance;
};
Share share_by_recursion(std::uint64_t segments, std::uint64_t mutations) {
  using State = std::array<double, 3>;
  // The chains in a state: their probability, and sums over them of the count so far and of its square.
  State p{2.0 / 3, 1.0 / 3, 0}, first{}, second{};
  for (std::uint64_t segment = 0; segment < segments; ++segment) {
    const std::uint64_t begin = segment * mutations;
    const double r = radius_by_theory(begin), area = std::numbers::pi * r * r;
    if (segment > 0) {
      const double before = radius_by_theory(begin - mutations), kept = r * r / (before * before);
      for (State* s : {&p, &first, &second}) {
        (*s)[2] += (*s)[1] * (1 - kept);
        (*s)[1] *= kept;
      }
    }
    const double enters = kLarge / 2 * area, leaves = kLarge / 2 * std::min(1.0, 2 * area);
    for (std::uint64_t m = 0; m < mutations; ++m)
      for (State* s : {&p, &first, &second}) {
        const auto [regular, disk, lost] = *s;
        *s = {regular * (1 - enters) + disk * leaves + lost * kLarge / 2,
              disk * (1 - leaves) + regular * enters + lost * enters, lost * (1 - kLarge / 2 - enters)};
      }
    second[1] += 2 * first[1] + p[1];
    first[1] += p[1];
  }
  const auto n = static_cast<double>(segments);
  const double mean = (first[0] + first[1] + first[2]) / n;
  return {mean, (second[0] + second[1] + second[2]) / (n * n) - mean * mean};
}

ChainRules rules_of_parts(std::uint64_t mutations) {
  ChainRules rules;
  rules.seed = 4510;
  rules.b0 = 1.5;
  rules.prob_large = kLarge;
  rules.segment_mutations = mutations;
  rules.states_vanish = true;
  return rules;
}

// Chains of two_fixed_parts from starts in proportion to their contribution.
class Parts {
 public:
  // Runs chain `chain` for so many segments; the share of their ends in the disk.
  double run(std::uint64_t chain, std::uint64_t segments, std::uint64_t mutations,
             chains::ChainRecord& record) {
    const ChainRules rules = rules_of_parts(mutations);
    radius_ = radius_at(0);
    const double most = 1 / (std::numbers::pi * radius_ * radius_);
    rng::Stream random(rng::key(4511, chain));
    chains::ChainStart start;
    do space_.start(bootstrap_key(rules.seed, start.bootstrap_sample = random.next_u64() >> 1), list_);
    while (most * random.next_double() >= list_.scalar());
    double inside = 0;
    for (std::uint64_t segment = 0; segment < segments; ++segment) {
      radius_ = radius_at(segment * mutations);
      const auto done = run_segment(space_, rules, chain, start, {nullptr, sample_counts_}, record);
      if (!done.ok()) throw std::runtime_error(done.error().to_string());
      start.record = record;
      if (!space_.restore(record.state, list_).ok()) throw std::runtime_error("a state is lost");
      if (!list_.splats().empty()) inside += static_cast<double>(list_.splats()[0].at.x);
    }
    return inside / static_cast<double>(segments);
  }

 private:
  double radius_ = 0;
  test::FunctionTarget target_ = two_fixed_parts(radius_);
  PrimarySpace space_{target_, {}};
  film::SampleCounts sample_counts_;
  SplatList list_;
};

// Claim: the time that chains spend in the shrinking disk has the mean and the spread of the recursion over
// the published kernel, with epochs of 10^4 mutations and states that are lost at their borders; the mean is
// that of the target, a third, within one per cent. A radius that falls by a factor for each mutation would
// have ten times the spread after 10^5 mutations. [regularisation note, section 8]
TEST(McmcVanishing, SharesSpreadAsTheRecursionSays) {
  const bool is_long = test::long_form();
  const std::uint64_t chains = is_long ? 200 : 50, mutations = 100, segments = is_long ? 4000 : 1000;
  const Share expected = share_by_recursion(segments, mutations);
  EXPECT_NEAR(expected.mean, 1.0 / 3, 0.0035);
  EXPECT_NEAR(std::sqrt(share_by_recursion(1000, 100).variance), 0.0406, 0.004);
  Parts parts;
  statistical::Moments share;
  for (std::uint64_t chain = 0; chain < chains; ++chain) {
    chains::ChainRecord record;
    share.add(parts.run(chain, segments, mutations, record));
  }
  EXPECT_NEAR(share.mean(), expected.mean, 5 * std::sqrt(expected.variance / static_cast<double>(chains)));
  // The variance of n normal values has the relative deviation sqrt(2 / (n - 1)).
  EXPECT_NEAR(share.variance() / expected.variance, 1, 5 * std::sqrt(2.0 / static_cast<double>(chains - 1)));
}

// Claim: segments that end at borders of epochs and between them leave the same states.
TEST(McmcVanishing, SegmentsCutAnywhereLeaveTheSameStates) {
  constexpr std::uint64_t kAll = 30000;
  for (std::uint64_t chain = 0; chain < 6; ++chain) {
    Parts parts;
    chains::ChainRecord whole;
    parts.run(chain, kAll / 10000, 10000, whole);
    for (const std::uint64_t mutations : {5000ULL, 2000ULL, 500ULL}) {
      chains::ChainRecord cut;
      parts.run(chain, kAll / mutations, mutations, cut);
      EXPECT_EQ(cut.state, whole.state) << chain << " " << mutations;
      EXPECT_EQ(cut.counts.accepted, whole.counts.accepted) << chain << " " << mutations;
      EXPECT_EQ(cut.counts.large_sum, whole.counts.large_sum) << chain << " " << mutations;
    }
  }
}

// Regular light and mollified light: the same everywhere.
class EvenLight final : public PrimaryTarget {
 public:
  explicit EvenLight(double regular) : regular_(regular) {}
  void set_mollified(double mollified) { mollified_ = mollified; }
  void evaluate(PrimaryState& /*numbers*/, SplatList& out) override {
    out.add({0, 0}, Spectrum(static_cast<float>(regular_ + mollified_)));
    out.mollify(Spectrum(static_cast<float>(mollified_)));
  }

 private:
  double regular_, mollified_ = 0;
};

// Claim: the amount m of mollified light grows as the radius falls, and the image has regular light and the
// mean of m over the epochs: b_irr is of large steps alone, so that nothing of the bootstrap's radius stays.
// One mean over bootstrap and large steps would lack a third of what m has gained here, b of the bootstrap
// alone all of it, 4.5 % of m. [regularisation note, section 9]
TEST(McmcVanishing, ImageHasTheLightOfItsEpochs) {
  constexpr std::uint64_t kSamples = 20000, kMutations = 10000, kSegments = 16;
  const auto light = [](std::uint64_t mutation) {
    const double share = radius_by_theory(mutation) / kFirstRadius;
    return 1 - 0.0576 * share * share;
  };
  for (const double regular : {0.0, 0.5}) {
    EvenLight target(regular);
    target.set_mollified(light(0));
    PrimarySpace space(target, {});
    chains::BootstrapTable table(kSamples);
    const std::vector<float> values(kSamples, static_cast<float>(regular + light(0)));
    ASSERT_TRUE(table.insert(0, values).ok());
    ChainRules rules;
    rules.seed = 4512;
    rules.b0 = table.normalisation().b;
    rules.segment_mutations = kMutations;
    rules.states_vanish = true;
    film::SampleCounts sample_counts;
    chains::ChainRecord record;
    double mean = 0, of_chains = 0, of_large_steps = 0;
    for (std::uint64_t segment = 0; segment < kSegments; ++segment) {
      const double m = light(segment * kMutations), now = regular + m;
      target.set_mollified(m);
      mean += now / kSegments;
      const chains::ChainStart start{1, record};
      const double large_before = static_cast<double>(record.counts.large_steps);
      ASSERT_TRUE(run_segment(space, rules, 0, start, {nullptr, sample_counts}, record).ok());
      const double each = now / (now / rules.b0 + rules.prob_large),
                   large = static_cast<double>(record.counts.large_steps) - large_before;
      of_chains += each / kSegments;
      of_large_steps += each * large / kMutations / kSegments;
    }
    const std::vector<chains::ChainCounts> counts = {record.counts};
    const chains::Normalisation b = chains::pool(table, counts);
    EXPECT_GT(mean - regular - light(0), 0.02);
    EXPECT_NEAR(b.b, mean, 2e-4) << regular;
    EXPECT_NEAR(b.b / rules.b0 * of_chains + of_large_steps, mean, 1e-3) << regular;
    // The mollified share of the states is that of the light.
    const auto mollified = chains::summarise_mollified(counts);
    ASSERT_TRUE(mollified.has_value());
    EXPECT_NEAR(mollified->share, (mean - regular) / mean, 2e-4) << regular;
    EXPECT_EQ(mollified->lost, 0U);
  }
}

}  // namespace
}  // namespace candela::mcmc
