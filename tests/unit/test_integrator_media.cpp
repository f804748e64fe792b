// Media without an end.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "tests/integrators.h"
#include "tests/unit/renderer_fixture.h"

namespace candela::render {
namespace {

// The largest sum in the film of a floor in fog that nothing bounds.
std::int64_t brightest(const std::string& integrator, const std::string& emitter, double sigma_t) {
  const test::TextFiles files({{"scene.xml", fmt::format(R"(<scene version="3.0.0"><integrator type="path"/>
<medium id="fog" type="homogeneous"><rgb name="sigma_t" value="{0}"/><rgb name="albedo" value="0.8"/></medium>
<sensor type="perspective"><float name="fov" value="60"/><ref id="fog"/></sensor>
<shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate y="1" angle="180"/>
<translate z="2"/></transform></shape>{1}</scene>)",
                                                         sigma_t, emitter)}});
  JobSettings job;
  job.integrator = integrator;
  job.width = job.height = 8;
  SettingsMap chosen = {{"max_depth", "5"}, {"plan", "full"}};
  if (integrator == "ppm" || integrator == "bpm") chosen["radius"] = "0.2";  // a few thousand photons
  const auto renderer = test::make_renderer(files, job, chosen);
  const auto film = test::render_film(*renderer, 64);
  std::int64_t most = 0;
  for (std::size_t i = 0; i < 8 * 8 * 3; ++i) most = std::max<std::int64_t>(most, film->sums()[i]);
  return most;
}

// Claim: no light from outside gets through a medium that has no end, by any technique; a light inside does,
// and so does that from outside where the medium takes nothing.
TEST(IntegratorMedia, LightFromOutsideDoesNotGetThroughEndlessFog) {
  for (const std::string& integrator : test::iteration_integrators_in_media()) {
    if (test::has_epochs(integrator)) continue;  // the same walks, with a state
    SCOPED_TRACE(integrator);
    for (const char* outside :
         {"<emitter type=\"directional\"><vector name=\"direction\" x=\"0\" y=\"0\" z=\"1\"/></emitter>",
          "<emitter type=\"constant\"/>"}) {
      EXPECT_EQ(brightest(integrator, outside, 0.1), 0) << outside;
      EXPECT_GT(brightest(integrator, outside, 0), 0) << outside;
    }
    EXPECT_GT(brightest(integrator, "<emitter type=\"point\"/>", 0.1), 0);
  }
}

}  // namespace
}  // namespace candela::render
