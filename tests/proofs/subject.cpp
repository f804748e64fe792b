// Tests for test_proofs.py, which says what must happen to them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>

#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

const proofs::FilmsDecide kFilms({"Subject"});

std::string variable(const char* name, const char* otherwise) {
  const char* text = std::getenv(name);
  return text != nullptr ? text : otherwise;
}

TestScene furnace(const std::string& radiance) {
  return scene_from_xml(
      "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='2'/></integrator>"
      "<sensor type='perspective'/><emitter type='constant'><rgb name='radiance' value='" +
          radiance + "'/></emitter></scene>",
      8, 8);
}

// Says that the body ran in full.
void leave_a_mark() {
  if (!proofs::probing()) std::ofstream(variable("SUBJECT_MARK", "/dev/null"), std::ios::app) << "ran\n";
}

TEST(Subject, HasTheRadianceOfItsSky) {
  leave_a_mark();
  const auto batches = render_batches(furnace(variable("SUBJECT_RADIANCE", "0.5")), 1, 8, 4);
  const BlockTestResult result =
      block_test(batches, std::vector<float>(8 * 8 * 3, 0.5f), {}, 8, 8, {8, 0.02, 0, {}});
  EXPECT_GT(result.adjusted_p, 1e-4) << result.worst;
}

// The scene of the first test.
TEST(Subject, SharesAScene) {
  const auto batches = render_batches(furnace(variable("SUBJECT_RADIANCE", "0.5")), 2, 8, 4);
  EXPECT_EQ(batches.size(), 8U);
}

// Parts of a sky of their own each, and one that they share.
TEST(Subject, HasParts) {
  const std::string wanted = variable("SUBJECT_PARTS", "");
  if (wanted.empty()) GTEST_SKIP() << "only where it is asked for";
  EXPECT_EQ(render_batches(furnace(variable("SUBJECT_SHARED", "0.125")), 1, 2, 1).size(), 2U);
  std::istringstream names(wanted);
  for (std::string name; std::getline(names, name, ',');) {
    const proofs::Part part(name.substr(0, name.find('=')));
    if (part.proved()) continue;
    if (!proofs::probing())
      std::ofstream(variable("SUBJECT_MARK", "/dev/null"), std::ios::app) << name << '\n';
    EXPECT_EQ(render_batches(furnace(name.substr(name.find('=') + 1)), 1, 2, 1).size(), 2U);
  }
}

// In the probe the batches 0 and 5 are one, and the second scene is not rendered.
TEST(Subject, LooksBeforeItRendersAll) {
  const auto batches = render_batches(furnace("0.25"), 1, 6, 4);
  if (proofs::probing() && batches[0] == batches[5]) return;
  EXPECT_EQ(render_batches(furnace("0.75"), 1, 1, 4).size(), 1U);
}

// As one whose film depends on which thread comes first: each run has another.
TEST(Subject, IsAnotherEachTime) {
  const std::string runs = variable("SUBJECT_RUNS", "");
  if (runs.empty()) GTEST_SKIP() << "only where it is asked for";
  std::ofstream(runs, std::ios::app) << "ran\n";
  std::ifstream in(runs);
  const auto count = std::count(std::istreambuf_iterator<char>(in), {}, '\n');
  EXPECT_EQ(render_batches(furnace("0." + std::to_string(count)), 1, 1, 4).size(), 1U);
}

// Films do not decide this one.
TEST(Other, RunsAlways) {
  leave_a_mark();
}

}  // namespace
}  // namespace candela::statistical
