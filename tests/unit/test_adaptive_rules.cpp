// Rules of level states, on planted sums: what counts, what is dropped, what is carried.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include "common/adaptive/channels.h"
#include "tests/adaptive_toy.h"

namespace candela {
namespace {

using adaptive::kSectorChannels;
using film::Int128;
using film::MergedAccumulator;

constexpr std::uint32_t kWidth = 5, kHeight = 3, kPixels = kWidth * kHeight;

EpochPlan short_epochs(const std::string& rule, std::uint32_t lag) {
  return test::toy_epochs(rule, 8, 16, lag);
}

// A job of one rule whose epochs are given their sums by hand.
class Job {
 public:
  explicit Job(test::ToyPlan plan, std::uint32_t width = kWidth, std::uint32_t height = kHeight)
      : plan_(std::move(plan)),
        width_(width),
        height_(height),
        carry_(empty_carry(plan_.accumulators, width, height)) {
    begin();
  }
  const std::string& state() const { return states_.back(); }
  int level(std::size_t pixel) const { return static_cast<unsigned char>(state()[pixel]); }
  Carry& carry() { return carry_; }
  const EpochPlan& epochs() const { return plan_.epochs; }
  // Adds to one pixel of the present epoch.
  void add(std::uint32_t pixel, std::size_t accumulator, std::span<const Int128> values) {
    MergedAccumulator& sums = open_.back()[accumulator];
    std::vector<Int128> present(sums.spec().channels);
    sums.get_pixel(pixel % width_, pixel / width_, present);
    for (std::size_t i = 0; i < values.size(); ++i) present[i] += values[i];
    sums.set_pixel(pixel % width_, pixel / width_, present);
  }
  // Equal photons of 4096 units in sectors of a pixel, for the rules of sectors.
  void photons(std::uint32_t pixel, const std::vector<int>& per_sector, std::int64_t unit = 4096) {
    std::array<Int128, kSectorChannels> sums{};
    Int128 squares = 0;
    for (std::size_t s = 0; s < per_sector.size(); ++s) {
      sums[s] = per_sector[s] * (plan_.epochs.rule == "cppm" ? 1 : unit);
      squares += Int128{per_sector[s]} * unit * unit / 256;
    }
    add(pixel, 0, sums);
    if (plan_.epochs.rule == "fppm") add(pixel, 1, {&squares, 1});
  }
  // The same with photons of colors: sectors of red, green and blue.
  void colors(std::uint32_t pixel, const std::array<std::vector<int>, 3>& per_sector) {
    constexpr std::int64_t kUnit = 4096;
    std::array<Int128, 3 * kSectorChannels> sums{};
    std::array<Int128, 3> squares{};
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t s = 0; s < per_sector[c].size(); ++s) {
        sums[c * kSectorChannels + s] = per_sector[c][s] * kUnit;
        squares[c] += Int128{per_sector[c][s]} * kUnit * kUnit / 256;
      }
    add(pixel, 0, sums);
    add(pixel, 1, squares);
  }
  // Closes the epoch and decides the next state.
  void next() { begin(); }
  StateReport report(bool layers) const {
    const auto rule = find_rule(plan_.epochs.rule);
    auto out = rule->describe(plan_.epochs, states_.size() - 1, width_, height_, state(), carry_, layers);
    EXPECT_TRUE(out.ok()) << out.error().to_string();
    return *out;
  }

 private:
  void begin() {
    const std::uint64_t epoch = states_.size();
    DecisionInput input{plan_.epochs, epoch, width_, height_, {}, {}};
    if (epoch > 0) input.previous = states_.back();
    const std::uint32_t lag = plan_.epochs.lag;
    if (epoch > lag) {
      input.folded = {epoch - 1 - lag, states_[epoch - 1 - lag], {}};
      for (const auto& sums : open_[epoch - 1 - lag]) input.folded->sums.push_back(&sums);
    }
    auto decided = decide(input, carry_);
    ASSERT_TRUE(decided.ok()) << decided.error().to_string();
    states_.push_back(*decided);
    open_.push_back(empty_carry(plan_.accumulators, width_, height_).sums);
  }
  test::ToyPlan plan_;
  std::uint32_t width_, height_;
  Carry carry_;
  std::vector<std::string> states_;
  std::vector<std::vector<MergedAccumulator>> open_;
};

Job fppm(std::uint32_t lag) {
  return Job(test::fppm_plan(short_epochs("fppm", lag), 0.01, 0.7));
}
const std::vector<int> kEven(12, 2);
const std::vector<int> kUneven = {40, 40, 40, 40, 40, 40, 1, 1, 1, 1, 1, 1};

// Claim: a pixel shrinks by one level where its sums are uneven; pixels with even sums, with one photon, with
// two photons in one sector and with none keep their radius; three in one sector shrink it.
TEST(FppmRule, ShrinksUnevenPixels) {
  Job job = fppm(0);
  job.photons(0, kUneven);
  job.photons(1, kEven);
  job.photons(2, {0, 1});
  job.photons(3, {0, 2});
  job.photons(4, {0, 3});
  job.next();
  EXPECT_EQ(job.state(), std::string("\1\0\0\0\1", 5) + std::string(10, '\0'));
  // Looks are counted of pixels that had photons.
  EXPECT_EQ(job.carry().memo, std::string("\1\1\1\1\1", 5) + std::string(10, '\0'));
}

// Claim: with statistics of colors a pixel shrinks where any color is uneven, as red and green are whose sum
// is even; a color without light objects to nothing, and neither does a color of few photons beside even
// ones.
TEST(FppmRule, AnyColorShrinks) {
  Job job{test::fppm_plan(short_epochs("fppm", 0), 0.01, 0.7, 3)};
  std::vector<int> other(kUneven.rbegin(), kUneven.rend());
  const std::vector<int> even(12, 20), none(12, 0);
  job.colors(0, {even, even, even});
  job.colors(1, {even, kUneven, even});
  job.colors(2, {even, even, kUneven});
  job.colors(3, {kUneven, other, none});
  job.colors(4, {even, none, none});
  job.colors(5, {even, {0, 1}, none});
  job.next();
  EXPECT_EQ(job.state(), std::string("\0\1\1\1\0\0", 6) + std::string(9, '\0'));
  // After a rejection the sums of all colors begin anew.
  job.colors(1, {even, even, even});
  job.next();
  EXPECT_EQ(job.level(1), 1);
}

// Claim: with colors a pixel follows a schedule only if no color has evidence.
TEST(FppmRule, OneColorOfEvidenceIsEnough) {
  test::ToyPlan plan = test::fppm_plan(short_epochs("fppm", 0), 0.01, 0.7, 3);
  plan.epochs.constants["follow"] = "1,2,3,10000";
  plan.epochs.constants["evidence"] = "60";
  Job job{std::move(plan)};
  const std::vector<int> even(12, 20), none(12, 0);
  job.colors(0, {none, even, none});
  job.colors(1, {none, {1, 1, 1}, {0, 1}});
  job.next();
  EXPECT_EQ(job.level(0), 0);
  EXPECT_EQ(job.level(1), 1);
}

// Claim: with `follow`, pixels of few photons and of none take the levels of the schedule at its iterations
// and no further, one level a decision; a pixel of enough even photons keeps its radius; what the schedule
// takes is no rejection.
TEST(FppmRule, FollowsAScheduleWithoutEvidence) {
  test::ToyPlan plan = test::fppm_plan(short_epochs("fppm", 0), 0.01, 0.7);
  plan.epochs.constants["follow"] = "16,24,10000";
  plan.epochs.constants["evidence"] = "60";
  Job job{std::move(plan)};
  const std::vector<int> even(12, 6);  // 72 photons
  int epochs = 0;
  const auto epoch = [&] {
    job.photons(0, even);
    if (++epochs <= 3) job.photons(1, {1, 0, 1, 0, 1});
    job.photons(3, kUneven);
    job.next();
  };
  epoch();  // before iteration 16 the test alone decides
  EXPECT_EQ(job.state(), std::string("\0\0\0\1", 4) + std::string(11, '\0'));
  epoch();
  EXPECT_EQ(job.state(), std::string("\0\1\1\2", 4) + std::string(11, '\1'));
  epoch();
  EXPECT_EQ(job.state(), std::string("\0\2\2\3", 4) + std::string(11, '\2'));
  for (int i = 0; i < 3; ++i) epoch();
  EXPECT_EQ(job.level(0), 0);
  EXPECT_EQ(job.level(1), 2);
  EXPECT_EQ(job.level(2), 2);
  EXPECT_EQ(job.carry().memo.substr(kPixels), std::string("\0\0\0\6", 4) + std::string(11, '\0'));
}

// Claim: with `follow_little` pixels of some photons take the levels of its schedule, those of few or none
// the levels of `follow`, and those of enough even photons none; a job of `follow` alone decides as before.
TEST(FppmRule, FollowsASlowerScheduleWithLittleEvidence) {
  for (const bool graded : {true, false}) {
    test::ToyPlan plan = test::fppm_plan(short_epochs("fppm", 0), 0.01, 0.7);
    SettingsMap& constants = plan.epochs.constants;
    constants["follow"] = "8,16,10000";
    constants["evidence"] = "12";
    if (graded) {
      constants["follow_little"] = "24,10000";
      constants["evidence_little"] = "60";
    }
    Job job{std::move(plan)};
    // Photons of pixel 1 that count, by epoch: 24, 36, 60; the third decision takes a level, so that the
    // count begins anew with 24.
    const std::vector<int> some = {2, 1, 2, 2};
    for (std::size_t e = 0; e < some.size(); ++e) {
      job.photons(0, std::vector<int>(12, 6));
      job.photons(1, std::vector<int>(12, some[e]));
      job.photons(2, {1, 0, 1, 0, 1});
      job.next();
      EXPECT_EQ(job.level(0), 0);
      EXPECT_EQ(job.level(1), graded && e >= 2 ? 1 : 0);
      EXPECT_EQ(job.level(2), e == 0 ? 1 : 2);
      EXPECT_EQ(job.level(3), e == 0 ? 1 : 2);
    }
  }
}

// Claim: sums are carried from epoch to epoch until a rejection, which zeroes them: of its pixel alone.
TEST(FppmRule, CarriesSumsUntilARejection) {
  Job job = fppm(0);
  const auto sum = [&](std::uint32_t pixel) { return job.carry().sums[0].sum(pixel, 0, 0); };
  for (int i = 1; i <= 2; ++i) {
    job.photons(0, {1});
    job.photons(1, {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1});
    job.next();
    EXPECT_EQ(job.level(0), 0);
    EXPECT_TRUE(sum(0) == i * 4096);
  }
  job.photons(0, {1});  // the third in one sector
  job.next();
  EXPECT_EQ(job.level(0), 1);
  EXPECT_TRUE(sum(0) == 0);
  EXPECT_TRUE(job.carry().sums[1].sum(0, 0, 0) == 0);
  EXPECT_TRUE(sum(1) == 2 * 4096);
  // The test begins anew: two photons are no evidence.
  job.photons(0, {2});
  job.next();
  EXPECT_EQ(job.level(0), 1);
  job.photons(0, {1});
  job.next();
  EXPECT_EQ(job.level(0), 2);
}

// Claim: with a lag, statistics of the epochs that were open when a pixel shrank are dropped, for they were
// made with another radius; those of other pixels count.
TEST(FppmRule, DropsStatisticsOfAnotherLevel) {
  Job job = fppm(1);
  job.photons(0, kUneven);  // epoch 0
  job.next();               // epoch 1: nothing is whole yet
  EXPECT_EQ(job.level(0), 0);
  job.photons(0, kUneven);  // of the first radius
  job.photons(1, kUneven);
  job.next();  // epoch 2: epoch 0 is folded
  EXPECT_EQ(job.level(0), 1);
  job.photons(0, kUneven);  // of the new radius
  job.next();               // epoch 3: epoch 1 is folded, where pixel 0 had level 0
  EXPECT_EQ(job.level(0), 1);
  EXPECT_TRUE(job.carry().sums[0].sum(0, 0, 0) == 0);
  EXPECT_EQ(job.level(1), 1);
  EXPECT_EQ(job.carry().memo[0], 1);
  job.next();  // epoch 4: epoch 2 is folded
  EXPECT_EQ(job.level(0), 2);
}

// Claim: the floor is that of the iteration with which the epoch begins, and a pixel at its floor is not
// tested but keeps its sums until a level is allowed.
TEST(FppmRule, StopsAtTheFloor) {
  test::ToyPlan plan = test::fppm_plan(short_epochs("fppm", 0), 0.01, 0.7);
  adaptive::put_levels({0.7, 2, {0, 24}}, plan.epochs.constants);
  Job job(plan);
  std::vector<int> levels;
  for (int epoch = 1; epoch <= 4; ++epoch) {  // that begin at 8, 16, 24, 32
    job.photons(0, kUneven);
    job.next();
    levels.push_back(job.level(0));
    if (epoch == 2) {
      EXPECT_EQ(job.carry().memo[0], 1);
      EXPECT_TRUE(job.carry().sums[0].sum(0, 0, 0) == 40 * 4096);
    }
  }
  EXPECT_EQ(levels, (std::vector<int>{1, 1, 2, 2}));
}

// Claim: a photon of 10^3 mean contributions puts the test to sleep until the others are as many (section 8).
TEST(FppmRule, AFireflyPutsTheTestToSleep) {
  Job job = fppm(0);
  job.photons(0, kUneven);
  job.photons(0, {0, 0, 0, 1}, 4096 * 1000);
  job.next();
  EXPECT_EQ(job.level(0), 0);
  for (int i = 0; i < 200; ++i) job.photons(0, kUneven);
  job.next();
  EXPECT_EQ(job.level(0), 1);
}

// Claim: CPPM waits for its batch, shrinks by a level where all sectors differ, by three (half of the area)
// where the inner disc is even; batches grow by as many steps; counts begin anew.
TEST(CppmRule, IsThePublishedPipeline) {
  Job job(test::cppm_plan(short_epochs("cppm", 0), 0.01));
  job.photons(0, {9});                                         // below the first batch of 10
  job.photons(1, {40, 1, 1, 1, 1, 1, 40, 1, 1, 1, 1, 1});      // uneven inside too
  job.photons(2, {20, 20, 20, 20, 20, 20, 1, 1, 1, 1, 1, 1});  // even inside
  job.photons(3, {5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5});        // even
  job.next();
  EXPECT_EQ(job.state(), std::string("\0\1\3\0", 4) + std::string(11, '\0'));
  EXPECT_EQ(job.carry().memo.substr(0, kPixels), job.state());                     // steps of the batch
  EXPECT_EQ(job.carry().memo.substr(kPixels, 4), std::string("\0\1\1\1", 4));      // looks
  EXPECT_EQ(job.carry().memo.substr(2 * kPixels, 4), std::string("\0\1\1\0", 4));  // rejections
  EXPECT_TRUE(job.carry().sums[0].sum(1, 0, 0) == 0);
  EXPECT_TRUE(job.carry().sums[0].sum(3, 0, 0) == 5);
  job.photons(0, {1});   // the tenth
  job.photons(2, {38});  // below 10 * 4, rounded up
  job.next();
  EXPECT_EQ(job.level(0), 1);
  EXPECT_EQ(job.level(2), 3);
  job.photons(2, {3});
  job.next();
  EXPECT_EQ(job.level(2), 4);
}

// Claim: APPM sums over all epochs whatever their radii, chooses the level nearest to the bandwidth, and
// keeps the radius of pixels without photons.
TEST(AppmRule, ChoosesTheLevel) {
  Job job(test::appm_plan(short_epochs("appm", 1)));
  const double a2 = 0.25, d1 = 32;  // (r / r_1)^6 = 32 a2 / d1^2 = 2^-7
  const auto add = [&](std::uint32_t pixel, double share) {
    const Int128 moment = std::llround(share * a2 * std::exp2(job.carry().sums[0].spec().scale_log2));
    const Int128 laplacian = -std::llround(share * d1 * std::exp2(job.carry().sums[1].spec().scale_log2));
    job.add(pixel, 0, {&moment, 1});
    job.add(pixel, 1, {&laplacian, 1});
  };
  add(0, 0.5);
  job.next();
  add(0, 0.5);
  EXPECT_EQ(job.level(0), 0);
  job.next();
  EXPECT_EQ(job.level(0), 16);  // half of the sums: 2^-6
  job.next();
  EXPECT_EQ(job.level(0), 19);  // 2^(-7/6): 18.7 of 16 levels an octave
  EXPECT_EQ(job.level(1), 0);
  job.next();
  EXPECT_EQ(job.level(0), 19);
}

// Claim: with pilot=reference the state has a second plane, the pilots that the note's Eq. 9 asks for, and
// pixels without light keep theirs; in media the radius is that of three dimensions.
TEST(AppmRule, ChoosesPilotsAndKnowsMedia) {
  test::ToyPlan plan = test::appm_plan(short_epochs("appm", 0), true);
  plan.epochs.constants["c7"] = "48";  // 4 pi k3 / k2^2 of constant kernels, k3 of the ball
  plan.epochs.constants["k2_ratio"] = "0.8";
  plan.accumulators[0] = adaptive::moments_spec(test::kToyFilmScale, true);
  plan.accumulators[1] = adaptive::laplacian_spec(test::kToyFilmScale, true);
  Job job(plan);
  EXPECT_EQ(job.state(), std::string(2 * kPixels, '\0'));
  const auto add = [&](std::uint32_t pixel, std::size_t accumulator, std::size_t channel, double value) {
    std::array<Int128, 2> values{};
    values[channel] = std::llround(value * std::exp2(job.carry().sums[accumulator].spec().scale_log2));
    job.add(pixel, accumulator, std::span(values).first(accumulator == 2 ? 1 : 2));
  };
  add(0, 0, 0, 0.25);
  add(0, 1, 0, -32);
  add(0, 2, 0, 4);
  // (r / r_1)^7 = 48 a2 / (0.8 d1)^2 = 2^-14
  add(1, 0, 1, 1.0 / 1024);
  add(1, 1, 1, 34.6410162);
  job.next();
  EXPECT_EQ(job.level(0), 19);  // as without media: 2^(-7/6)
  EXPECT_EQ(job.level(1), 32);  // 2^-2
  // z = 8 / 32; (h / r_1)^10 = pi 3 C / (2 (3/2)^2) z^4 a2 / a1^2
  const double h = std::pow(3.14159265 * 1.89743333 * std::exp2(-8.0) * 0.25 / 16, 0.1);
  EXPECT_EQ(job.level(kPixels), std::lround(16 * std::log2(0.5 / h)));
  EXPECT_EQ(job.level(kPixels + 1), 0);
  EXPECT_EQ(job.level(kPixels + 2), 0);
  job.next();
  EXPECT_EQ(job.report(true).layers[0].values.size(), kPixels);
}

// Claim: what people are told: number and share of shrunk pixels, median and mean radius as fractions of the
// first, looks and rejections; layers only when they are asked for.
TEST(RuleReports, TellFiguresAndLayers) {
  Job job = fppm(0);
  for (std::uint32_t p = 0; p < 9; ++p) job.photons(p, kUneven);
  job.photons(10, kEven);
  job.next();
  job.photons(0, kUneven);
  job.next();
  const StateReport report = job.report(false);
  EXPECT_TRUE(report.layers.empty());
  std::map<std::string, double> figures(report.figures.begin(), report.figures.end());
  EXPECT_EQ(figures["pixels shrunk"], 9);
  EXPECT_DOUBLE_EQ(figures["share of pixels shrunk"], 0.6);
  EXPECT_DOUBLE_EQ(figures["median radius"], 0.7);
  EXPECT_NEAR(figures["mean radius"], (6 + 8 * 0.7 + 0.49) / 15, 1e-12);
  EXPECT_EQ(figures["looks"], 11);
  EXPECT_EQ(figures["rejections"], 10);
  const StateReport whole = job.report(true);
  ASSERT_EQ(whole.layers.size(), 3U);
  EXPECT_EQ(whole.layers[0].name, "radius");
  EXPECT_EQ(whole.layers[1].name, "tests.looks");
  EXPECT_EQ(whole.layers[2].name, "tests.rejections");
  for (const auto& layer : whole.layers) EXPECT_EQ(layer.values.size(), kPixels);
  EXPECT_FLOAT_EQ(whole.layers[0].values[0], 0.49F);
  EXPECT_EQ(whole.layers[2].values[0], 2);
  EXPECT_EQ(whole.layers[1].values[10], 1);
}

// Claim: a rule refuses constants that are missing or wrong by their name, and sums, states and memos that
// are not the job's; it never reads beyond them.
TEST(Rules, RefuseWhatTheyCannotDecide) {
  const std::vector<test::ToyPlan> plans = {test::fppm_plan(short_epochs("fppm", 0), 0.01, 0.7),
                                            test::cppm_plan(short_epochs("cppm", 0), 0.01),
                                            test::appm_plan(short_epochs("appm", 0))};
  for (const test::ToyPlan& plan : plans) {
    const std::string& rule = plan.epochs.rule;
    for (const auto& [name, value] : plan.epochs.constants) {
      if (name == "floors") continue;
      test::ToyPlan without = plan;
      without.epochs.constants.erase(name);
      Carry carry = empty_carry(plan.accumulators, kWidth, kHeight);
      const auto refused = decide({without.epochs, 0, kWidth, kHeight, {}, {}}, carry);
      ASSERT_FALSE(refused.ok()) << rule << ' ' << name;
      EXPECT_EQ(refused.error().field, "work.epochs.constants." + name);
    }
    Carry none;
    EXPECT_FALSE(decide({plan.epochs, 0, kWidth, kHeight, {}, {}}, none).ok()) << rule;
    Carry carry = empty_carry(plan.accumulators, kWidth, kHeight);
    ASSERT_TRUE(decide({plan.epochs, 0, kWidth, kHeight, {}, {}}, carry).ok());
    EXPECT_FALSE(decide({plan.epochs, 1, kWidth, kHeight, "abc", {}}, carry).ok()) << rule;
    const std::string state(kPixels, '\0');
    DecisionInput input{plan.epochs, 1, kWidth, kHeight, state, DecisionInput::Folded{0, state, {}}};
    EXPECT_FALSE(decide(input, carry).ok()) << rule << ": no sums";
  }
}

// Claim: lag 0, 1 and 4 decide the same of the same sums, lag epochs later, as long as nothing shrinks.
TEST(Rules, LagDelaysDecisions) {
  for (const std::uint32_t lag : {0U, 1U, 4U}) {
    Job job = fppm(lag);
    job.photons(7, kUneven);
    for (std::uint32_t e = 0; e < lag; ++e) {
      job.next();
      EXPECT_EQ(job.level(7), 0);
    }
    job.next();
    EXPECT_EQ(job.level(7), 1) << lag;
  }
}

}  // namespace
}  // namespace candela
