// Claims: where surfaces of several shapes lie in one plane over each other, a ray meets the shape that comes
// first, whatever the last bits of distances are; what does not share a plane, or only an edge, is left to
// Embree.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "tests/unit/scene_fixture.h"
#include "worker/scene/accel.h"
#include "worker/scene/ties.h"

namespace candela::scene {
namespace {

// The shapes of a scene's `body`, in their order.
Geometry geometry_of(const std::string& body) {
  const test::TextFiles files({{"scene.xml", "<scene version=\"3.0.0\">" + body + "</scene>"}});
  const auto read = description::parse_scene(files, "scene.xml", {});
  EXPECT_TRUE(read.ok()) << read.error().to_string();
  Geometry geometry;
  for (const description::ObjectPtr& object : read->scene->children_of("shape")) {
    auto shape = build_shape(*object, files);
    EXPECT_TRUE(shape.ok()) << shape.error().to_string();
    geometry.add(std::move(shape).value(), {});
  }
  geometry.finish();
  return geometry;
}

std::string transform(const std::string& steps) {
  return "<transform name=\"to_world\">" + steps + "</transform>";
}
std::string rectangle(const std::string& steps) {
  return "<shape type=\"rectangle\">" + transform(steps) + "</shape>";
}

constexpr Vec3 kMiddle{0.7f, 0, 3};
// A turn about the origin that leaves no normal along an axis.
constexpr const char* kTilt =
    "<rotate x=\"1\" y=\"0.3\" z=\"-0.5\" angle=\"37\"/><translate x=\"0.7\" z=\"3\"/>";

std::size_t contested(const std::string& body) {
  return find_contested(geometry_of(body)).size();
}

// Rays meet the first of the shapes of `body`, which all lie over each other in one plane around kMiddle.
void expect_first_shape(const std::string& body) {
  const Geometry geometry = geometry_of(body);
  for (const char* isa : {"sse2", "avx2"}) {
    auto accel = Accel::build(geometry, isa, 1);
    ASSERT_TRUE(accel.ok()) << accel.error().to_string();
    rng::Stream stream(rng::key(1, 7));
    int tested = 0;
    for (int i = 0; i < 20000; ++i) {
      const Vec3 target = kMiddle + test::uniform_direction(stream) * (0.05f * stream.next_float());
      const Vec3 origin = target + test::uniform_direction(stream) * (0.5f + 4 * stream.next_float());
      const Ray ray{origin, normalize(target - origin)};
      Accel::Found found{};
      if (!accel->intersect(ray, found)) continue;
      SurfaceHit hit;
      geometry.hit(ray, found.kind, found.primitive, hit);
      if (length(hit.p - kMiddle) > 0.15f) continue;  // not all shapes are that large
      ++tested;
      const std::uint32_t shape = found.kind == PrimitiveKind::disk
                                      ? geometry.disks[found.primitive].shape
                                      : geometry.triangles[found.primitive].shape;
      ASSERT_EQ(shape, 0U) << isa << ", ray " << i;
    }
    EXPECT_GT(tested, 10000);
  }
}

TEST(Ties, TheFirstShapeIsMet) {
  const std::string small = rectangle(std::string("<scale x=\"0.31\" y=\"0.17\"/>") + kTilt);
  const std::string large =
      rectangle(std::string("<rotate z=\"1\" angle=\"33\"/><scale value=\"1.7\"/>") + kTilt);
  const std::string disk =
      "<shape type=\"disk\">" + transform(std::string("<scale value=\"0.9\"/>") + kTilt) + "</shape>";
  const std::string back =
      rectangle(std::string("<rotate y=\"1\" angle=\"180\"/><scale x=\"0.5\" y=\"0.3\"/>") + kTilt);
  expect_first_shape(small + large);
  expect_first_shape(large + small);
  expect_first_shape(back + disk + large + small);
  expect_first_shape(disk + small);
  expect_first_shape(small + disk);
}

// A box that stands on a floor.
TEST(Ties, OnlyWhatLiesOverAnotherShapeIsContested) {
  const std::string floor = rectangle("<rotate x=\"1\" angle=\"-90\"/><scale value=\"3\"/>");
  const auto cube = [](double x, double y) {
    return fmt::format("<shape type=\"cube\">{}</shape>",
                       transform(fmt::format("<scale value=\"0.25\"/><translate x=\"{}\" y=\"{}\"/>", x, y)));
  };
  EXPECT_EQ(contested(floor + cube(0, 0.25)), 4U) << "both triangles of the floor and of the cube's bottom";
  EXPECT_EQ(contested(floor + cube(0, 0.2501)), 0U) << "just above";
  EXPECT_EQ(contested(floor + cube(5, 0.25)), 0U) << "beside the floor";
  EXPECT_EQ(contested(cube(0, 0.25)), 0U) << "one shape alone";
  EXPECT_EQ(contested(cube(0, 0.25) + cube(0.5, 0.25)), 4U) << "side by side, they share a wall";
  const std::string tile = "<rotate x=\"1\" angle=\"-90\"/>";
  EXPECT_EQ(contested(rectangle(tile) + rectangle(tile + "<translate x=\"2\"/>")), 0U)
      << "an edge is no part";
}

// A box turned on a floor: no point of its bottom is missed, and what only its axis-aligned box covers costs
// no second look.
TEST(Ties, PlacesFollowTheOutline) {
  const Geometry geometry = geometry_of(
      rectangle("<rotate x=\"1\" angle=\"-90\"/><scale value=\"3\"/>") + "<shape type=\"cube\">" +
      transform(
          "<scale x=\"0.5\" y=\"0.25\" z=\"0.25\"/><rotate y=\"1\" angle=\"30\"/><translate y=\"0.25\"/>") +
      "</shape>");
  const float c = std::cos(math::kPi / 6), s = std::sin(math::kPi / 6);
  const auto on_floor = [&](float along, float across) {
    return Vec3{along * c + across * s, 0, across * c - along * s};
  };
  int places = 0;
  for (const Contested& contested : find_contested(geometry)) {
    if (contested.shape != 0) continue;  // the floor's triangles, each over the box's whole bottom
    for (const Place& place : contested.others) {
      ++places;
      for (const float along : {-0.5f, -0.2f, 0.0f, 0.5f})
        for (const float across : {-0.25f, 0.0f, 0.13f, 0.25f})
          EXPECT_TRUE(place.holds(on_floor(along, across))) << along << " " << across;
      EXPECT_FALSE(place.holds(on_floor(0.5f, 0.26f)));
      EXPECT_FALSE(place.holds(on_floor(-0.51f, 0)));
      EXPECT_FALSE(place.holds({0.5f, 0, 0.4f})) << "within the box around it";
    }
  }
  EXPECT_EQ(places, 2);
}

}  // namespace
}  // namespace candela::scene
