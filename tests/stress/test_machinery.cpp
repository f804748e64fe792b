// Claims about the sweeps themselves: that a wrong image is called broken, a noisy one undecided, that what
// is rejected is counted, and that no claim is empty.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>

#include "common/rng/stream.h"
#include "tests/integrators.h"
#include "tests/proofs/proofs.h"
#include "tests/stress/report.h"
#include "tests/stress/scenes.h"

namespace candela::stress {
namespace {

const proofs::FilmsDecide kFilms({"StressMachinery.FlagsAWrongImage", "StressMachinery.FlagsPlantedFaults"});

// Cheap, and known to every integrator.
Sweep closed_spheres(double expected_factor) {
  Sweep sweep;
  sweep.name = "closed";
  sweep.values = {0.5, 0.2};
  sweep.benign = 0.5;
  sweep.thin = sweep.values;
  sweep.tolerance = 0.06;
  sweep.iterations = 32;
  sweep.shot = [expected_factor](double value) {
    Shot shot = uniform_shot(closed_sphere(1, value, 1), expected_factor / (1 - value));
    set(shot, "max_depth", number(16));  // leaves out less than 2e-5
    return shot;
  };
  sweep.claims = claims_of(kEveryone);
  return sweep;
}

Point run_one(const Sweep& sweep, const std::string& integrator, const RunOptions& options = {}) {
  const Claim* claim = find_claim(sweep, integrator);
  return Runner(sweep, *claim, options).run(0.5);
}

void brighten(std::uint64_t, float* rgb) {
  for (int c = 0; c < 3; ++c) rgb[c] *= 1.2f;
}
void spoil_some(std::uint64_t key, float* rgb) {
  if ((rng::mix64(key) & 3) == 0) rgb[0] = std::numeric_limits<float>::quiet_NaN();
}

// Claim: every integrator's image is called within where the expected value is right, and broken where it is
// wrong by a fifth.
TEST(StressMachinery, FlagsAWrongImage) {
  for (const auto& integrator : kEveryone) {
    const Point right = run_one(closed_spheres(1), integrator);
    EXPECT_EQ(right.verdict, Verdict::within) << integrator << " " << right.measured << " " << right.refusal;
    EXPECT_EQ(right.rejected(), 0U) << integrator;
    const Point wrong = run_one(closed_spheres(1.2), integrator);
    EXPECT_EQ(wrong.verdict, Verdict::broken) << integrator << " " << wrong.measured << " " << wrong.refusal;
  }
}

// Claim: a fault planted on the way into the film is seen, whichever integrator it befalls; and samples that
// are not numbers are counted by cause.
TEST(StressMachinery, FlagsPlantedFaults) {
  for (const std::string& integrator : kEveryone) {
    if (test::has_chains(integrator)) continue;
    RunOptions options;
    options.fault = brighten;
    EXPECT_EQ(run_one(closed_spheres(1), integrator, options).verdict, Verdict::broken) << integrator;
    options.fault = spoil_some;
    const Point spoilt = run_one(closed_spheres(1), integrator, options);
    EXPECT_EQ(spoilt.verdict, Verdict::broken) << integrator;
    EXPECT_GT(spoilt.sample_counts.rejected[0], 0U) << integrator;
    EXPECT_EQ(spoilt.sample_counts.rejected[0], spoilt.rejected()) << integrator;
  }
}

// Claim: a sweep that compares with its benign end sees a change, and only there.
TEST(StressMachinery, FlagsAChangeAlongTheSweep) {
  Sweep sweep = closed_spheres(1);
  const auto known = sweep.shot;
  sweep.shot = [known](double value) {
    Shot shot = known(value);
    shot.quantities.clear();
    return shot;
  };
  Runner runner(sweep, *find_claim(sweep, "path"), {});
  EXPECT_EQ(runner.run(0.5).verdict, Verdict::within);
  EXPECT_EQ(runner.run(0.2).verdict, Verdict::broken);
}

// Claim: a scene that is refused is broken, and says why.
TEST(StressMachinery, RefusalsAreNotSilent) {
  Sweep sweep = closed_spheres(1);
  sweep.shot = [](double) {
    Shot shot;
    shot.body = "<shape type=\"sphere\"><float name=\"radius\" value=\"-1\"/></shape>";
    return shot;
  };
  const Point point = run_one(sweep, "path");
  EXPECT_EQ(point.verdict, Verdict::broken);
  EXPECT_NE(point.refusal, "");
}

// Claim: the verdict is what its definition says. Of normal batches at the edge of the tolerance at most a
// share alpha is called within, or broken; far inside and outside nearly all are decided.
TEST(StressMachinery, VerdictsKeepTheirRates) {
  constexpr int kTrials = 4000;
  constexpr double kAlpha = 0.02;
  for (const double truth : {0.0, 1.0, -1.0, 2.0}) {
    int within = 0, broken = 0;
    rng::Stream stream(17);
    for (int trial = 0; trial < kTrials; ++trial) {
      std::vector<double> batches;
      for (int i = 0; i < 16; ++i) {
        double sum = -6;  // nearly normal: twelve uniform numbers
        for (int k = 0; k < 12; ++k) sum += static_cast<double>(stream.next_float());
        batches.push_back(truth + 0.4 * sum);
      }
      const Verdict verdict = judge(batches, 1, kAlpha).verdict;
      within += verdict == Verdict::within;
      broken += verdict == Verdict::broken;
    }
    // One side counts at the edge: alpha / 2 of the trials, and five standard deviations of such a count.
    const double most = kTrials * kAlpha / 2 + 5 * std::sqrt(kTrials * kAlpha / 2);
    if (truth == 0) {
      EXPECT_GT(within, kTrials * 99 / 100);
    } else if (truth == 2) {
      EXPECT_GT(broken, kTrials * 99 / 100);
    } else {
      EXPECT_LT(within, most);
      EXPECT_LT(broken, most);
      EXPECT_GT(within + broken, 0);
    }
  }
  // Rare, bright batches say nothing yet.
  std::vector<double> rare(16, 0.0);
  rare[3] = 5;
  EXPECT_EQ(judge(rare, 0.4, kAlpha).verdict, Verdict::undecided);
  EXPECT_EQ(judge(std::vector<double>(16, 0.5), 0.4, kAlpha).verdict, Verdict::broken);
  EXPECT_EQ(judge(std::vector<double>(16, 0.0), 0, kAlpha).verdict, Verdict::within);
}

// Claim: points survive being written and read.
TEST(StressMachinery, PointsAreReadAsTheyWereWritten) {
  Point p;
  p.sweep = "a-b";
  p.integrator = "vcm";
  p.value = 1e-12;
  p.verdict = Verdict::broken;
  p.quantity = "top left";
  p.measured = 1.5;
  p.sample_counts.rejected = {1, 2, 3, 4, 5};
  p.sample_counts.eye_samples = 7;
  p.refusal = "no, \"never\"";
  const auto read = read_csv(csv({p, p}));
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(csv(read), csv({p, p}));
  EXPECT_EQ(read[0].value, p.value);
  EXPECT_EQ(read[0].sample_counts.rejected, p.sample_counts.rejected);
  // A damaged line is no point.
  for (const auto& [part, damaged] : std::map<std::string, std::string>{{",broken,", ",maybe,"},
                                                                        {",vcm,", ",vcm,,"},
                                                                        {",1.5,", ",much,"},
                                                                        {",1,2,", ",1,1e999,"},
                                                                        {",3,4,", ",3,-4,"}}) {
    std::string bad = csv({p});
    ASSERT_NE(bad.find(part), std::string::npos) << part;
    bad.replace(bad.find(part), part.size(), damaged);
    EXPECT_THROW((void)read_csv(bad), std::runtime_error) << bad;
  }
  const auto limits = read_limits("# words\na-b vcm 1e-12 0\na-b path\n");
  ASSERT_EQ(limits.size(), 2U);
  EXPECT_EQ(limits[0].values, (std::vector<double>{1e-12, 0}));
  EXPECT_TRUE(limits[1].values.empty());
}

// Claim: the table says where the run of points within around the benign end stops, and why.
TEST(StressMachinery, ReachStopsAtTheFirstFailure) {
  Sweep sweep;
  sweep.name = "s";
  sweep.values = {-2, -1, 0, 1, 2, 3};
  sweep.benign = 0;
  std::vector<Point> points;
  for (const double value : sweep.values) {
    Point p;
    p.value = value;
    p.verdict = Verdict::within;
    points.push_back(p);
  }
  EXPECT_EQ(reach(sweep, points), "all");
  points[4].verdict = Verdict::broken;
  points[0].verdict = Verdict::undecided;
  EXPECT_EQ(reach(sweep, points), "-1 to 1; noise -2; **broken** 2");
  points[2].verdict = Verdict::broken;
  EXPECT_EQ(reach(sweep, points), "-1; noise -2; **broken** 0");
  for (Point& p : points) p.verdict = Verdict::undecided;
  EXPECT_EQ(reach(sweep, points), "none: noise");
}

// Claim: each integrator is run through each sweep, or says why not; the short form is part of the long one.
TEST(StressMachinery, NoClaimIsEmpty) {
  for (const Sweep& sweep : all_sweeps()) {
    const auto has = [&](double v) {
      return std::find(sweep.values.begin(), sweep.values.end(), v) != sweep.values.end();
    };
    EXPECT_TRUE(has(sweep.benign)) << sweep.name;
    for (const double value : sweep.thin) EXPECT_TRUE(has(value)) << sweep.name << " " << value;
    for (const auto& integrator : kEveryone) {
      const Claim* claim = find_claim(sweep, integrator);
      const bool excused = std::any_of(sweep.excuses.begin(), sweep.excuses.end(),
                                       [&](const Excuse& e) { return e.integrator == integrator; });
      EXPECT_NE(claim != nullptr, excused) << sweep.name << " " << integrator;
    }
  }
}

}  // namespace
}  // namespace candela::stress
