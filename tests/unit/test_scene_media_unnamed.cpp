// Media that a scene does not name where a camera or an emitter stands.
#include <gtest/gtest.h>

#include <stdexcept>
#include <utility>

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
  EXPECT_EQ(s.camera_medium({{0, 0, 0}, {0, 0, 1}}), 0u);
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

// Claim: a lens that stands in several media is in each of them where it is.
TEST(SceneMedia, ALensPartlyInFog) {
  const auto media_of = [](const std::string& sensor, const std::string& ball) {
    const auto scene = build_scene(
        "<shape type=\"sphere\"><bsdf type=\"null\"/><medium name=\"interior\" type=\"homogeneous\"/>" +
            ball + "</shape><emitter type=\"constant\"/>",
        {}, sensor);
    if (!scene.ok()) throw std::runtime_error(scene.error().to_string());
    std::pair<int, int> inside_and_out;
    for (int i = 0; i < 64; ++i) {
      float weight = 0;
      const Vec2 lens{(static_cast<float>(i % 8) + 0.5f) / 8, (static_cast<float>(i / 8) + 0.5f) / 8};
      const Ray ray = (*scene)->camera_ray(0.3f, 0.6f, lens, weight);
      ++((*scene)->camera_medium(ray) == kNone ? inside_and_out.second : inside_and_out.first);
      const bool inside = length(ray.origin - Vec3{1, 0, 0}) < 0.7f;
      if (ball.find("0.7") != std::string::npos) {
        EXPECT_EQ((*scene)->camera_medium(ray) != kNone, inside) << ray.origin.x << ' ' << ray.origin.y;
      }
    }
    return inside_and_out;
  };
  const std::string lens =
      "<sensor type=\"thinlens\"><float name=\"aperture_radius\" value=\"0.5\"/><float "
      "name=\"focus_distance\" "
      "value=\"3\"/></sensor>";
  const std::string beside =
      "<point name=\"center\" x=\"1\" y=\"0\" z=\"0\"/><float name=\"radius\" value=\"0.7\"/>";
  const auto partly = media_of(lens, beside);
  EXPECT_GT(partly.first, 5);
  EXPECT_GT(partly.second, 5);
  EXPECT_EQ(media_of(lens, "<float name=\"radius\" value=\"9\"/>"), std::make_pair(64, 0));
  EXPECT_EQ(media_of("<sensor type=\"perspective\"/>", beside), std::make_pair(0, 64));
}

}  // namespace
}  // namespace candela::scene
