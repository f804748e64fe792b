// Claims: the perspective sensor is Mitsuba's: x to the left, fields of view by axis and focal length, clip
// planes, principal point; mistakes are named.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/unit/scene_fixture.h"

namespace candela::scene {
namespace {

Result<Ray> ray_of(const std::string& properties, float x, float y, std::uint32_t width = 200,
                   std::uint32_t height = 100) {
  Scene::Options options;
  options.film_width = width;
  options.film_height = height;
  auto scene = test::build_scene("", {}, "<sensor type=\"perspective\">" + properties + "</sensor>", options);
  if (!scene.ok()) return scene.error();
  float weight = 0;
  const Ray ray = (*scene)->camera_ray(x, y, {0.5f, 0.5f}, weight);
  EXPECT_EQ(weight, 1.0f);
  return ray;
}

float tan_x(const std::string& properties, std::uint32_t width = 200, std::uint32_t height = 100) {
  const auto ray = ray_of(properties, 0, static_cast<float>(height) / 2, width, height);
  EXPECT_TRUE(ray.ok()) << ray.error().to_string();
  return ray->direction.x / ray->direction.z;
}

constexpr const char* kFov90 = "<float name=\"fov\" value=\"90\"/>";

TEST(PerspectiveSensor, LooksAlongZWithXToTheLeftAndYUp) {
  const auto top_left = ray_of(kFov90, 0, 0);
  ASSERT_TRUE(top_left.ok());
  EXPECT_NEAR(top_left->direction.x / top_left->direction.z, 1, 1e-6f);
  EXPECT_NEAR(top_left->direction.y / top_left->direction.z, 0.5f, 1e-6f);
  const auto middle = ray_of(kFov90, 100, 50);
  EXPECT_NEAR(middle->direction.z, 1, 1e-7f);
}

TEST(PerspectiveSensor, MeasuresTheFieldOfViewAsAsked) {
  const std::string fov = kFov90;
  const auto axis = [&](const char* name) {
    return fov + "<string name=\"fov_axis\" value=\"" + name + "\"/>";
  };
  EXPECT_NEAR(tan_x(fov), 1, 1e-6f);
  EXPECT_NEAR(tan_x(axis("y")), 2, 1e-6f);
  EXPECT_NEAR(tan_x(axis("smaller")), 2, 1e-6f);
  EXPECT_NEAR(tan_x(axis("larger")), 1, 1e-6f);
  EXPECT_NEAR(tan_x(axis("larger"), 100, 200), 0.5f, 1e-6f);
  EXPECT_NEAR(tan_x(axis("diagonal")), 2 / std::sqrt(5.0f), 1e-6f);
  // 50 mm: the diagonal of 36 x 24 is 43.27 mm.
  EXPECT_NEAR(tan_x("<string name=\"focal_length\" value=\"50mm\"/>", 300, 200), 18.0f / 50, 1e-6f);
  EXPECT_NEAR(tan_x("", 300, 200), 18.0f / 50, 1e-6f);
}

TEST(PerspectiveSensor, ClipsAndShifts) {
  const auto ray = ray_of(
      std::string(kFov90) + "<float name=\"near_clip\" value=\"2\"/><float name=\"far_clip\" value=\"5\"/>",
      0, 50);
  ASSERT_TRUE(ray.ok());
  EXPECT_NEAR(ray->origin.z, 2, 1e-6f);  // planes, not spheres
  EXPECT_NEAR((ray->origin + ray->direction * ray->t_max).z, 5, 1e-5f);
  const auto shifted =
      ray_of(std::string(kFov90) + "<float name=\"principal_point_offset_x\" value=\"0.25\"/>", 50, 50);
  EXPECT_NEAR(shifted->direction.x, 0, 1e-6f);
}

// What a description alone cannot tell is refused here; its own checks name the rest.
TEST(PerspectiveSensor, RefusesScale) {
  const auto ray =
      ray_of(std::string(kFov90) + "<transform name=\"to_world\"><scale value=\"2\"/></transform>", 0, 0);
  ASSERT_FALSE(ray.ok());
  EXPECT_EQ(ray.error().message, "a camera's to_world must not scale");
  EXPECT_EQ(ray.error().line, 2);
  for (const char* bad :
       {"<float name=\"fov\" value=\"180\"/>", "<float name=\"fov\" value=\"0\"/>",
        "<float name=\"fov\" value=\"9\"/><string name=\"focal_length\" value=\"50mm\"/>",
        "<string name=\"focal_length\" value=\"long\"/>", "<string name=\"focal_length\" value=\"-5mm\"/>",
        "<float name=\"near_clip\" value=\"3\"/><float name=\"far_clip\" value=\"2\"/>",
        "<float name=\"near_clip\" value=\"0\"/>"}) {
    EXPECT_FALSE(ray_of(bad, 0, 0).ok()) << bad;
  }
}

}  // namespace
}  // namespace candela::scene
