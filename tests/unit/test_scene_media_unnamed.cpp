// Media that a scene does not name where a camera or an emitter stands.
#include <gtest/gtest.h>

#include "tests/unit/scene_fixture.h"

namespace candela::scene {
namespace {

using test::build_scene;

// Claim: a camera or an emitter inside a medium it does not name is in that medium all the same, so that
// walks from either end agree.
TEST(SceneMedia, UnnamedMediaAreFound) {
  const auto scene = build_scene(
      "<medium id=\"fog\" type=\"homogeneous\"/>"
      "<shape type=\"sphere\"><float name=\"radius\" value=\"30\"/><bsdf type=\"null\"/>"
      "<ref name=\"interior\" id=\"fog\"/></shape>"
      "<shape type=\"sphere\"><point name=\"center\" x=\"0\" y=\"0\" z=\"3\"/></shape>"
      "<emitter type=\"point\"/><emitter type=\"constant\"/>");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  const Scene& s = **scene;
  EXPECT_EQ(s.camera_medium(), 0u);
  EmissionSample light;
  light.vertex.emitter = 0;
  light.ray = {{0, 0, 0}, {0, 0, 1}};  // behind the ball, which knows no medium, there is the fog's border
  EXPECT_EQ(s.emitter_medium(light), 0u);
  light.ray = {{0, 0, 40}, {0, 0, -1}};
  EXPECT_EQ(s.emitter_medium(light), kNone);
  light.infinite = true;
  light.vertex.emitter = 1;
  EXPECT_EQ(s.emitter_medium(light), kNone);
}

}  // namespace
}  // namespace candela::scene
