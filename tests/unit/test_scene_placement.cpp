// Scenes far from the origin: they are moved to their own middle before anything is rounded, and are the same
// scene there. Points of the file's coordinates are hit.p + scene.offset().
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "tests/unit/scene_fixture.h"
#include "worker/scene/placement.h"

namespace candela::scene {
namespace {

std::string at(const Vec3d& base, double x, double y, double z) {
  return fmt::format("{:.17g}, {:.17g}, {:.17g}", base.x + x, base.y + y, base.z + z);
}
std::string placed(const Vec3d& base, double x, double y, double z, const std::string& before = "") {
  return fmt::format("<transform name='to_world'>{}<translate value='{}'/></transform>", before,
                     at(base, x, y, z));
}
std::string row(const Vec3d& base, double x, double y, double z) {
  return fmt::format("{:.17g} {:.17g} {:.17g}\n", base.x + x, base.y + y, base.z + z);
}

// A tilted square about (x, y, z) as OBJ or PLY text.
std::string obj_square(const Vec3d& base, double x, double y, double z) {
  return "v " + row(base, x - 0.5, y, z - 0.5) + "v " + row(base, x + 0.5, y, z - 0.5) + "v " +
         row(base, x + 0.5, y + 0.3, z + 0.5) + "v " + row(base, x - 0.5, y + 0.3, z + 0.5) + "f 1 2 3 4\n";
}
std::string ply_square(const Vec3d& base, double x, double y, double z) {
  return "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n"
         "element face 1\nproperty list uchar int vertex_indices\nend_header\n" +
         row(base, x - 0.5, y, z - 0.5) + row(base, x + 0.5, y, z - 0.5) +
         row(base, x + 0.5, y + 0.3, z + 0.5) + row(base, x - 0.5, y + 0.3, z + 0.5) + "4 0 1 2 3\n";
}

// One of each: all quadrics, mesh files in text, an instance, and a group whose own space is as far away.
Result<std::unique_ptr<Scene>> build_at(const Vec3d& base, bool in_place = false) {
  const std::string body =
      "<shape type='sphere'><point name='center' value='" + at(base, -1, 0.5, 0) +
      "'/><float name='radius' value='0.5'/></shape>"
      "<shape type='sphere'>" +
      placed(base, 1, 0.5, 1, "<scale x='0.5' y='0.2' z='0.3'/>") +
      "</shape><shape type='cylinder'><point name='p0' value='" + at(base, 1, 0, 0) +
      "'/><point name='p1' value='" + at(base, 1.2, 1, 0.1) +
      "'/><float name='radius' value='0.2'/></shape>"
      "<shape type='disk'>" +
      placed(base, 0, 1.5, 0, "<rotate x='1' angle='70'/>") + "</shape><shape type='rectangle'>" +
      placed(base, 0, 0, 0, "<scale value='4'/><rotate x='1' angle='-90'/>") +
      "</shape><shape type='obj'><string name='filename' value='a.obj'/></shape>"
      "<shape type='ply'><string name='filename' value='a.ply'/><boolean name='face_normals' value='true'/>"
      "</shape>"
      "<shape type='shapegroup' id='near'><shape type='cube'><transform name='to_world'><scale value='0.2'/>"
      "</transform></shape></shape><shape type='instance'><ref id='near'/>" +
      placed(base, 0.3, 0.6, -1.5, "<rotate y='1' angle='30'/>") +
      "</shape><shape type='shapegroup' id='far'><shape type='obj'><string name='filename' value='b.obj'/>"
      "</shape><shape type='cube'>" +
      placed(base, -2, 2.5, 1, "<scale value='0.2'/>") +
      "</shape></shape><shape type='instance'><ref id='far'/></shape>"
      "<emitter type='point'><point name='position' value='" +
      at(base, 0.5, 3, 0.5) + "'/></emitter><emitter type='spot'>" + placed(base, 0, 3, -2) + "</emitter>";
  const std::string sensor =
      "<sensor type='perspective'><float name='fov' value='60'/>"
      "<transform name='to_world'><lookat origin='" +
      at(base, 0, 1.5, 5) + "' target='" + at(base, 0, 0.5, 0) + "' up='0, 1, 0'/></transform></sensor>";
  Scene::Options options;
  options.in_place = in_place;
  options.film_width = options.film_height = 64;
  return test::build_scene(body,
                           {{"a.obj", obj_square(base, -0.5, 1, 1)},
                            {"a.ply", ply_square(base, 2, 1, -1)},
                            {"b.obj", obj_square(base, -2, 2, -1)}},
                           sensor, options);
}

const Vec3d kFarAway = {0.8e5, 0.36e5, -0.48e5};
const Vec3d kMap = {4.47e6, 312.25, -5.29e6};  // meters of a map's grid

double distance_of(const Vec3d& a, const Vec3d& b) {
  return length(a - b);
}

// Claim: camera rays of a scene of 5 units at 1e5 and 7e6 from the origin meet what they meet near the
// origin, within 1e-5, and the same primitives; left in place they do not.
TEST(Placement, SceneIsTheSameFarAway) {
  const auto here = build_at({});
  ASSERT_TRUE(here.ok()) << here.error().to_string();
  EXPECT_EQ((*here)->offset(), Vec3d{});
  for (const Vec3d& base : {kFarAway, kMap}) {
    const auto there = build_at(base);
    ASSERT_TRUE(there.ok()) << there.error().to_string();
    EXPECT_LT(distance_of((*there)->offset(), base), 8);
    int met = 0, other = 0;
    for (int i = 0; i < 64 * 64; ++i) {
      float weight = 0;
      const float x = static_cast<float>(i % 64) + 0.37f, y = static_cast<float>(i / 64) + 0.61f;
      const Ray a = (*here)->camera_ray(x, y, {}, weight), b = (*there)->camera_ray(x, y, {}, weight);
      ASSERT_LT(distance_of(Vec3d(a.direction), Vec3d(b.direction)), 1e-6);
      SurfaceHit p, q;
      const bool hit = (*here)->intersect(a, p);
      if (hit != (*there)->intersect(b, q) || (hit && p.shape != q.shape)) {
        ++other;  // at outlines
        continue;
      }
      if (!hit) continue;
      ++met;
      EXPECT_LT(distance_of(Vec3d(p.p), Vec3d(q.p) + (*there)->offset() - base), 2e-5) << i;
      EXPECT_LT(distance_of(Vec3d(p.ng), Vec3d(q.ng)), 2e-4) << i;
    }
    EXPECT_GT(met, 2500);
    EXPECT_LE(other, 3);
  }
}

// Claim: the test above can fail: left in place, the scene is another one.
TEST(Placement, LeftInPlaceTheSceneChanges) {
  const auto here = build_at({}), there = build_at(kFarAway, true);
  ASSERT_TRUE(here.ok() && there.ok());
  EXPECT_EQ((*there)->offset(), Vec3d{});
  double worst = 0;
  for (int i = 0; i < 64 * 64; ++i) {
    float weight = 0;
    const float x = static_cast<float>(i % 64) + 0.37f, y = static_cast<float>(i / 64) + 0.61f;
    SurfaceHit p, q;
    if (!(*here)->intersect((*here)->camera_ray(x, y, {}, weight), p) ||
        !(*there)->intersect((*there)->camera_ray(x, y, {}, weight), q) || p.shape != q.shape)
      continue;
    worst = std::max(worst, distance_of(Vec3d(p.p), Vec3d(q.p) - kFarAway));
  }
  EXPECT_GT(worst, 2e-3);
}

// Claim: lights at a place are as far and as bright.
TEST(Placement, LightsMoveAlong) {
  const auto here = build_at({}), there = build_at(kMap);
  ASSERT_TRUE(here.ok() && there.ok());
  for (const float select : {0.2f, 0.7f}) {
    DirectSample a, b;
    const Vec3 p = {0.25f, 0.5f, -1};
    const Vec3d moved_p = Vec3d(p) + kMap - (*there)->offset();
    const auto first = (*here)->sample_direct(test::point_reference(p), {}, select, {0.5f, 0.5f}, a);
    ASSERT_EQ(first,
              (*there)->sample_direct(test::point_reference(Vec3(moved_p)), {}, select, {0.5f, 0.5f}, b));
    ASSERT_EQ(first, DirectOutcome::sampled);
    EXPECT_LT(distance_of(Vec3d(a.wi), Vec3d(b.wi)), 1e-6);
    EXPECT_NEAR(a.radiance.g / b.radiance.g, 1, 1e-5);
  }
}

// Claim: what lies near the origin stays there: scenes, and groups in their own space. A camera counts.
TEST(Placement, NearScenesStay) {
  const auto offset_of = [](const std::string& body, const std::string& sensor = "") {
    const auto scene = test::build_scene(body, {}, sensor);
    EXPECT_TRUE(scene.ok()) << scene.error().to_string();
    return scene.ok() ? (*scene)->offset() : Vec3d{1, 1, 1};
  };
  const auto ball = [](double z, double r) {
    return fmt::format(
        "<shape type='sphere'><point name='center' x='0' y='0' z='{}'/>"
        "<float name='radius' value='{}'/></shape>",
        z, r);
  };
  EXPECT_EQ(offset_of(ball(10, 1)), Vec3d{});
  EXPECT_EQ(offset_of(ball(1000, 1)), Vec3d{});  // the camera is at the origin
  const std::string camera =
      "<sensor type='perspective'><transform name='to_world'><translate z='995'/>"
      "</transform></sensor>";
  EXPECT_NE(offset_of(ball(1000, 1), camera), Vec3d{});
  EXPECT_FALSE(middle_if_far({{-1, -1, -1}, {20, 20, 20}}));
  const auto middle = middle_if_far({{99990, -3, 7}, {100010, 3, 9}});
  ASSERT_TRUE(middle);
  EXPECT_EQ(*middle, (Vec3d{100000, 0, 8}));
}

// Claim: of a description all that has a place moves by the same vector, also what is below a bsdf; what has
// none is shared with the original.
TEST(Placement, AllThatHasAPlaceMoves) {
  const std::string text = R"(<scene version="3.0.0">
    <sensor type="perspective"><transform name="to_world"><translate x="3"/></transform></sensor>
    <emitter type="point"><point name="position" x="1" y="2" z="3"/></emitter>
    <emitter type="directional"/>
    <emitter type="sky"/>
    <bsdf type="diffuse" id="plain"/>
    <shape type="sphere"><ref id="plain"/>
      <medium type="heterogeneous" name="interior"><volume type="gridvolume" name="sigma_t">
        <string name="filename" value="v.vol"/><transform name="to_world"><scale value="2"/></transform>
      </volume></medium></shape>
    <shape type="sphere"><bsdf type="diffuse"><texture type="volume" name="reflectance">
      <volume type="gridvolume" name="volume"><string name="filename" value="v.vol"/></volume>
    </texture></bsdf></shape></scene>)";
  const test::TextFiles files({{"scene.xml", text}, {"v.vol", ""}});
  const auto read = description::parse_scene(files, "scene.xml", {});
  ASSERT_TRUE(read.ok()) << read.error().to_string();
  const description::ObjectPtr before = read->scene, after = moved(before, {{10, 20, 30}, {}});
  const auto shift = [](const description::Object& object) {
    const description::Mat4 m = object.get_transform("to_world");
    return Vec3d{m[3], m[7], m[11]};
  };
  const auto child = [](const description::ObjectPtr& object, const char* category, std::size_t i = 0) {
    return object->children_of(category).at(i);
  };
  EXPECT_EQ(shift(*child(after, "sensor")), (Vec3d{-7, -20, -30}));
  EXPECT_EQ(child(after, "emitter")->get_vec3("position", {}), (description::Vec3{-9, -18, -27}));
  EXPECT_EQ(child(after, "emitter", 1), child(before, "emitter", 1));
  EXPECT_EQ(child(after, "emitter", 2), child(before, "emitter", 2));
  EXPECT_EQ(shift(*child(after, "shape")), (Vec3d{-10, -20, -30}));
  EXPECT_EQ(child(child(after, "shape"), "bsdf"), child(child(before, "shape"), "bsdf"));
  const auto volume = child(child(child(after, "shape"), "medium"), "volume");
  EXPECT_EQ(shift(*volume), (Vec3d{-10, -20, -30}));
  EXPECT_EQ(volume->get_transform("to_world")[0], 2);
  const auto texture = child(child(child(after, "shape", 1), "bsdf"), "texture");
  EXPECT_EQ(shift(*child(texture, "volume")), (Vec3d{-10, -20, -30}));
}

// Claim: things too small for floats far away, which could not even be read there, are read.
TEST(Placement, SmallThingsFarAwayAreRead) {
  const Vec3d base = kMap;
  std::string tiny =
      "v " + row(base, 0, 0, 0) + "v " + row(base, 0.01, 0, 0) + "v " + row(base, 0, 0.01, 0) + "f 1 2 3\n";
  const std::string sensor = "<sensor type='perspective'><transform name='to_world'><lookat origin='" +
                             at(base, 0.003, 0.003, 0.05) + "' target='" + at(base, 0.003, 0.003, 0) +
                             "' up='0, 1, 0'/></transform></sensor>";
  const auto scene = test::build_scene("<shape type='obj'><string name='filename' value='a.obj'/></shape>",
                                       {{"a.obj", tiny}}, sensor);
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  float weight = 0;
  SurfaceHit hit;
  ASSERT_TRUE((*scene)->intersect((*scene)->camera_ray(0.5f, 0.5f, {}, weight), hit));
  EXPECT_NEAR(hit.distance, 0.04f, 1e-5f);  // from the near plane
  EXPECT_NEAR((Vec3d(hit.p) + (*scene)->offset()).x, base.x + 0.003, 1e-6);
}

}  // namespace
}  // namespace candela::scene
