// Claims about textures that look at more than (u, v): attributes of meshes are interpolated over triangles
// and belong to their shapes, also where shapes share a bsdf, in instances and where faces have been left
// out; lamps glow the same however they are sampled; a wireframe follows the distance to edges, a volume the
// place in the world; grids of lines lie where u or v is an integer. What a shape cannot have is an error
// that names it.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/unit/scene_fixture.h"
#include "tests/unit/volume_file.h"
#include "worker/scene/bsdfs/kinds.h"
#include "worker/scene/emitters/lights.h"

namespace candela::scene {
namespace {

using test::build_scene;

// A unit square of two triangles in the plane z = 0, seen by rays along -z. The middle face has no area.
const std::string kColoredSquare =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "property float r\nproperty float g\nproperty float b\nelement face 3\nproperty list uchar int "
    "vertex_indices\nproperty float heat_0\nend_header\n"
    "0 0 0  0 0 0\n1 0 0  1 0 0\n1 1 0  1 1 0\n0 1 0  0 1 0\n"
    "3 0 1 2  0.25\n3 0 0 1  9\n3 0 2 3  0.5\n";

std::string attribute(const std::string& name, const std::string& more = "") {
  return "<texture type='mesh_attribute' name='reflectance'><string name='name' value='" + name + "'/>" +
         more + "</texture>";
}

std::unique_ptr<Scene> scene_of(const std::string& body) {
  auto built = build_scene(body, {{"a.ply", kColoredSquare}});
  EXPECT_TRUE(built.ok()) << built.error().to_string();
  return built.ok() ? std::move(*built) : nullptr;
}
std::string error_of(const std::string& body) {
  const auto built = build_scene(body, {{"a.ply", kColoredSquare}});
  return built.ok() ? "no error" : built.error().to_string();
}

// The reflectance of the diffuse surface that a ray along -z meets.
Spectrum seen(const Scene& scene, float x, float y) {
  SurfaceHit hit;
  if (!scene.intersect({{x, y, 5}, {0, 0, -1}}, hit)) return Spectrum(-1);
  ClosureArena arena;
  const Closure closure = scene.closure(hit, {0, 0, 1}, arena);
  return closure.get<DiffuseClosure>().reflectance;
}

void expect_near(Spectrum value, Spectrum expected, float tolerance = 1e-5f) {
  EXPECT_NEAR(value.r, expected.r, tolerance);
  EXPECT_NEAR(value.g, expected.g, tolerance);
  EXPECT_NEAR(value.b, expected.b, tolerance);
}

std::string ply(const std::string& inside) {
  return "<shape type='ply'><string name='filename' value='a.ply'/>" + inside + "</shape>";
}

TEST(SurfaceTexture, AttributesAreInterpolated) {
  const auto scene = scene_of(ply("<bsdf type='diffuse'>" + attribute("vertex_color") + "</bsdf>"));
  ASSERT_NE(scene, nullptr);
  rng::Stream stream(3);
  for (int i = 0; i < 200; ++i) {
    const float x = stream.next_float(), y = stream.next_float();
    expect_near(seen(*scene, x, y), {x, y, 0});
  }
}

TEST(SurfaceTexture, AttributesOfFacesStayWithTheirFaces) {
  const auto scene = scene_of(
      ply("<bsdf type='diffuse'>" + attribute("face_heat", "<float name='scale' value='2'/>") + "</bsdf>"));
  ASSERT_NE(scene, nullptr);
  expect_near(seen(*scene, 0.7f, 0.2f), Spectrum(0.5f));
  expect_near(seen(*scene, 0.2f, 0.7f), Spectrum(1.0f));
}

// Shapes of one bsdf, a shape without attributes before them, flipped normals, and instances.
TEST(SurfaceTexture, AttributesBelongToTheirShapes) {
  const std::string move = "<transform name='to_world'><translate x='3'/></transform>";
  const auto scene = scene_of(
      "<bsdf type='twosided' id='shared'><bsdf type='diffuse'>" + attribute("vertex_color") +
      "</bsdf></bsdf><shape type='cube'><transform name='to_world'><translate z='-9'/></transform></shape>" +
      ply("<ref id='shared'/><boolean name='flip_normals' value='true'/>") +
      ply("<ref id='shared'/><boolean name='face_normals' value='true'/>" + move) +
      "<shape type='shapegroup' id='group'>" + ply("<ref id='shared'/>") +
      "</shape><shape type='instance'><ref id='group'/><transform name='to_world'><scale value='2'/>"
      "<translate x='-5' y='1'/></transform></shape>");
  ASSERT_NE(scene, nullptr);
  expect_near(seen(*scene, 0.25f, 0.5f), {0.25f, 0.5f, 0});
  expect_near(seen(*scene, 3.75f, 0.5f), {0.75f, 0.5f, 0});
  expect_near(seen(*scene, -4.5f, 2.5f), {0.25f, 0.75f, 0});
}

// Light sampled from a lamp has the radiance that a ray to the same place meets.
TEST(SurfaceTexture, LampsGlowByTheirTextures) {
  const std::string textures[] = {
      "<texture type='mesh_attribute' name='radiance'><string name='name' value='vertex_color'/></texture>",
      "<texture type='wireframe' name='radiance'><float name='line_width' value='0.2'/></texture>",
      "<texture type='volume' name='radiance'><rgb name='volume' value='0.1 0.2 0.3'/></texture>"};
  for (const std::string& texture : textures) {
    for (const std::string& shape :
         {ply("<emitter type='area'>" + texture + "</emitter>"),
          "<shape type='rectangle'><emitter type='area'>" + texture + "</emitter></shape>"}) {
      if (shape.find("rectangle") != std::string::npos && texture.find("mesh_attribute") != std::string::npos)
        continue;
      const auto scene = scene_of(shape);
      ASSERT_NE(scene, nullptr);
      rng::Stream stream(5);
      int lit = 0, emitted = 0;
      for (int i = 0; i < 300; ++i) {
        SurfaceHit reference = test::point_reference({0.4f, 0.6f, 2}, {0, 0, -1});
        DirectSample light;
        const float u = stream.next_float(), v = stream.next_float();
        if (scene->sample_direct(reference, {}, stream.next_float(), {u, v}, light) != DirectOutcome::sampled)
          continue;
        SurfaceHit hit;
        ASSERT_TRUE(scene->intersect({reference.p, light.wi}, hit));
        expect_near(scene->emitted(hit, -light.wi), light.radiance, 2e-4f);
        EmissionSample emission;
        if (scene->sample_emission(stream.next_float(), {u, v}, {0.3f, 0.4f}, emission)) {
          SurfaceHit start = emission.vertex;
          start.emitter = 0;
          expect_near(scene->emitted(start, start.ng), emission.radiance, 1e-6f);
          ++emitted;
        }
        ++lit;
      }
      EXPECT_GT(lit, 100) << texture;
      EXPECT_GT(emitted, 100) << texture;
    }
  }
}

// Claim: a rectangle that glows by a wireframe is a mesh for all who choose among lights, and its power is
// that of the lines too.
TEST(SurfaceTexture, RectanglesThatGlowByAWireframeAreMeshes) {
  const std::string texture =
      "<texture type='wireframe' name='radiance'><rgb name='interior_color' value='0'/>"
      "<rgb name='edge_color' value='1'/><float name='line_width' value='1'/>"
      "<float name='step_width' value='0'/></texture>";
  const auto scene =
      scene_of("<shape type='rectangle'><emitter type='area'>" + texture + "</emitter></shape>");
  ASSERT_NE(scene, nullptr);
  EXPECT_TRUE(scene->features().any_mesh_emitter);
  EXPECT_FALSE(scene->features().any_rectangle_emitter);
  // Every point is within 1 of an edge: the whole rectangle glows.
  const auto lit = scene_of("<shape type='rectangle'><emitter type='area'>" + texture +
                            "<float name='power' value='8'/></emitter></shape>");
  ASSERT_NE(lit, nullptr);
  SurfaceHit hit;
  ASSERT_TRUE(lit->intersect({{0.3f, 0.1f, 5}, {0, 0, -1}}, hit));
  EXPECT_NEAR(lit->emitted(hit, {0, 0, 1}).g, 8 / (4 * std::numbers::pi), 1e-4);
}

TEST(SurfaceTexture, WireframesFollowTheDistanceToEdges) {
  const std::string colors = "<rgb name='interior_color' value='1'/><rgb name='edge_color' value='0'/>";
  const auto wire = [&](const std::string& widths) {
    return ply("<bsdf type='diffuse'><texture type='wireframe' name='reflectance'>" + colors + widths +
               "</texture></bsdf>");
  };
  const auto distance = [](float x, float y) {
    const float diagonal = std::abs(x - y) / std::numbers::sqrt2_v<float>;
    return x > y ? std::min({diagonal, y, 1 - x}) : std::min({diagonal, x, 1 - y});
  };
  const auto hard =
      scene_of(wire("<float name='line_width' value='0.1'/><float name='step_width' value='0'/>"));
  const auto soft =
      scene_of(wire("<float name='line_width' value='0.2'/><float name='step_width' value='1'/>"));
  const auto automatic = scene_of(wire("<float name='step_width' value='0'/>"));
  ASSERT_TRUE(hard && soft && automatic);
  const float mean_edge = (4 + 2 * std::numbers::sqrt2_v<float>) / 6;
  rng::Stream stream(7);
  for (int i = 0; i < 500; ++i) {
    const float x = stream.next_float(), y = stream.next_float(), d = distance(x, y);
    if (std::abs(d - 0.1f) > 1e-5f) expect_near(seen(*hard, x, y), Spectrum(d < 0.1f ? 0.0f : 1.0f));
    const float t = std::min(d / 0.2f, 1.0f);
    expect_near(seen(*soft, x, y), Spectrum(t * t * (3 - 2 * t)), 1e-4f);
    if (std::abs(d - 0.1f * mean_edge) > 1e-5f)
      expect_near(seen(*automatic, x, y), Spectrum(d < 0.1f * mean_edge ? 0.0f : 1.0f));
  }
  const auto round =
      scene_of("<shape type='sphere'><bsdf type='diffuse'><texture type='wireframe' name='reflectance'>" +
               colors + "</texture></bsdf></shape>");
  ASSERT_NE(round, nullptr);
  expect_near(seen(*round, 0.2f, 0.3f), Spectrum(1));
  // So it does beside a mesh that has no wireframe, and for a hit that was on it before.
  const auto beside = scene_of(
      "<shape type='cube'><transform name='to_world'><translate x='9'/></transform></shape>"
      "<shape type='sphere'><bsdf type='diffuse'><texture type='wireframe' name='reflectance'>" +
      colors + "<float name='line_width' value='0.1'/></texture></bsdf></shape>");
  ASSERT_NE(beside, nullptr);
  SurfaceHit hit;
  ASSERT_TRUE(beside->intersect({{9.2f, 0.3f, 5}, {0, 0, -1}}, hit));
  ASSERT_TRUE(beside->intersect({{0.2f, 0.3f, 5}, {0, 0, -1}}, hit));
  ClosureArena arena;
  const Closure closure = beside->closure(hit, {0, 0, 1}, arena);
  expect_near(closure.get<DiffuseClosure>().reflectance, Spectrum(1));
}

TEST(SurfaceTexture, GridLinesLieAtIntegers) {
  const auto scene = scene_of(
      "<shape type='rectangle'><bsdf type='diffuse'><texture type='gridtexture' name='reflectance'>"
      "<rgb name='color0' value='0.25'/><rgb name='color1' value='0.75'/><float name='line_width' "
      "value='0.1'/>"
      "<transform name='to_uv'><scale x='2' y='1'/></transform></texture></bsdf></shape>");
  ASSERT_NE(scene, nullptr);
  const auto at = [&](float u, float v) { return seen(*scene, 2 * u - 1, 2 * v - 1).r; };
  EXPECT_EQ(at(0.25f, 0.5f), 0.25f);
  EXPECT_EQ(at(0.51f, 0.5f), 0.75f);
  EXPECT_EQ(at(0.47f, 0.5f), 0.75f);
  EXPECT_EQ(at(0.43f, 0.5f), 0.25f);
  EXPECT_EQ(at(0.25f, 0.95f), 0.75f);
  EXPECT_EQ(at(0.25f, 0.85f), 0.25f);
}

// A volume of two cells along x that its own to_world stretches to [0, 4].
TEST(SurfaceTexture, VolumesAreLookedUpInTheWorld) {
  const auto built = build_scene(
      "<shape type='rectangle'><transform name='to_world'><scale value='8'/></transform><bsdf type='diffuse'>"
      "<texture type='volume' name='reflectance'><volume name='volume' type='gridvolume'><string "
      "name='filename' value='a.vol'/><transform name='to_world'><scale "
      "x='4'/></transform></volume></texture>"
      "</bsdf></shape>",
      {{"a.vol", test::volume_file({2, 1, 1}, 1, {0.2f, 0.6f})}});
  ASSERT_TRUE(built.ok()) << built.error().to_string();
  expect_near(seen(**built, -3, 1), Spectrum(0.2f));
  expect_near(seen(**built, 2, -1), Spectrum(0.4f));
  expect_near(seen(**built, 6, 0), Spectrum(0.6f));
}

TEST(SurfaceTexture, ErrorsNameWhatIsMissing) {
  const std::string colors = "<bsdf type='diffuse'>" + attribute("vertex_color") + "</bsdf>";
  EXPECT_NE(error_of("<shape type='rectangle'>" + colors + "</shape>").find("no attribute 'vertex_color'"),
            std::string::npos);
  EXPECT_NE(error_of(ply("<bsdf type='diffuse'>" + attribute("vertex_mood") + "</bsdf>")).find("a.ply"),
            std::string::npos);
  EXPECT_NE(error_of(ply("<bsdf type='diffuse'>" +
                         attribute("vertex_color", "<float name='scale' value='3'/>") + "</bsdf>"))
                .find("reflect"),
            std::string::npos);
  EXPECT_NE(error_of(ply("<emitter type='area'><texture type='mesh_attribute' name='radiance'><string "
                         "name='name' value='vertex_color'/><float name='scale' value='-1'/></texture>"
                         "</emitter>"))
                .find("negative"),
            std::string::npos);
  EXPECT_NE(error_of(ply("<bsdf type='diffuse'>" +
                         attribute("vertex_color", "<float name='scale' value='-1'/>") + "</bsdf>"))
                .find("negative"),
            std::string::npos);
  EXPECT_NE(error_of("<emitter type='spot'><texture type='wireframe' name='texture'/></emitter>")
                .find("needs a surface"),
            std::string::npos);
}

}  // namespace
}  // namespace candela::scene
