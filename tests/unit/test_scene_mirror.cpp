// Claims: a to_world that mirrors turns no surface inside out. For every shape, with all that decides its
// normals: the hits of a mirrored scene are the mirrored hits of the scene, with the mirrored outside. Lamps
// glow, media begin and bump maps rise on the same side.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "tests/unit/scene_fixture.h"
#include "tests/unit/shared_cases.h"
#include "worker/scene/transform.h"

namespace candela::scene {
namespace {

using test::build_scene;
using test::matrix;
using test::uniform_direction;

// A tent over a floor, closed, corners turning left seen from outside; without normals, and with those of
// its corners.
const std::string kTentCorners =
    "v -1 -1 -0.5\nv 1 -1 -0.5\nv 1 1 -0.5\nv -1 1 -0.5\nv -0.7 0 0.8\nv 0.9 0 0.7\n";
const std::string kTent = kTentCorners + "f 4 3 2 1\nf 1 2 6 5\nf 3 4 5 6\nf 2 3 6\nf 4 1 5\n";
const std::string kTentWithNormals =
    kTentCorners +
    "vn -1 -1 -1\nvn 1 -1 -1\nvn 1 1 -1\nvn -1 1 -1\nvn -1 0 1\nvn 1 0 1\nf 4//4 3//3 2//2 1//1\n"
    "f 1//1 2//2 6//6 5//5\nf 3//3 4//4 5//5 6//6\nf 2//2 3//3 6//6\nf 4//4 1//1 5//5\n";
const std::string kTentPly =
    "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 5\nproperty list uchar int vertex_indices\nend_header\n-1 -1 -0.5\n1 -1 -0.5\n1 1 -0.5\n"
    "-1 1 -0.5\n-0.7 0 0.8\n0.9 0 0.7\n4 3 2 1 0\n4 0 1 5 4\n4 2 3 4 5\n3 1 2 5\n3 3 0 4\n";

// [-1, 1]^2 at z = 0 facing +z, without normals.
std::string serialized_square() {
  const std::string hex =
      "1c040400789c63106060c8656061800026061868d80fc2b366cedc07a4ed217cb038886d7ff68c8f"
      "1d540d907dc61624c388a41f4433033100fdd80fd3000000000000000001000000";
  std::string out;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2)
    out += static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16));
  return out;
}

std::string heights() {
  std::string out = "Pf\n3 3\n-1.0\n";
  for (const float z : {0.f, 0.1f, 0.f, 0.2f, 0.5f, 0.3f, 0.f, 0.2f, 0.1f}) {
    char bytes[4];
    std::memcpy(bytes, &z, sizeof z);
    out.append(bytes, sizeof z);
  }
  return out;
}

const std::map<std::string, std::string> kFiles = {
    {"tent.obj", kTent},        {"normals.obj", kTentWithNormals},
    {"tent.ply", kTentPly},     {"s", serialized_square()},
    {"heights.pfm", heights()}, {"curve.txt", "-1 0 0 0.2\n0 0.2 0.1 0.3\n0.5 -0.1 0 0.2\n1 0 0.2 0.2\n"}};

std::string of_file(const std::string& plugin, const std::string& file, const std::string& more = "") {
  return "<shape type='" + plugin + "'>@<string name='filename' value='" + file + "'/>" + more + "$</shape>";
}
const std::string kFlat = "<boolean name='face_normals' value='true'/>";
const std::string kCreased = "<float name='max_smooth_angle' value='30'/>";
const std::string kFlipped = "<boolean name='flip_normals' value='true'/>";

// @: the place of to_world; $: of a bsdf, a lamp or media.
const std::vector<std::pair<std::string, std::string>> kShapes = {
    {"obj without normals", of_file("obj", "tent.obj")},
    {"obj, flat", of_file("obj", "tent.obj", kFlat)},
    {"obj, creased", of_file("obj", "tent.obj", kCreased)},
    {"obj, flipped", of_file("obj", "tent.obj", kFlipped)},
    {"obj, flat and flipped", of_file("obj", "tent.obj", kFlat + kFlipped)},
    {"obj with normals", of_file("obj", "normals.obj")},
    {"obj with normals, flat", of_file("obj", "normals.obj", kFlat)},
    {"obj with normals, creased", of_file("obj", "normals.obj", kCreased)},
    {"ply without normals", of_file("ply", "tent.ply")},
    {"ply, flat", of_file("ply", "tent.ply", kFlat)},
    {"ply, creased", of_file("ply", "tent.ply", kCreased)},
    {"serialized without normals", of_file("serialized", "s")},
    {"serialized, flat", of_file("serialized", "s", kFlat)},
    {"serialized, creased", of_file("serialized", "s", kCreased)},
    {"heightfield", of_file("heightfield", "heights.pfm")},
    {"heightfield, flipped", of_file("heightfield", "heights.pfm", kFlipped)},
    {"heightfield, flat",
     of_file("heightfield", "heights.pfm", "<boolean name='shading_normals' value='false'/>")},
    {"heightfield, flat and flipped",
     of_file("heightfield", "heights.pfm", "<boolean name='shading_normals' value='false'/>" + kFlipped)},
    {"bsplinecurve", of_file("bsplinecurve", "curve.txt")},
    {"linearcurve", of_file("linearcurve", "curve.txt")},
    {"rectangle", "<shape type='rectangle'>@$</shape>"},
    {"cube", "<shape type='cube'>@$</shape>"},
    {"sphere", "<shape type='sphere'>@$</shape>"},
    {"disk", "<shape type='disk'>@$</shape>"},
    {"cylinder", "<shape type='cylinder'>@$</shape>"},
    {"a stretched sphere", "<shape type='sphere'>@$</shape>"},
    {"an instance of an obj",
     "<shape type='shapegroup' id='g'>" +
         of_file("obj", "tent.obj").replace(of_file("obj", "tent.obj").find('@'), 1, "") +
         "</shape><shape type='instance'>@<ref id='g'/></shape>"}};

std::string with(std::string shape, const std::vector<double>& to_world, const std::string& inside = "") {
  shape.replace(shape.find('@'), 1, matrix(to_world));
  shape.replace(shape.find('$'), 1, inside);
  return shape;
}

// With scale 2: a mirror in a plane through none of the axes, and one along an axis.
const std::vector<double> kOblique = {2.0 / 3,  -4.0 / 3, -4.0 / 3, 0.5,  -4.0 / 3, 2.0 / 3, -4.0 / 3, -0.25,
                                      -4.0 / 3, -4.0 / 3, 2.0 / 3,  0.75, 0,        0,       0,        1};
const std::vector<double> kReflection = {1.0 / 3,  -2.0 / 3, -2.0 / 3, 0.5,      -2.0 / 3, 1.0 / 3,
                                         -2.0 / 3, -0.25,    -2.0 / 3, -2.0 / 3, 1.0 / 3,  0.75,
                                         0,        0,        0,        1};
const std::vector<double> kAlongX = {-2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1};
const std::vector<double> kUneven = {-3, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1};
const std::vector<double> kIdentity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

Transform transform_of(const std::vector<double>& m) {
  description::Mat4 out{};
  std::copy(m.begin(), m.end(), out.begin());
  return Transform(out);
}

Vec3 turned(const Transform& to_world, Vec3 normal) {
  return Vec3(normalize(to_world.normal(Vec3d(normal))));
}

// body(ray, hit, mirrored ray, mirrored hit) of rays that meet the shape.
template <class Body>
void for_hits(const Scene& plain, const Scene& mirrored, const Transform& to_world, const Body& body) {
  rng::Stream stream(5);
  int met = 0;
  for (int i = 0; i < 400; ++i) {
    const Vec3 from = uniform_direction(stream) * 3.0f;
    const Vec3 aim = uniform_direction(stream) * (0.8f * stream.next_float());
    const Ray ray{from, normalize(aim - from)};
    const Vec3d d = to_world.vector(Vec3d(ray.direction));
    const Ray other{Vec3(to_world.point(Vec3d(from))), Vec3(normalize(d))};
    SurfaceHit a, b;
    const bool meets = plain.intersect(ray, a);
    if (!meets || std::abs(dot(a.ng, ray.direction)) < 0.02f) continue;  // an edge, to rounding
    ASSERT_TRUE(mirrored.intersect(other, b));
    if (length(Vec3(to_world.point(Vec3d(a.p))) - b.p) > 1e-4f) continue;  // another one at an edge
    ++met;
    body(ray, a, other, b);
  }
  EXPECT_GT(met, 50);
}

TEST(Mirror, HitsAreMirrored) {
  for (const auto& [what, shape] : kShapes) {
    for (const auto* m : {&kOblique, &kAlongX, &kUneven}) {
      const bool round = what == "disk" || what == "cylinder" || what == "sphere";
      if (m == &kUneven && (round || what.find("curve") != what.npos)) continue;  // of another shape
      SCOPED_TRACE(what);
      const auto plain = build_scene(with(shape, kIdentity), kFiles);
      const auto mirrored = build_scene(with(shape, *m), kFiles);
      ASSERT_TRUE(plain.ok()) << plain.error().to_string();
      ASSERT_TRUE(mirrored.ok()) << mirrored.error().to_string();
      const Transform to_world = transform_of(*m);
      int wrong = 0, wrong_shading = 0;
      for_hits(**plain, **mirrored, to_world,
               [&](const Ray&, const SurfaceHit& a, const Ray&, const SurfaceHit& b) {
                 if (!(dot(turned(to_world, a.ng), b.ng) > 0.99f)) ++wrong;
                 // Normals that are computed in the world are not those of the file under uneven scales.
                 if (!(dot(turned(to_world, a.shading.n), b.shading.n) > (m == &kUneven ? 0.5f : 0.99f)))
                   ++wrong_shading;
               });
      EXPECT_EQ(wrong, 0);
      EXPECT_EQ(wrong_shading, 0);
    }
  }
}

TEST(Mirror, LampsGlowToTheSameSide) {
  const std::string lamp = "<emitter type='area'/>";
  for (const auto& [what, shape] : kShapes) {
    if (what == "an instance of an obj" || what == "a stretched sphere") continue;  // no lamps
    SCOPED_TRACE(what);
    const auto plain = build_scene(with(shape, kIdentity, lamp), kFiles);
    const auto mirrored = build_scene(with(shape, kOblique, lamp), kFiles);
    ASSERT_TRUE(plain.ok()) << plain.error().to_string();
    ASSERT_TRUE(mirrored.ok()) << mirrored.error().to_string();
    int wrong = 0, lit = 0;
    rng::Stream stream(6);
    for_hits(**plain, **mirrored, transform_of(kOblique),
             [&](const Ray& ray, const SurfaceHit& a, const Ray& other, const SurfaceHit& b) {
               const bool seen = !(*plain)->emitted(a, -ray.direction).is_black();
               if (seen != !(*mirrored)->emitted(b, -other.direction).is_black()) ++wrong;
               lit += seen ? 1 : 0;
             });
    EXPECT_EQ(wrong, 0);
    // And what next event estimation draws is what is seen glowing.
    for (int i = 0; i < 200; ++i) {
      const SurfaceHit from = test::point_reference(uniform_direction(stream) * 8.0f);
      const float select = stream.next_float(), x = stream.next_float();
      DirectSample light;
      if ((*mirrored)->sample_direct(from, {}, select, {x, stream.next_float()}, light) !=
          DirectOutcome::sampled)
        continue;
      SurfaceHit hit;
      if (!(*mirrored)->occluded(light.shadow_ray) && (*mirrored)->intersect({from.p, light.wi}, hit) &&
          std::abs(dot(hit.ng, light.wi)) > 0.02f) {
        EXPECT_FALSE((*mirrored)->emitted(hit, -light.wi).is_black());
      }
    }
  }
}

TEST(Mirror, MediaBeginOnTheSameSide) {
  const std::string fog = "<medium name='interior' type='homogeneous'/>";
  for (const auto& [what, shape] : kShapes) {
    if (what == "an instance of an obj") continue;
    SCOPED_TRACE(what);
    const auto plain = build_scene(with(shape, kIdentity, fog), kFiles);
    const auto mirrored = build_scene(with(shape, kOblique, fog), kFiles);
    ASSERT_TRUE(plain.ok()) << plain.error().to_string();
    ASSERT_TRUE(mirrored.ok()) << mirrored.error().to_string();
    int wrong = 0;
    for_hits(**plain, **mirrored, transform_of(kOblique),
             [&](const Ray& ray, const SurfaceHit& a, const Ray& other, const SurfaceHit& b) {
               if ((*plain)->medium_beyond(a, ray.direction, kNone) !=
                   (*mirrored)->medium_beyond(b, other.direction, kNone))
                 ++wrong;
             });
    EXPECT_EQ(wrong, 0);
  }
}

// The value of the bsdf, which depends on the turned normal, of mirrored directions.
TEST(Mirror, BumpsRiseOnTheSameSide) {
  const std::string bumps =
      "<bsdf type='bumpmap'><texture name='a' type='bitmap'><string name='filename' value='heights.pfm'/>"
      "<boolean name='raw' value='true'/></texture><float name='scale' value='0.3'/>"
      "<boolean name='flip_invalid_normals' value='false'/><boolean name='use_shadowing_function' "
      "value='false'/><bsdf type='roughconductor'><float name='alpha' value='0.2'/></bsdf></bsdf>";
  for (const std::string what : {"rectangle", "sphere", "cylinder", "disk", "cube"}) {
    SCOPED_TRACE(what);
    const std::string shape = "<shape type='" + what + "'>@$</shape>";
    const auto plain = build_scene(with(shape, kIdentity, bumps), kFiles);
    const auto mirrored = build_scene(with(shape, kReflection, bumps), kFiles);
    ASSERT_TRUE(plain.ok()) << plain.error().to_string();
    ASSERT_TRUE(mirrored.ok()) << mirrored.error().to_string();
    const Transform to_world = transform_of(kReflection);
    rng::Stream stream(7);
    int bright = 0;
    for_hits(**plain, **mirrored, to_world,
             [&](const Ray& ray, const SurfaceHit& a, const Ray& other, const SurfaceHit& b) {
               const Vec3 light = normalize(uniform_direction(stream) - ray.direction);
               const Vec3 mirrored_light = Vec3(normalize(to_world.vector(Vec3d(light))));
               const auto value = [](const Scene& scene, const SurfaceHit& hit, Vec3 wo, Vec3 wi) {
                 ClosureArena arena;
                 const Closure closure = scene.closure(hit, hit.shading.to_local(wo), arena);
                 float pdf = 0;
                 return static_cast<double>(luminance(closure.eval_pdf(
                     hit.shading.to_local(wo), hit.shading.to_local(wi), TransportMode::radiance, pdf)));
               };
               const double f = value(**plain, a, -ray.direction, light);
               EXPECT_NEAR(value(**mirrored, b, -other.direction, mirrored_light), f, 0.01 * f + 1e-4);
               bright += f > 0.05 ? 1 : 0;
             });
    EXPECT_GT(bright, 5);
  }
}

TEST(Mirror, SharedCase) {
  const auto folder = test::shared_case("mirrored_mesh");
  if (folder.empty()) GTEST_SKIP() << "../shared/cases/mirrored_mesh is not here";
  for (const char* name : {"scene06.xml", "scene06_plain.xml", "scene06_instance.xml"}) {
    const test::TextFiles files({{"scene.xml", test::file_text(folder / name)},
                                 {"n.serialized", test::file_text(folder / "n.serialized")}});
    const auto description = description::parse_scene(files, "scene.xml", {});
    ASSERT_TRUE(description.ok()) << description.error().to_string();
    const auto scene = Scene::build(*description, files, {});
    ASSERT_TRUE(scene.ok()) << scene.error().to_string();
    float weight = 0;
    const Ray ray = (*scene)->camera_ray(0.5f, 0.5f, {0.5f, 0.5f}, weight);
    SurfaceHit hit;
    ASSERT_TRUE((*scene)->intersect(ray, hit)) << name;
    EXPECT_LT(dot(hit.ng, ray.direction), 0) << name;  // the front is seen, which is not black
  }
}

}  // namespace
}  // namespace candela::scene
