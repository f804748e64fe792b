// The short form of every sweep: each integrator stays within tolerance at the values that limits.txt lists,
// and rejects no sample there. What is too noisy to tell is a failure, so a claim is never kept by silence. A
// point alarms falsely with probability at most 1e-3 for new seeds; with the committed ones it does what it
// does.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <ostream>
#include <sstream>

#include "tests/paths.h"
#include "tests/proofs/proofs.h"
#include "tests/stress/report.h"
#include "tests/stress/scenes.h"

namespace candela::stress {

// Names the sweep of a failed test.
void PrintTo(const Sweep& sweep, std::ostream* out) {
  *out << sweep.name;
}

namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"Sweeps"});

std::vector<Limit> committed_limits() {
  std::ifstream in(test::source_path("tests/stress/limits.txt"));
  std::ostringstream text;
  text << in.rdbuf();
  return read_limits(text.str());
}

class Sweeps : public testing::TestWithParam<Sweep> {};

TEST_P(Sweeps, IntegratorsStayWithinTheirLimits) {
  const Sweep& sweep = GetParam();
  std::size_t tested = 0;
  for (const Limit& limit : committed_limits()) {
    if (limit.sweep != sweep.name) continue;
    const Claim* claim = find_claim(sweep, limit.integrator);
    ASSERT_NE(claim, nullptr) << limit.integrator;
    if (limit.values.empty()) continue;
    tested += limit.values.size();
    const proofs::Part part(limit.integrator);
    if (part.proved()) continue;
    Runner runner(sweep, *claim, {});
    for (const double value : limit.values) {
      const Point p = runner.run(value);
      EXPECT_EQ(p.verdict, Verdict::within)
          << limit.integrator << " at " << value << " is " << name(p.verdict) << ": " << p.measured << " for "
          << p.expected << " (" << p.quantity << "), off by " << p.deviation << " +- "
          << p.stderr_of_deviation << ", tolerance " << p.tolerance << " " << p.refusal;
      EXPECT_EQ(p.rejected(), 0U) << limit.integrator << " at " << value;
    }
  }
  EXPECT_GE(tested, 6U) << "a sweep that tests next to nothing";
}

// Claim: limits.txt has a line for each sweep and each integrator that is run through it, with values of the
// short form, so that nobody falls out of the test unseen.
TEST(Limits, NobodyIsMissing) {
  const auto limits = committed_limits();
  for (const Sweep& sweep : all_sweeps())
    for (const Claim& claim : sweep.claims)
      EXPECT_EQ(std::count_if(limits.begin(), limits.end(),
                              [&](const Limit& l) {
                                return l.sweep == sweep.name && l.integrator == claim.integrator;
                              }),
                1)
          << sweep.name << " " << claim.integrator;
  for (const Limit& limit : limits) {
    const auto sweeps = all_sweeps();
    const Sweep& sweep = find_sweep(sweeps, limit.sweep);
    for (const double value : limit.values)
      EXPECT_NE(std::find(sweep.values.begin(), sweep.values.end(), value), sweep.values.end())
          << limit.sweep << " " << value;
  }
}

INSTANTIATE_TEST_SUITE_P(Stress, Sweeps, testing::ValuesIn(all_sweeps()), [](const auto& param) {
  std::string name = param.param.name;
  for (char& c : name)
    if (c == '-') c = '_';
  return name;
});

}  // namespace
}  // namespace candela::stress
