// Energy under edits of light transport. Each of the two comparisons alarms falsely with probability at most
// 1e-5 (block_tests.h).
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

// Claim: in a closed box whose surfaces all emit 1 and scatter 0.6 of what arrives there is the same light
// everywhere, and it stays so if mirrors send light on, and gather it, turned about their normals.
TEST(EditedBox, IsAsItWas) {
  std::string walls;
  const auto wall = [&](const std::string& id, const std::string& turn, const std::string& bsdf) {
    walls += R"(<shape type="rectangle" id=")" + id + R"("><transform name="to_world"><translate z="-1"/>)" +
             turn + "</transform>" + bsdf +
             R"(<emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>)";
  };
  const std::string
      matt = R"(<bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf>)",
      mirror =
          R"(<bsdf type="conductor"><string name="material" value="none"/><rgb name="specular_reflectance" value="0.6"/></bsdf>)";
  wall("back", "", mirror);
  wall("front", R"(<rotate y="1" angle="180"/>)", matt);
  wall("left", R"(<rotate y="1" angle="90"/>)", mirror);
  wall("right", R"(<rotate y="1" angle="-90"/>)", matt);
  wall("floor", R"(<rotate x="1" angle="-90"/>)", matt);
  wall("ceiling", R"(<rotate x="1" angle="90"/>)", matt);
  const std::string xml =
      R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="6"/></integrator>
    <sensor type="perspective"><float name="fov" value="90"/>
      <transform name="to_world"><lookat origin="0.3, 0.1, 0.4" target="-0.5, -0.2, -0.6" up="0, 1, 0"/></transform></sensor>)" +
      walls + "</scene>";
  const std::string edits = R"({"edits": [
      {"name": "a", "direction": "light", "select": "LX*S{left}", "rotate": {"axis": [1, 0, 0], "degrees": 40}},
      {"name": "b", "direction": "eye", "select": "S{back}X*E", "rotate": {"axis": [0, 0, 1], "degrees": 25}}]})";
  constexpr std::uint32_t kSize = 16;
  const Regions regions(kSize, kSize, 4);
  const double radiance = (1 - std::pow(0.6, 6)) / 0.4;
  const std::vector<double> means = regions.means(std::vector<double>(kSize * kSize * 3, radiance));
  const Estimator exact{"series", [means](std::uint64_t, double) { return Rows(4, means); }};
  for (const char* integrator : {"path", "bdpt"}) {
    TestScene scene = with_integrator(scene_from_xml(xml, kSize, kSize), integrator);
    scene.settings.edits = edits;
    const Estimator tested =
        make_estimator(integrator, {{1, scene}}, {.seed = 6, .batches = 12, .iterations = 32}, regions);
    const Verdict verdict = compare(tested, exact, regions, {});
    EXPECT_TRUE(verdict.agree) << verdict.report;
    EXPECT_GT(verdict.tested, regions.values() / 2) << verdict.report;
    EXPECT_LT(verdict.detectable_whole, 0.02) << verdict.report;
  }
}

}  // namespace
}  // namespace candela::statistical
