// Chains that mollify, in a scene of mollified light alone: whole jobs against a closed form.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/regularised_scenes.h"
#include "tests/statistical/chain_driver.h"
#include "tests/statistical/moments.h"
#include "worker/scene/features.h"

namespace candela::statistical {
namespace {

struct Method {
  std::string integrator;
  SettingsMap settings;
  double length;  // of the edge whose end is mollified
};

// Claim: chains over a lamp that is seen over two mirrors, for which no technique has a path, show the flux
// of the lamp's image: path tracing mollifies the mirror at the lamp, bidirectional path tracing and mmlt
// that at the eye. b is the mean of the image. The bias is a quarter of (r / l)^2, and the disc's spread over
// the flat film at most one per cent more.
TEST(RegularisedChains, LampOverTwoMirrors) {
  constexpr double r = 0.15;
  const double half = std::tan(15 * std::numbers::pi / 180);
  const test::SceneText text = test::scene_t(30);
  const TestScene plain = scene_from_xml(
      "<scene version=\"3.0.0\"><integrator type=\"path\"/>" + text.sensor + text.body + "</scene>", 16, 16);
  const double radius = static_cast<double>(make_renderer(plain)->features()->radius);
  for (const Method& method :
       {Method{"pssmlt", {}, test::SceneT::kBeforeA},
        Method{"pssmlt", {{"over", "path"}}, test::SceneT::kBeforeB},
        // Most states have another length or technique.
        Method{"mmlt", {{"bootstrap", "100000"}, {"mutations", "256"}}, test::SceneT::kBeforeA}}) {
    SettingsMap settings = method.settings;
    settings.insert({{"regularise", "on"},
                     {"regularise_radius", std::to_string(r / radius)},
                     {"regularise_exponent", "0"},
                     {"max_depth", "3"},
                     {"chains", "40"},
                     {"bootstrap", "20000"},
                     {"mutations", "64"}});  // a method's own win
    ChainJob job;
    job.scene = with_integrator(plain, method.integrator, settings);
    job.rounds = 2;
    Moments image, b;
    for (std::uint64_t seed = 0; seed < 8; ++seed) {
      const ChainImage one = render_chains(job, 45 + seed);
      double sum = 0;
      for (std::size_t i = 0; i < one.image.size(); i += 3) sum += one.image[i + 1];
      image.add(sum / (static_cast<double>(one.width) * one.height));
      b.add(one.b.b);
    }
    const double q = r * r / (method.length * method.length), flux = 5 / (3.4 * 3.4) * (1 - q / 4);
    const double expected = flux / (4 * half * half);
    EXPECT_NEAR(image.mean(), expected, 6 * image.error() + 0.015 * expected)
        << method.integrator << " +- " << image.error();
    EXPECT_LT(image.error(), 0.06 * expected) << method.integrator;
    EXPECT_NEAR(image.mean() / b.mean(), 1, 0.02) << method.integrator;
  }
}

}  // namespace
}  // namespace candela::statistical
