// Claims: shapes come out of the description as Mitsuba documents them (sides, normals, parameterisation,
// transforms), and what cannot be built is one error naming file and line.
#include <gtest/gtest.h>

#include <tbb/task_arena.h>

#include <cmath>
#include <ctime>
#include <string>

#include "tests/unit/scene_fixture.h"
#include "worker/scene/shapes/geometry.h"

namespace candela::scene {
namespace {

using test::build_scene;
using test::matrix;

const std::string kTextured =
    "<bsdf type=\"diffuse\"><texture type=\"checkerboard\" name=\"reflectance\"/></bsdf>";

SurfaceHit shoot(const Scene& scene, Vec3 origin, Vec3 direction) {
  SurfaceHit hit;
  EXPECT_TRUE(scene.intersect({origin, normalize(direction)}, hit));
  return hit;
}

void expect_near(Vec3 a, Vec3 b, float tolerance = 1e-5f) {
  EXPECT_LT(length(a - b), tolerance)
      << a.x << " " << a.y << " " << a.z << ", not " << b.x << " " << b.y << " " << b.z;
}

TEST(SceneBuild, RectangleFacesAlongItsNormalUnderMirrorsToo) {
  const auto plain = build_scene("<shape type=\"rectangle\">" + kTextured + "</shape>");
  ASSERT_TRUE(plain.ok()) << plain.error().to_string();
  SurfaceHit hit = shoot(**plain, {0.5f, -0.25f, 3}, {0, 0, -1});
  expect_near(hit.ng, {0, 0, 1});
  expect_near(hit.shading.s, {1, 0, 0});
  EXPECT_NEAR(hit.uv.x, 0.75f, 1e-6f);
  EXPECT_NEAR(hit.uv.y, 0.375f, 1e-6f);
  EXPECT_NEAR(hit.distance, 3, 1e-6f);
  const auto mirrored =
      build_scene("<shape type=\"rectangle\">" + matrix({-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}) +
                  kTextured + "</shape>");
  hit = shoot(**mirrored, {0.5f, 0, 3}, {0, 0, -1});
  expect_near(hit.ng, {0, 0, 1});
  EXPECT_NEAR(hit.uv.x, 0.25f, 1e-6f);
  const auto flipped =
      build_scene("<shape type=\"rectangle\"><boolean name=\"flip_normals\" value=\"true\"/></shape>");
  expect_near(shoot(**flipped, {0, 0, 3}, {0, 0, -1}).ng, {0, 0, -1});
}

TEST(SceneBuild, CubeFacesOutwardsAndMapsEachFace) {
  for (const double mirror : {1.0, -1.0}) {
    const auto scene =
        build_scene("<shape type=\"cube\">" + matrix({mirror, 0, 0, 0, 0, 2, 0, 0, 0, 0, 3, 0, 0, 0, 0, 1}) +
                    kTextured + "</shape>");
    ASSERT_TRUE(scene.ok());
    for (const Vec3 d :
         {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}, Vec3{-1, 0, 0}, Vec3{0, -1, 0}, Vec3{0, 0, -1}}) {
      const SurfaceHit hit = shoot(**scene, d * 10 + Vec3{0.1f, 0.2f, 0.3f}, -d);
      expect_near(hit.ng, d);
      EXPECT_GT(hit.uv.x, 0.4f);
      EXPECT_LT(hit.uv.x, 0.61f);
    }
  }
}

TEST(SceneBuild, SphereHasMitsubasParameterisation) {
  const auto scene = build_scene(
      "<shape type=\"sphere\"><point name=\"center\" x=\"1\" y=\"2\" z=\"3\"/>"
      "<float name=\"radius\" value=\"0.5\"/>" +
      kTextured + "</shape>");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  SurfaceHit hit = shoot(**scene, {1, 12, 3}, {0, -1, 0});
  expect_near(hit.p, {1, 2.5f, 3});
  expect_near(hit.ng, {0, 1, 0});
  EXPECT_NEAR(hit.uv.x, 0.25f, 1e-5f);
  EXPECT_NEAR(hit.uv.y, 0.5f, 1e-5f);
  expect_near(hit.shading.s, {-1, 0, 0});
  hit = shoot(**scene, {1, 2, 3}, {0, 0, 1});  // from inside: the outside stays outside
  expect_near(hit.ng, {0, 0, 1});
  EXPECT_EQ(build_scene("<shape type=\"sphere\"><transform name=\"to_world\"><scale x=\"1\" y=\"2\" "
                        "z=\"1\"/></transform><emitter type=\"area\"/></shape>")
                .error()
                .message,
            "shape 'sphere': to_world scales unevenly or shears, which would make it an ellipsoid");
}

TEST(SceneBuild, DiskHasMitsubasParameterisation) {
  const auto place = [](const std::string& inner) {
    return build_scene("<shape type=\"disk\">" + inner + kTextured + "</shape>");
  };
  const auto scene = place(matrix({2, 0, 0, 1, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1}));
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  EXPECT_EQ((*scene)->features().disks, 1u);
  SurfaceHit hit = shoot(**scene, {1, 1.5f, 5}, {0, 0, -1});
  expect_near(hit.p, {1, 1.5f, 0});
  expect_near(hit.ng, {0, 0, 1});
  expect_near(hit.shading.s, {0, 1, 0});
  EXPECT_NEAR(hit.uv.x, 0.75f, 1e-6f);
  EXPECT_NEAR(hit.uv.y, 0.25f, 1e-6f);
  SurfaceHit none;
  EXPECT_FALSE((*scene)->intersect({{2.5f, 1.5f, 5}, {0, 0, -1}}, none));
  EXPECT_TRUE((*scene)->intersect({{2.4f, 1.4f, 5}, {0, 0, -1}}, none));
  hit = shoot(**scene, {1, 0, 5}, {0, 0, -1});  // the centre
  EXPECT_EQ(hit.uv.x, 0);
  expect_near(hit.shading.s, {1, 0, 0});
  // A mirror in the plane turns the angle, not the front; depth does not matter; flip_normals turns the
  // front.
  const auto mirrored = place(matrix({-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 7, 0, 0, 0, 0, 1}));
  ASSERT_TRUE(mirrored.ok()) << mirrored.error().to_string();
  hit = shoot(**mirrored, {0.5f, 0.0f, 5}, {0, 0, -1});
  expect_near(hit.ng, {0, 0, 1});
  EXPECT_NEAR(hit.uv.y, 0.5f, 1e-6f);
  const auto flipped = place("<boolean name=\"flip_normals\" value=\"true\"/>");
  hit = shoot(**flipped, {0, 0.5f, 5}, {0, 0, -1});
  expect_near(hit.ng, {0, 0, -1});
  EXPECT_NEAR(hit.uv.y, 0.25f, 1e-6f);
  EXPECT_EQ(
      place(
          "<transform name=\"to_world\"><scale x=\"1\" y=\"2\" z=\"1\"/></transform><emitter type=\"area\"/>")
          .error()
          .message,
      "shape 'disk': to_world scales unevenly or shears, which would make it an ellipse");
  EXPECT_EQ(place(matrix({1, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1})).error().message,
            "the transform 'to_world' is singular");
}

TEST(SceneBuild, CylinderHasMitsubasParameterisation) {
  const auto place = [](const std::string& inner) {
    return build_scene("<shape type=\"cylinder\">" + inner + kTextured + "</shape>");
  };
  const auto plain = place("");
  ASSERT_TRUE(plain.ok()) << plain.error().to_string();
  EXPECT_EQ((*plain)->features().cylinders, 1u);
  SurfaceHit hit = shoot(**plain, {0, 5, 0.25f}, {0, -1, 0});
  expect_near(hit.p, {0, 1, 0.25f});
  expect_near(hit.ng, {0, 1, 0});
  expect_near(hit.shading.s, {-1, 0, 0});
  EXPECT_NEAR(hit.uv.x, 0.25f, 1e-6f);
  EXPECT_NEAR(hit.uv.y, 0.25f, 1e-6f);
  hit = shoot(**plain, {0, 0, 0.5f}, {0, -1, 0});  // from inside: the outside stays outside
  expect_near(hit.ng, {0, -1, 0});
  EXPECT_NEAR(hit.uv.x, 0.75f, 1e-6f);
  SurfaceHit none;
  EXPECT_FALSE((*plain)->intersect({{0, 5, 1.01f}, {0, -1, 0}}, none));
  EXPECT_FALSE((*plain)->intersect({{0, 0, 5}, {0, 0, -1}}, none));      // along the axis: no caps
  EXPECT_FALSE((*plain)->intersect({{0.99f, 0, 5}, {0, 0, -1}}, none));  // inside, parallel to the mantle
  hit = shoot(**plain, {-0.5f, 0, 3}, {0.5f, 0, -1});                    // in at the top, out inside
  expect_near(hit.p, {1, 0, 0}, 1e-4f);
  // p0, p1 and radius, then to_world; along the axis it may stretch.
  const auto placed = place(
      "<point name=\"p0\" x=\"1\" y=\"0\" z=\"0\"/><point name=\"p1\" x=\"3\" y=\"0\" z=\"0\"/>"
      "<float name=\"radius\" value=\"0.5\"/><boolean name=\"flip_normals\" value=\"true\"/>" +
      matrix({3, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 1, 0, 0, 0, 1}));
  ASSERT_TRUE(placed.ok()) << placed.error().to_string();
  hit = shoot(**placed, {4.5f, 0, 9}, {0, 0, -1});
  expect_near(hit.p, {4.5f, 0, 2});
  expect_near(hit.ng, {0, 0, -1});
  EXPECT_NEAR(hit.uv.y, 0.25f, 1e-6f);
  EXPECT_EQ(
      place("<transform name=\"to_world\"><scale x=\"2\"/></transform><emitter type=\"area\"/>")
          .error()
          .message,
      "shape 'cylinder': to_world scales unevenly across the axis or shears, which would make it no circular "
      "cylinder");
  EXPECT_EQ(place("<point name=\"p1\" x=\"0\" y=\"0\" z=\"0\"/>").error().message,
            "shape 'cylinder': p0 and p1 are the same point");
  EXPECT_EQ(place("<transform name=\"to_world\"><scale value=\"1e25\"/></transform>").error().message,
            "shape 'cylinder': its size or place in the scene is out of range (coordinates up to 1e18)");
}

TEST(SceneBuild, VertexNormalsAreCompletedAndDecideSides) {
  const std::string shape = "<shape type=\"obj\"><string name=\"filename\" value=\"m.obj\"/>";
  // A roof of two faces without normals: smooth over the ridge, by equal angles half way between both.
  const std::string roof =
      "v -1 0 -1\nv 0 1 -1\nv 0 1 1\nv -1 0 1\nv 1 0 -1\nv 1 0 1\nf 1 4 3 2\nf 2 3 6 5\n";
  auto smooth = build_scene(shape + "</shape>", {{"m.obj", roof}});
  ASSERT_TRUE(smooth.ok()) << smooth.error().to_string();
  SurfaceHit hit = shoot(**smooth, {-1e-4f, 3, 0}, {0, -1, 0});
  expect_near(hit.shading.n, {0, 1, 0}, 1e-3f);
  expect_near(hit.ng, normalize(Vec3{-1, 1, 0}));
  auto flat =
      build_scene(shape + "<boolean name=\"face_normals\" value=\"true\"/></shape>", {{"m.obj", roof}});
  hit = shoot(**flat, {-1e-4f, 3, 0}, {0, -1, 0});
  expect_near(hit.shading.n, normalize(Vec3{-1, 1, 0}));
  // Wound clockwise, but with normals that say which side is the front.
  const std::string wound = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 -1\nf 1//1 2//1 3//1\n";
  auto sided = build_scene(shape + "</shape>", {{"m.obj", wound}});
  hit = shoot(**sided, {0.2f, 0.2f, 1}, {0, 0, -1});
  expect_near(hit.ng, {0, 0, -1});
  expect_near(hit.shading.n, {0, 0, -1});
  EXPECT_EQ((*sided)->features().triangles, 1u);
}

// Shapes by the hundred thousand: processor time and memory grow with their number, not its square. The bound
// is loose.
TEST(SceneBuild, ManySmallShapesAreJoinedInLinearTime) {
  const std::clock_t begin = std::clock();
  Geometry geometry;
  constexpr std::uint32_t kShapes = 300000;
  for (std::uint32_t i = 0; i < kShapes; ++i) {
    Shape shape;
    const auto x = static_cast<float>(i);
    shape.positions = {{x, 0, 0}, {x + 1, 0, 0}, {x, 1, 0}};
    if (i % 2 == 0) shape.normals.assign(3, {0, 0, 1});
    shape.triangles = {{0, 1, 2}};
    geometry.add(std::move(shape), {});
  }
  geometry.finish();
  EXPECT_LT(static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC, 5.0);
  EXPECT_EQ(geometry.indices[kShapes - 1][2], 3 * kShapes - 1);
  EXPECT_EQ(geometry.normals.size(), geometry.positions.size());
  EXPECT_EQ(geometry.shapes[kShapes - 1].first_triangle, kShapes - 1);
  EXPECT_LE(geometry.triangles.capacity(), 2u * kShapes + 2);
}

// A mesh large enough to be cut among threads: normals do not depend on how many there are.
TEST(SceneBuild, NormalsDoNotDependOnTheNumberOfThreads) {
  loaders::Mesh mesh;
  constexpr std::uint32_t kSide = 200;
  rng::Stream stream(rng::key(1, 95));
  for (std::uint32_t i = 0; i < kSide * kSide; ++i) {
    mesh.positions.push_back(
        {static_cast<float>(i % kSide), static_cast<float>(i / kSide), stream.next_float()});
  }
  for (std::uint32_t y = 0; y + 1 < kSide; ++y) {
    for (std::uint32_t x = 0; x + 1 < kSide; ++x) {
      const std::uint32_t a = y * kSide + x;
      mesh.triangles.push_back({a, a + 1, a + kSide + 1});
      mesh.triangles.push_back({a + kSide, a, a + kSide + 1});
    }
  }
  // One vertex keeps its own normal, one has a normal without length, which is none.
  mesh.normals.assign(mesh.positions.size(), {0, 0, 0});
  mesh.normals[7] = {0, 3, 4};
  const auto normals = [&](int threads) {
    tbb::task_arena arena(threads);
    return arena.execute([&] {
      auto shape = shape_from_mesh(mesh, Transform({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}), false,
                                   false, "m");
      EXPECT_TRUE(shape.ok());
      return shape->normals;
    });
  };
  const auto one = normals(1);
  EXPECT_EQ(one, normals(2));
  EXPECT_EQ(one, normals(7));
  expect_near(one[7], {0, 0.6f, 0.8f});
  for (const Vec3 n : one) ASSERT_NEAR(length(n), 1, 1e-6f);
}

TEST(SceneBuild, NamesWhatCannotBeBuilt) {
  const auto message = [](const std::string& body,
                          const std::string& obj = "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n") {
    const auto scene = build_scene(body, {{"m.obj", obj}});
    return scene.ok() ? std::string("no error") : scene.error().to_string();
  };
  const std::string mesh = "<shape type=\"obj\"><string name=\"filename\" value=\"m.obj\"/></shape>";
  EXPECT_EQ(message(mesh), "no error");  // the mesh is left out, with a warning
  EXPECT_EQ(
      message(
          "<shape type=\"cube\"><transform name=\"to_world\"><scale value=\"1e-20\"/></transform></shape>"),
      "scene.xml:3: to_world: shape 'cube': no face of the mesh has an area");
  EXPECT_EQ(message(mesh, "v 0 0 0\nv 1 x 0\n"), "m.obj:2: vertex position 'x' is not a number");
  // Faces without area are left out, others of the mesh stay; a normal without length is none.
  EXPECT_EQ(
      message(mesh, "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nvn 0 0 0\nf 1//1 2//1 3//1\nf 1//1 2//1 4//1\n"),
      "no error");
  EXPECT_EQ(message("<shape type=\"ply\"><string name=\"filename\" value=\"m.obj\"/></shape>", ""),
            "m.obj:1: this is no PLY file: it does not begin with a line 'ply'");
  EXPECT_EQ(message(mesh, "v 0 0 0\nv 1e20 0 0\nv 0 1 0\nf 1 2 3\n"),
            "m.obj: vertex 1 lies beyond 1e18 in the scene after to_world");
}

// Claim: a mesh of which no face has an area is left out, with its lamp and its textures, also from a group;
// an instance of a group of which nothing is left is left out, too. The rest of the scene stays.
TEST(SceneBuild, LeavesOutMeshesWithoutArea) {
  const std::string flat =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 2\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\n"
      "property uchar blue\nend_header\n0 0 3\n1 0 3\n2 0 3\n3 0 1 2 9 9 9\n3 0 0 1 9 9 9\n";
  const std::map<std::string, std::string> files = {{"m.obj", "v 0 0 3\nv 1 0 3\nv 2 0 3\nf 1 2 3\n"},
                                                    {"two.obj", "v 0 0 3\nv 1 0 3\nf 1 2\n"},
                                                    {"m.ply", flat}};
  const auto mesh = [](const std::string& name, const std::string& inside) {
    return "<shape type='" + name.substr(name.size() - 3) + "'><string name='filename' value='" + name +
           "'/>" + inside + "</shape>";
  };
  const std::string colors =
      "<bsdf type='diffuse'><texture type='mesh_attribute' name='reflectance'><string name='name' "
      "value='face_color'/></texture></bsdf>";
  const std::string group = "<shape type='shapegroup' id='g'>" + mesh("m.obj", "") + "</shape>";
  const std::string half =
      "<shape type='shapegroup' id='h'>" + mesh("m.obj", "") + "<shape type='cube'/></shape>";
  const struct {
    std::string body;
    std::uint32_t shapes, emitters, instances;
  } cases[] = {
      {mesh("m.obj", ""), 0, 0, 0},
      {mesh("two.obj", ""), 0, 0, 0},
      {mesh("m.obj", "<emitter type='area'/>") + "<shape type='cube'/>", 1, 0, 0},
      {"<shape type='cube'/>" + mesh("m.ply", colors) + "<shape type='sphere'/>", 2, 0, 0},
      {group + "<shape type='instance'><ref id='g'/></shape><shape type='instance'><ref id='g'/></shape>", 0,
       0, 0},
      {group + half +
           "<shape type='instance'><ref id='g'/></shape><shape type='instance'><ref id='h'/></shape>",
       1, 0, 1},
      {mesh("m.obj", "<medium type='homogeneous' name='interior'/>") + "<emitter type='constant'/>", 0, 1, 0},
  };
  for (const auto& test : cases) {
    const auto scene = build_scene(test.body, files);
    ASSERT_TRUE(scene.ok()) << test.body << ": " << scene.error().to_string();
    const SceneFeatures& f = (*scene)->features();
    EXPECT_EQ(f.shapes, test.shapes) << test.body;
    EXPECT_EQ(f.emitters, test.emitters) << test.body;
    EXPECT_EQ(f.instances, test.instances) << test.body;
    EXPECT_GT(f.dropped_faces, 0u) << test.body;
    SurfaceHit hit;
    (*scene)->intersect({{0, 0, 0}, {0, 0, 1}}, hit);  // there may be nothing to meet
  }
  const auto measured = build_scene(
      mesh("m.obj", "<sensor type='irradiancemeter'><film type='hdrfilm'/></sensor>"), files, " ");
  ASSERT_FALSE(measured.ok());
  EXPECT_NE(measured.error().to_string().find("no face of the measured mesh has an area"), std::string::npos)
      << measured.error().to_string();
}

TEST(SceneBuild, CountsFeatures) {
  const auto scene = build_scene(
      "<shape type=\"cube\"><bsdf type=\"dielectric\"/></shape><shape type=\"sphere\"><emitter "
      "type=\"area\"/></shape>"
      "<shape type=\"rectangle\"><emitter type=\"area\"><rgb name=\"radiance\" "
      "value=\"0\"/></emitter></shape>"
      "<emitter type=\"point\"/><emitter type=\"constant\"/>");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  const SceneFeatures& f = (*scene)->features();
  EXPECT_EQ(f.triangles, 14u);
  EXPECT_EQ(f.spheres, 1u);
  EXPECT_EQ(f.shapes, 3u);
  EXPECT_EQ(f.emitters, 3u);  // a black lamp is none
  EXPECT_EQ(f.emitter_kinds.at("area"), 1u);
  EXPECT_TRUE(f.any_delta_bsdf && f.any_transmission && f.any_environment && f.any_delta_emitter &&
              f.any_area_emitter);
  EXPECT_TRUE(f.all_bsdfs_delta);  // what is not glass scatters nothing
  EXPECT_TRUE(f.any_black_bsdf);   // a lamp without a bsdf
}

}  // namespace
}  // namespace candela::scene
