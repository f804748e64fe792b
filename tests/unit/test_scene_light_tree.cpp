// Claims about the choice among many emitters:
// - the tree chooses each with the probability it states (chi-squared), for several references, fronts and
//   kinds of crowd; what is left of the random number is uniform again;
// - probabilities sum to one, or to less only where whole branches are found dark on the way down;
// - no emitter that can light a point has probability zero (checked by the geometry of each lamp);
// - the build is deterministic, and survives emitters in one place, in a row, and a million of them in
//   bounded memory;
// - scenes of many lamps of all kinds are lit as the sum of their lamps, beside an environment too.
// False-alarm rate: about 40 chi-squared tests at 1e-6 and 10 comparisons at 5 standard errors: below 5e-5.
// Seeds are fixed, so that a test that passes keeps passing.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "tests/unit/chi_squared.h"
#include "tests/unit/light_cases.h"
#include "tests/unit/scene_fixture.h"
#include "worker/core/math.h"
#include "worker/scene/emitters/choice/light_tree.h"

namespace candela::scene {
namespace {

using test::build_scene;
using test::Draws;
using test::Mean;
using test::point_reference;

constexpr double kPi = std::numbers::pi;

// A small square lamp, a point or a spot.
struct Lamp {
  Vec3 p, n;
  float half = 0;                // side / 2; 0: a point
  float cutoff = math::kPi / 2;  // of emission around n
};

std::vector<Lamp> crowd(int count, std::uint64_t seed, int arrangement) {
  Draws draws(21, seed);
  std::vector<Lamp> lamps;
  for (int i = 0; i < count; ++i) {
    Lamp lamp;
    const Vec3 at{draws.next(), draws.next(), draws.next()};
    lamp.n = test::uniform_direction(draws.stream);
    if (arrangement == 0) lamp.p = at * 10.0f;         // a cloud
    if (arrangement == 1) lamp.p = {10 * at.x, 0, 0};  // a row
    if (arrangement == 2) lamp.p = {1, 2, 3};          // one place
    if (arrangement == 3) {                            // a ceiling
      lamp.p = {10 * at.x, 10 * at.y, 5};
      lamp.n = {0, 0, -1};
    }
    if (arrangement == 4) lamp.p = at * (i % 2 == 0 ? 1e-3f : 1e3f);  // two scales
    lamp.half = i % 3 == 0 ? 0.0f : 0.05f;
    if (i % 3 == 0) lamp.cutoff = i % 2 == 0 ? math::kPi : 0.5f;
    lamps.push_back(lamp);
  }
  return lamps;
}

LightTree tree_of(const std::vector<Lamp>& lamps) {
  std::vector<LightBounds> bounds;
  for (std::size_t i = 0; i < lamps.size(); ++i) {
    const Lamp& lamp = lamps[i];
    LightBounds b;
    const Frame frame = make_frame(lamp.n);
    for (int k = 0; k < 4; ++k)
      b.box.add(Vec3d(lamp.p + frame.s * ((k & 1) != 0 ? lamp.half : -lamp.half) +
                      frame.t * ((k & 2) != 0 ? lamp.half : -lamp.half)));
    b.axis = lamp.n;
    b.emission = lamp.cutoff;
    b.strength = static_cast<float>(1 + i % 7);
    b.power = static_cast<double>(b.strength);
    b.emitter = static_cast<std::uint32_t>(i);
    bounds.push_back(b);
  }
  return LightTree(bounds, lamps.size());
}

bool can_light(const Lamp& lamp, Vec3 p, Vec3 front) {
  const Frame frame = make_frame(lamp.n);
  for (int k = 0; k < 9; ++k) {
    const Vec3 q = lamp.p + frame.s * (lamp.half * static_cast<float>(k % 3 - 1)) +
                   frame.t * (lamp.half * static_cast<float>(k / 3 - 1));
    const Vec3 d = p - q;
    const float l = length(d);
    if (l > 0 && dot(d, lamp.n) / l > std::cos(lamp.cutoff) &&
        (length_squared(front) == 0 || dot(front, d) < 0))
      return true;
  }
  return false;
}

TEST(LightTrees, ChooseAsTheySay) {
  std::uint64_t seed = 0;
  for (int arrangement = 0; arrangement < 5; ++arrangement) {
    const std::vector<Lamp> lamps = crowd(300, 10 + static_cast<std::uint64_t>(arrangement), arrangement);
    const LightTree tree = tree_of(lamps);
    Draws draws(22, ++seed);
    for (int reference = 0; reference < 6; ++reference) {
      Vec3 p = Vec3{draws.next(), draws.next(), draws.next()} * 10.0f;
      if (reference == 5) p = lamps[7].p + lamps[7].n * 0.01f;  // close to one
      const Vec3 front = reference % 2 == 0 ? Vec3{} : test::uniform_direction(draws.stream);
      constexpr int kSamples = 30000;
      std::vector<double> observed(lamps.size() + 1), expected(lamps.size() + 1), left(20);
      double total = 0;
      for (std::uint32_t i = 0; i < lamps.size(); ++i) {
        const float q = tree.prob(p, front, i);
        ASSERT_GE(q, 0);
        expected[i] = kSamples * static_cast<double>(q);
        total += static_cast<double>(q);
        if (can_light(lamps[i], p, front)) {
          EXPECT_GT(q, 0) << arrangement << " " << i;
        }
      }
      EXPECT_LE(total, 1 + 1e-5);
      if (length_squared(front) == 0) {
        EXPECT_GT(total, 0.5);
      }
      expected.back() = kSamples * std::max(0.0, 1 - total);
      int drawn = 0;
      for (int i = 0; i < kSamples; ++i) {
        std::uint32_t emitter = 0;
        float q = 0;
        double rest = 0;
        if (!tree.sample(p, front, draws.stream.next_double(), emitter, q, rest)) {
          observed.back() += 1;
          continue;
        }
        ++drawn;
        ASSERT_EQ(q, tree.prob(p, front, emitter));
        observed[emitter] += 1;
        left[std::min<std::size_t>(19, static_cast<std::size_t>(rest * 20))] += 1;
      }
      EXPECT_GT(test::chi_squared_p(observed, expected), 1e-6) << arrangement << " " << reference;
      if (drawn > 1000) {
        EXPECT_GT(test::chi_squared_p(left, std::vector<double>(20, drawn / 20.0)), 1e-6);
      }
    }
  }
}

// A tree is worth its build: near lamps are chosen far more often than power alone would.
TEST(LightTrees, PreferWhatIsNearAndFaces) {
  const std::vector<Lamp> lamps = crowd(1000, 30, 3);  // a ceiling at z = 5
  const LightTree tree = tree_of(lamps);
  const Vec3 p{5, 5, 4.8f};
  double near = 0;
  int count = 0;
  for (std::uint32_t i = 0; i < lamps.size(); ++i) {
    const Vec3 v = lamps[i].p - p;
    if (v.x * v.x + v.y * v.y > 1) continue;
    ++count;
    near += static_cast<double>(tree.prob(p, {0, 0, 1}, i));
  }
  EXPECT_LT(count, 60);
  EXPECT_GT(near, 6.0 * count / 1000);  // 1.0: as by power
  for (std::uint32_t i = 0; i < lamps.size(); ++i)
    EXPECT_EQ(tree.prob(p, {0, 0, -1}, i), 0.0f);       // all behind
  EXPECT_EQ(tree.importance({5, 5, 9}, {}) > 0, true);  // above it: points shine up too
}

TEST(LightTrees, AreOneForTheSameLamps) {
  const std::vector<Lamp> lamps = crowd(2000, 31, 0);
  const LightTree one = tree_of(lamps), other = tree_of(lamps);
  Draws draws(22, 50);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 p = Vec3{draws.next(), draws.next(), draws.next()} * 10.0f;
    const double u = draws.stream.next_double();
    std::uint32_t a = 0, b = 0;
    float pa = 0, pb = 0;
    double ra = 0, rb = 0;
    ASSERT_EQ(one.sample(p, {}, u, a, pa, ra), other.sample(p, {}, u, b, pb, rb));
    EXPECT_EQ(a, b);
    EXPECT_EQ(pa, pb);
  }
}

TEST(LightTrees, SurviveCrowds) {
  EXPECT_TRUE(LightTree().empty());
  for (const int arrangement : {0, 1, 2}) {
    const int count = arrangement == 0 ? 200000 : 20000;
    const LightTree tree = tree_of(crowd(count, 40, arrangement));
    EXPECT_LT(tree.bytes(), static_cast<std::uint64_t>(count) * 110);
    Draws draws(22, 60);
    int drawn = 0;
    for (int i = 0; i < 100; ++i) {
      std::uint32_t emitter = 0;
      float q = 0;
      double rest = 0;
      const Vec3 p = Vec3{draws.next(), draws.next(), draws.next()} * 10.0f;
      if (!tree.sample(p, {}, draws.stream.next_double(), emitter, q, rest)) continue;
      EXPECT_EQ(q, tree.prob(p, {}, emitter));
      ++drawn;
    }
    EXPECT_GT(drawn, 50);
  }
}

// 70 lamps of all kinds and sizes, an environment and a sun: irradiance by the whole against the sum of each
// alone, at several points. Each alone is chosen with certainty, so that the choice cannot be wrong there.
TEST(LightTrees, ScenesKeepAllTheirLight) {
  std::vector<std::string> lamps;
  Draws draws(22, 70);
  for (int i = 0; i < 70; ++i) {
    const double x = 4 * static_cast<double>(draws.next()) - 2, y = 4 * static_cast<double>(draws.next()) - 2,
                 z = 1 + static_cast<double>(draws.next());
    const std::string at = fmt::format("<translate x=\"{}\" y=\"{}\" z=\"{}\"/></transform>", x, y, z);
    const std::string turned = fmt::format(
        "<transform name=\"to_world\"><scale value=\"0.08\"/><rotate x=\"1\" y=\"0.3\" "
        "angle=\"{}\"/>{}",
        100 + 150 * static_cast<double>(draws.next()), at);
    const std::string area = fmt::format(
        "<emitter type=\"area\"><rgb name=\"radiance\" value=\"{}\"/></emitter></shape>", 1 + i % 5);
    switch (i % 6) {
      case 0:
        lamps.push_back("<shape type=\"rectangle\">" + turned + area);
        break;
      case 1:
        lamps.push_back("<shape type=\"disk\">" + turned + area);
        break;
      case 2:
        lamps.push_back("<shape type=\"sphere\">" + turned + area);
        break;
      case 3:
        lamps.push_back("<shape type=\"cube\">" + turned + area);
        break;
      case 4:
        lamps.push_back("<emitter type=\"spot\">" + turned +
                        "<rgb name=\"intensity\" value=\"0.2\"/><float "
                        "name=\"cutoff_angle\" value=\"60\"/></emitter>");
        break;
      default:
        lamps.push_back(
            fmt::format("<emitter type=\"point\"><point name=\"position\" x=\"{}\" y=\"{}\" "
                        "z=\"{}\"/><rgb name=\"intensity\" value=\"0.05\"/></emitter>",
                        x, y, z));
    }
  }
  lamps.push_back("<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.05\"/></emitter>");
  lamps.push_back(
      "<emitter type=\"directional\"><vector name=\"direction\" x=\"0.1\" y=\"0.2\" z=\"-1\"/><rgb "
      "name=\"irradiance\" value=\"0.1\"/></emitter>");
  std::string all;
  for (const std::string& lamp : lamps) all += lamp;
  auto scene = build_scene(all);
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  const auto irradiance = [&](const Scene& of, const SurfaceHit& at, Vec3 front, int n, Mean& mean) {
    for (int i = 0; i < n; ++i) {
      DirectSample light;
      const float u = draws.next();
      double value = 0;
      // Unoccluded: each lamp alone casts no shadows of others.
      if (of.sample_direct(at, front, u, draws.next_2d(), light) == DirectOutcome::sampled)
        value = static_cast<double>(light.radiance.g * std::max(0.0f, dot(at.ng, light.wi)) /
                                    light.pdf_solid_angle);
      mean.add(value);
    }
  };
  for (const Vec3 p : {Vec3{0, 0, 0}, Vec3{1.5f, -1, 1.4f}}) {
    const SurfaceHit at = point_reference(p, normalize(Vec3{0.1f, 0.2f, 1}));
    for (const Vec3 front : {Vec3{}, at.ng}) {
      Mean whole;
      irradiance(**scene, at, front, 150000, whole);
      double sum = 0, variance = 0;
      for (const std::string& lamp : lamps) {
        auto alone = build_scene(lamp);
        ASSERT_TRUE(alone.ok());
        Mean one;
        irradiance(**alone, at, front, 1500, one);
        sum += one.mean();
        variance += one.error() * one.error();
      }
      EXPECT_NEAR(whole.mean(), sum, 5 * std::sqrt(variance + whole.error() * whole.error()));
      EXPECT_LT(whole.error() / whole.mean(), 0.02);
    }
  }
}

}  // namespace
}  // namespace candela::scene
