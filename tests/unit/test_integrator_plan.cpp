// The plan says what a kernel leaves out, and why.
#include <gtest/gtest.h>

#include "tests/unit/scene_fixture.h"
#include "tests/unit/volume_file.h"
#include "worker/render/renderer.h"

namespace candela::render {
namespace {

std::string plan_of(const std::string& body) {
  const test::TextFiles files(
      {{"scene.xml", "<scene version=\"3.0.0\"><integrator type=\"path\"/><sensor type=\"perspective\"/>" +
                         body + "</scene>"},
       {"v.vol", test::volume_file({1, 1, 1}, 1, {1})}});
  const auto settings = complete_integrator_settings("path", {}, {});
  EXPECT_TRUE(settings.ok());
  JobSettings job;
  job.width = job.height = 4;
  job.integrator_settings = *settings;
  const auto renderer = Renderer::create(files, "scene.xml", {}, job, 1);
  EXPECT_TRUE(renderer.ok()) << renderer.error().to_string();
  return renderer.ok() ? (*renderer)->plan_text() : std::string();
}

bool says(const std::string& plan, const std::string& line) {
  return plan.find(line + "\n") != std::string::npos;
}

// Claim: media and straight passes run only where the scene has them, and a scene of nothing but glass and
// fog samples light from the fog.
TEST(IntegratorPlan, LeavesOutMediaAndStraightPasses) {
  const std::string lamp = "<shape type=\"sphere\"><emitter type=\"area\"/></shape>";
  const std::string plain = plan_of(lamp + "<shape type=\"cube\"/>");
  EXPECT_TRUE(says(plain, "skip media: there is none")) << plain;
  EXPECT_TRUE(says(plain, "skip light through surfaces straight on: no surface lets light pass straight"))
      << plain;
  const std::string mask =
      plan_of(lamp + "<shape type=\"cube\"><bsdf type=\"mask\"><bsdf type=\"diffuse\"/></bsdf></shape>");
  EXPECT_TRUE(says(mask, "skip media: there is none")) << mask;
  EXPECT_TRUE(
      says(mask, "use  light through surfaces straight on: some surface is null, a mask or thin glass"))
      << mask;
  const std::string fog = plan_of(lamp +
                                  "<shape type=\"cube\"><bsdf type=\"dielectric\"/><medium name=\"interior\" "
                                  "type=\"homogeneous\"/></shape>");
  EXPECT_TRUE(says(fog, "use  media: homogeneous: free flights and transmittance in closed form")) << fog;
  EXPECT_TRUE(
      says(fog, "use  next event estimation: emitters can be sampled from points in media and from surfaces"))
      << fog;
  EXPECT_TRUE(says(fog, "media: 1")) << fog;
  const std::string cloud = plan_of(
      lamp +
      "<shape type=\"cube\"><medium name=\"interior\" type=\"heterogeneous\"><volume name=\"sigma_t\" "
      "type=\"gridvolume\"><string name=\"filename\" value=\"v.vol\"/></volume></medium></shape>");
  EXPECT_TRUE(
      says(cloud, "use  media: free flights by delta tracking, transmittance by residual ratio tracking"))
      << cloud;
  EXPECT_TRUE(says(cloud, "media: 1, not all homogeneous")) << cloud;
}

}  // namespace
}  // namespace candela::render
