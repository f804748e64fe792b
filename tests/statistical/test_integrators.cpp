// Every integrator against `path`, or against the best there is where path cannot, on every scene of
// transport/ that it can render (transport_scenes.h says which, and why not the others), in blocks of 16 by
// 16 pixels and over the whole image, three channels each; in the nightly form against `bdpt`, too. The test
// is that of block_tests.h: a pair alarms falsely with probability at most 1e-5; there are fewer than 300
// pairs, in the nightly form 500: the whole file with at most 3e-3 (5e-3) for other seeds.
//
// Merging integrators are biased at any radius. Each batch renders the radii r and r/2 with the same seed and
// is replaced by 2 M(r/2) - M(r), which takes away what is linear in r (edges of objects, shadows); what is
// quadratic (curvature of the light's density) is left with the opposite sign and half its size, and a
// margin allows for it. The variance is that of the batches of the combination.
//
// Short form: a fixed number of iterations; every pair prints what difference it would have found with
// probability 0.9; of the scenes whose films changed, a quarter in turn. Nightly form (CANDELA_LONG=1): as
// many iterations as a difference of 0.5 % in every block needs, at most CANDELA_LONG_SECONDS (1800) of all
// processors for each estimator of a pair.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <optional>
#include <stdexcept>
#include <thread>
#include <vector>

#include "tests/integrators.h"
#include "tests/proofs/proofs.h"
#include "tests/statistical/extrapolation.h"
#include "tests/statistical/harness.h"
#include "tests/statistical/transport_scenes.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"Integrators", "Plans", "Depths"});

constexpr std::uint32_t kExtent = 64;
const Regions kRegions(kExtent, kExtent, 16);

// The wider radius r of merging integrators, as a fraction of the scene's bounding radius, and what of their
// bias may be left, relative to a value. ppm and bpm see light by merging alone: the noise of a block falls
// with the number of pairs of a photon and an eye path, the cost with the sum. So they get a film of more
// pixels, whose blocks are as much larger and show the same, and the short form affords only a wide radius.
struct Merging {
  double radius, margin;
  std::uint32_t finer = 1;  // the film is as many times wider and higher
};

double nightly_seconds() {
  const char* text = std::getenv("CANDELA_LONG_SECONDS");
  return text != nullptr ? std::atof(text) : 1800;
}

// With little time 0.5 % is out of reach anyway, and one iteration on a film of a million pixels would take
// all of it. With enough, half the radius leaves a quarter of the bias, and so most of the 0.5 % to noise.
Merging merging(std::string_view integrator) {
  const bool full = long_form() && nightly_seconds() >= 300;
  if (test::integrator_row(integrator).family() == "vcm")
    return full ? Merging{0.005, 0.001} : Merging{0.01, 0.003};
  if (full) return {0.005, 0.001, 16};
  return long_form() ? Merging{0.01, 0.003, 4} : Merging{0.03, 0.02, 2};
}

constexpr double kNightlyDifference = 0.005;

TestScene load(std::string_view name) {
  TestScene scene = scene_from_transport(name, kExtent, kExtent);
  use_own_filter(scene);
  return scene;
}

using test::merges;

double margin_of(std::string_view integrator) {
  return merges(integrator) ? merging(integrator).margin : 0;
}

// The scene rendered by an integrator, as its expectation without the bias of a radius.
std::vector<Term> terms_for(const TestScene& scene, const std::string& integrator, SettingsMap settings) {
  if (!merges(integrator)) return {{1.0, with_integrator(scene, integrator, settings)}};
  settings.insert_or_assign("alpha", std::string("1"));
  settings.insert_or_assign("radius", fmt::format("{}", merging(integrator).radius));
  const TestScene wide = with_integrator(scene, integrator, settings);
  settings.insert_or_assign("radius", fmt::format("{}", merging(integrator).radius / 2));
  const Extrapolation by = over_half_radius();
  return {{by.fine, with_integrator(scene, integrator, settings)}, {by.coarse, wide}};
}

// What of the squared standard error of a difference is the tested one's. The rest is the reference's, which
// is the faster of the two and rendered once for all.
constexpr double kShareOfTested = 0.8;

// More iterations in the nightly form: what the noisiest value of a first small run asks for,
// within the time there is.
double nightly_effort(const Estimator& small, std::size_t batches, const Regions& regions, double share,
                      const BlockTest& test, std::size_t batches_small) {
  if (!long_form()) return 1;
  const auto begin = std::chrono::steady_clock::now();
  const Rows rows = small.rows(0, 1);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  const double needed = effort_for(rows, regions, kNightlyDifference, batches, share, test);
  const double second = static_cast<double>(batches_small) / static_cast<double>(batches) / seconds.count();
  const double effort = std::clamp(needed, 1.0, std::max(1.0, nightly_seconds() * second));
  std::printf("%s: %.3g s for 0.5 %% in every block, runs %.3g s\n", small.name.c_str(), needed / second,
              effort / second);
  std::fflush(stdout);
  return effort;
}

struct Contest {
  Estimator estimator;
  double effort;
};
// `margin`: of the pairs that it takes part in.
Contest enter(const TestScene& scene, const std::string& integrator, std::uint64_t seed, double share,
              double margin, const SettingsMap& settings = {}, std::uint64_t iterations = 2) {
  BatchPlan plan;
  plan.seed = seed << 32;
  plan.iterations = iterations;
  if (long_form()) {
    plan.batches = 32;
    plan.threads = std::max(2U, std::thread::hardware_concurrency());
  }
  std::string name = integrator;
  for (const auto& [key, value] : settings) name += fmt::format(" {}={}", key, value);
  BlockTest test;
  test.margin = margin;
  // A filter is as wide as its pixels: the finer film would be another picture.
  const std::uint32_t finer =
      merges(integrator) && scene.settings.filter == "box" ? merging(integrator).finer : 1;
  const Regions regions(finer * kExtent, finer * kExtent, finer * 16);
  std::vector<Term> terms = terms_for(scene, integrator, settings);
  for (Term& term : terms) term.scene.settings.width = term.scene.settings.height = finer * kExtent;
  plan.iterations = std::max<std::uint64_t>(1, plan.iterations / finer);
  BatchPlan small = plan;
  small.batches = 12;
  const double effort = nightly_effort(make_estimator(name, terms, small, regions), plan.batches, regions,
                                       share, test, small.batches);
  return {cached(make_estimator(name, std::move(terms), plan, regions)), effort};
}

// By the integrator's name, so that a new one changes no film of the others.
std::uint64_t seed_of(std::string_view integrator, std::uint64_t purpose) {
  std::uint32_t hash = 2166136261;  // FNV-1a
  for (const char c : integrator) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619;
  return (purpose << 24) + (hash & 0xffffff);
}

// What the parts of a test share is rendered outside of them (proofs::Part).
void render_for_all_parts(const Contest& contest) {
  if (proofs::probing()) contest.estimator.rows(1, contest.effort);
}

// Fails unless the two agree.
Verdict expect_agreement(const Contest& tested, const Contest& reference, bool slow, double margin) {
  BlockTest test;
  test.effort = tested.effort;
  test.effort_reference = reference.effort;
  test.margin = margin;
  test.only_brighter = slow;
  test.decide = long_form() ? 1.1 * kNightlyDifference : 0.1;
  const Verdict verdict = compare(tested.estimator, reference.estimator, kRegions, test);
  std::printf("%s\n", verdict.report.c_str());
  EXPECT_TRUE(verdict.agree);
  EXPECT_GT(verdict.values, 0U);
  // Something was decided, unless the table says that it takes far more.
  if (!slow) {
    EXPECT_GT(verdict.tested * 2, verdict.values) << verdict.report;
  }
  return verdict;
}

// By name: GoogleTest prints it.
const TransportScene& entry_of(const std::string& name) {
  for (const TransportScene& scene : kTransportScenes)
    if (scene.name == name) return scene;
  throw std::runtime_error("no scene " + name);
}

// The gate (deploy/check) gives the number of its commit in CANDELA_ROTATION: of the scenes whose films
// changed, a quarter then runs, another one with each commit. Unset, all run; tests/nightly/prove proves them
// all.
bool has_its_turn(std::string_view name) {
  constexpr std::uint64_t kTurns = 4;
  const char* rotation = std::getenv("CANDELA_ROTATION");
  if (rotation == nullptr || long_form() || proofs::probing()) return true;
  const auto scene = std::find_if(kTransportScenes.begin(), kTransportScenes.end(),
                                  [&](const TransportScene& one) { return one.name == name; });
  const auto index = static_cast<std::uint64_t>(scene - kTransportScenes.begin());
  return (index + std::strtoull(rotation, nullptr, 10)) % kTurns == 0;
}

class Integrators : public testing::TestWithParam<std::string> {};

// Claim: every integrator renders the picture that `path` renders, and that the reference does: path itself
// in the short form, in the nightly one the least noisy there is, for whose sake alone 0.5 % is within reach.
TEST_P(Integrators, Agree) {
  const TransportScene& entry = entry_of(GetParam());
  if (!has_its_turn(entry.name)) GTEST_SKIP() << "its films changed; its turn is with another commit";
  const TestScene scene = load(entry.name);
  const unsigned good = entry.complete & ~entry.slow;
  const std::vector<std::string> short_order = {"path", "bdpt", "vcm", "bpm", "ppm"};
  const std::vector<std::string> nightly_order = {"bdpt", "path", "vcm", "bpm", "ppm"};
  std::string reference;
  double margin = 0;
  for (const std::string& name : compared_on(entry, long_form())) margin = std::max(margin, margin_of(name));
  for (const std::string& name : long_form() ? nightly_order : short_order)
    if (reference.empty() && (good & transport_bit(name)) != 0) reference = name;
  ASSERT_FALSE(reference.empty()) << "no integrator renders this scene";
  const Contest right = enter(scene, reference, 1, 1 - kShareOfTested, margin + margin_of(reference));
  std::printf("%s (%s)\n", std::string(entry.name).c_str(), std::string(entry.hazard).c_str());
  render_for_all_parts(right);
  std::optional<Contest> path;
  std::size_t others = 0;
  for (const std::string& name : compared_on(entry, long_form())) {
    if (name == reference) continue;
    ++others;
    const proofs::Part part(name);
    if (part.proved()) continue;
    SCOPED_TRACE(fmt::format("{}, {}", entry.name, name));
    const bool slow = (entry.slow & transport_bit(name)) != 0;
    const double both = margin_of(name) + margin_of(reference);
    const Contest tested = enter(scene, name, seed_of(name, 2), kShareOfTested, both);
    expect_agreement(tested, right, slow, both);
    if (name == "path" && !slow)
      path = tested;
    else if (path.has_value())  // rendered already: the second comparison is free
      expect_agreement(tested, *path, slow, both);
  }
  EXPECT_GT(others, 0u) << "no second integrator renders this scene";
}

std::vector<std::string> all_scenes() {
  std::vector<std::string> names;
  for (const TransportScene& scene : kTransportScenes) names.emplace_back(scene.name);
  return names;
}
std::string scene_name(const testing::TestParamInfo<std::string>& one) {
  std::string name = one.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}
INSTANTIATE_TEST_SUITE_P(, Integrators, testing::ValuesIn(all_scenes()), scene_name);

bool has_setting(const std::string& integrator, const std::string& setting) {
  const auto known = render::integrator_settings(integrator);
  return known.ok() &&
         std::any_of(known->begin(), known->end(), [&](const auto& one) { return one.name == setting; });
}

class Plans : public testing::TestWithParam<std::string> {};

// Claim: what a plan leaves out changes no mean: plan=full runs it all.
TEST_P(Plans, FullAgreesWithAuto) {
  const TransportScene& entry = entry_of(GetParam());
  const TestScene scene = load(entry.name);
  std::size_t tried = 0;
  for (const std::string& name : compared_on(entry, long_form())) {
    if (!has_setting(name, "plan")) continue;
    ++tried;
    const proofs::Part part(name);
    if (part.proved()) continue;
    SCOPED_TRACE(fmt::format("{}, {}", entry.name, name));
    const double margin = margin_of(name);
    expect_agreement(enter(scene, name, seed_of(name, 11), 0.5, margin, {{"plan", "full"}}),
                     enter(scene, name, seed_of(name, 21), 0.5, margin),
                     (entry.slow & transport_bit(name)) != 0, margin);
  }
  EXPECT_GT(tried, 0u) << "no integrator with a plan renders this scene";
}

// The short form has a scene of each kind of features that plans look at.
std::vector<std::string> scenes_for_plans() {
  if (long_form()) return all_scenes();
  return {"box-diffuse", "mirror-glossy", "constant", "point", "sun-and-lamps", "fog-thin", "thin-null"};
}
// Short paths: where a limit of the depth cuts is seen best. max_depth 1 shows what the camera sees directly.
class Depths : public testing::TestWithParam<std::string> {};

TEST_P(Depths, Agree) {
  const TransportScene& entry = entry_of(GetParam());
  const TestScene scene = load(entry.name);
  for (const char* depth : {"1", "2", "3"}) {
    const SettingsMap settings{{"max_depth", depth}};
    const Contest right = enter(scene, "path", 31, 1 - kShareOfTested, margin_of("bpm"), settings);
    render_for_all_parts(right);
    for (const std::string& name : compared_on(entry, long_form())) {
      if (name == "path") continue;
      const proofs::Part part(fmt::format("{}-{}", name, depth));
      if (part.proved()) continue;
      SCOPED_TRACE(fmt::format("{}, {}, max_depth {}", entry.name, name, depth));
      expect_agreement(enter(scene, name, seed_of(name, 32), kShareOfTested, margin_of(name), settings),
                       right, false, margin_of(name));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(, Depths, testing::Values("box-diffuse", "mask", "fog-thin", "lens"), scene_name);

INSTANTIATE_TEST_SUITE_P(, Plans, testing::ValuesIn(scenes_for_plans()), scene_name);

}  // namespace
}  // namespace candela::statistical
