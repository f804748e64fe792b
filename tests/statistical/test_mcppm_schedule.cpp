// mcppm with radii that fall over the job, against ppm with the same radii.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"
#include "tests/statistical/moments.h"

namespace candela::statistical {
namespace {

// Films decide this test: proofs.h.
const proofs::FilmsDecide kFilms({"McppmSchedule"});

// A floor under a sky and a sun, of which the camera sees a small part.
constexpr const char* kScene = R"(<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="6"/></integrator>
  <sensor type="perspective"><float name="fov" value="50"/>
    <transform name="to_world"><lookat origin="0, 2, 2" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
  <shape type="rectangle"><transform name="to_world"><scale value="6"/><rotate x="1" angle="-90"/></transform></shape>
  <shape type="sphere"><point name="center" x="0.2" y="0.3" z="0"/><float name="radius" value="0.3"/>
    <bsdf type="dielectric"/></shape>
  <emitter type="constant"><rgb name="radiance" value="0.3, 0.4, 0.5"/></emitter>
  <emitter type="directional"><vector name="direction" x="0.4" y="-1" z="0.3"/>
    <rgb name="irradiance" value="3, 3, 2"/></emitter></scene>)";

// Claim: with radii that fall over the job the mean of its iterations is that of ppm with the same radii,
// although the visible fraction falls with them: each iteration has its own. One fraction for all iterations
// would make 10 % more. [metropolis-photons note, section 7]
TEST(McppmSchedule, MeanOfManyIterationsIsThatOfPpm) {
  const std::uint64_t iterations = long_form() ? 1000 : 100, jobs = 24;
  const SettingsMap both = {{"radius", "0.02"}, {"light_paths", "48"}};
  SettingsMap own = both;
  own.insert({{"plan", "full"}, {"epoch_min", "8"}});
  const TestScene scene = scene_from_xml(kScene, 8, 8), mcppm = with_integrator(scene, "mcppm", own),
                  ppm = with_integrator(scene, "ppm", both);
  const auto brightness = [&](const TestScene& of, std::uint64_t seed, std::uint32_t half,
                              std::uint64_t count) {
    const auto layers = render_layers(of, pilot_state(of), seed, half, 0, count);
    double sum = 0;
    for (const double value : layers[0]) sum += value;
    return sum / static_cast<double>(layers[0].size());
  };
  Moments with_chains, without;
  for (std::uint64_t job = 0; job < jobs; ++job) {
    with_chains.add(brightness(mcppm, 5100 + job, 0, iterations));
    // Iterations 0 to n - 1 are the first of both halves.
    without.add(
        (brightness(ppm, 5200 + job, 0, iterations / 2) + brightness(ppm, 5200 + job, 1, iterations / 2)) /
        2);
  }
  const double error = std::hypot(with_chains.error(), without.error());
  std::printf("%llu iterations: with chains %.4f +- %.4f, ppm %.4f +- %.4f\n",
              static_cast<unsigned long long>(iterations), with_chains.mean(), with_chains.error(),
              without.mean(), without.error());
  EXPECT_NEAR(with_chains.mean(), without.mean(), 4.5 * error);
  EXPECT_LT(error, 0.022 * without.mean());
}

}  // namespace
}  // namespace candela::statistical
