// The bias of mollified connections beside that of the theory: -(r / l)^2 / 4 of the light, for a plane
// mirror and a lamp that is the same in all directions, l the length of the edge that is mollified.
// [regularisation note, section 4]
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>
#include <vector>

#include "tests/proofs/proofs.h"
#include "tests/regularised_scenes.h"
#include "tests/statistical/chain_driver.h"
#include "tests/statistical/moments.h"
#include "worker/scene/features.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"RegularisedBias"});

constexpr std::uint32_t kSide = 24;
constexpr double kFov = 60;

// The mean of green over directions: a pixel of the flat film has the solid angle area cos^3.
template <class Image>
double over_directions(const Image& image) {
  const double half = std::tan(kFov / 2 * std::numbers::pi / 180);
  const auto at = [&](std::size_t k) { return (2 * (static_cast<double>(k) + 0.5) / kSide - 1) * half; };
  double sum = 0;
  for (std::size_t i = 0; i < std::size_t{kSide} * kSide; ++i) {
    const double x = at(i % kSide), y = at(i / kSide);
    sum += static_cast<double>(image[3 * i + 1]) * std::pow(1 + x * x + y * y, -1.5);
  }
  return sum / (kSide * kSide);
}

struct BiasCase {
  std::string integrator;
  double length;             // of the edge whose end is mollified
  std::uint64_t iterations;  // of a batch, or mutations per pixel
  SettingsMap settings = {};
  bool in_gate = false;
};

// From the lamp to mirror B: if this edge were nearly as long as that to the eye, both ways to mollify would
// share the path, and at a finite radius their shares do not add up to one.
constexpr double kBeforeB = 0.3;

// Claim: a lamp over two mirrors (scene T), at a radius that stays, has the bias of the theory in every
// integrator that mollifies: path tracing mollifies the mirror at the lamp, the others that at the eye, whose
// edge is longer. Terms of a higher order are below (r / l)^4 / 2.
TEST(RegularisedBias, IsAQuarterOfTheSquare) {
  const test::SceneText text = test::scene_t(kFov, 1, {}, kBeforeB);
  const TestScene plain = scene_from_xml(
      "<scene version=\"3.0.0\"><integrator type=\"path\"/>" + text.sensor + text.body + "</scene>", kSide,
      kSide);
  const double radius = static_cast<double>(make_renderer(plain)->features()->radius);
  const double half = std::tan(kFov / 2 * std::numbers::pi / 180);
  const double distance = test::SceneT::kD - test::SceneT::kBeforeB + kBeforeB;
  const double exact = test::SceneT::kIntensity / (distance * distance) / (4 * half * half);
  const std::uint64_t effort = long_form() ? 4 : 1;
  const std::vector<BiasCase> all{
      {"path", kBeforeB, 64},
      {"bdpt", test::SceneT::kBeforeA, 64},
      {"pssmlt", test::SceneT::kBeforeA, 64},
      {"mmlt", test::SceneT::kBeforeA, 64, {{"bootstrap", "100000"}}},
      {"mlt", test::SceneT::kBeforeA, 64, {{"direct", "chain"}}, true},
      {"mlt", test::SceneT::kBeforeA, 64, {{"direct", "chain"}, {"preset", "mlt"}}},
      {"mlt", test::SceneT::kBeforeA, 64, {{"direct", "chain"}, {"preset", "memlt"}}},
      {"mlt", test::SceneT::kBeforeA, 64, {{"direct", "chain"}, {"preset", "hslt"}}},
      {"erpt", test::SceneT::kBeforeA, 8, {{"direct", "chain"}}, true},
      {"erpt", test::SceneT::kBeforeA, 8, {{"direct", "chain"}, {"preset", "mept"}}}};
  for (const BiasCase& one : all) {
    if (!long_form() && !one.in_gate) continue;
    for (const double ratio : {0.3, 0.2, 0.1}) {
      if (!long_form() && ratio < 0.3) continue;
      SettingsMap settings = one.settings;
      settings.insert({{"regularise", "on"},
                       {"regularise_radius", fmt::format("{}", ratio * one.length / radius)},
                       {"regularise_exponent", "0"},
                       {"max_depth", "3"}});
      Moments mean;
      if (one.integrator.ends_with("mlt")) {
        settings.insert({{"chains", "40"},
                         {"bootstrap", "20000"},
                         {"large_step", "0.3"},
                         {"mutations", fmt::format("{}", one.iterations)}});
        ChainJob job{with_integrator(plain, one.integrator, settings)};
        job.rounds = effort;
        for (std::uint64_t seed = 0; seed < 12; ++seed)
          mean.add(over_directions(render_chains(job, 4560 + seed).image));
      } else {
        const TestScene scene = with_integrator(plain, one.integrator, settings);
        for (const auto& image : render_batches(scene, 4580, 12, one.iterations * effort))
          mean.add(over_directions(image));
      }
      const double q = ratio * ratio, bias = mean.mean() / exact - 1, error = mean.error() / exact;
      const auto preset = one.settings.find("preset");
      std::printf("%s %s r/l %.2f: predicted %.4f, measured %.4f +- %.4f\n", one.integrator.c_str(),
                  preset == one.settings.end() ? "" : preset->second.c_str(), ratio, -q / 4, bias, error);
      EXPECT_NEAR(bias, -q / 4, 5 * error + q * q / 2) << one.integrator << " " << ratio;
      EXPECT_LT(error, long_form() ? 0.05 : 0.06) << one.integrator << " " << ratio;
    }
  }
}

}  // namespace
}  // namespace candela::statistical
