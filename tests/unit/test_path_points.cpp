// Claims: canonical points of all shapes, by themselves and in instances of any affine map, lie where rays
// meet the surface; they are the intersection of the line in double; their derivatives are those of the
// place and of the normals; the same point is found again from either side; a map of normals says that its
// normals have no derivatives.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "tests/unit/scene_fixture.h"
#include "worker/scene/points/surface_points.h"

namespace candela::scene {
namespace {

using test::build_scene;
using test::matrix;
using test::uniform_direction;

// An uneven scale, a shear and a mirror, somewhere.
const std::vector<double> kUneven = {-1.5, 0.3, 0, 2, 0, 0.7, 0.2, -1, 0.1, 0, 2, 0.5, 0, 0, 0, 1};
// A turn, and one scale.
const std::vector<double> kTurned = {0.72, -0.96, 0, 0.3, 0.96, 0.72, 0, -0.2, 0, 0, 1.2, 0.1, 0, 0, 0, 1};

// A tent with normals that are not its faces'.
const std::string kObj =
    "v -1 -1 0\nv 1 -1 0.2\nv 1 1 0\nv -1 1 0.5\nv 0 0 1\n"
    "vn -0.5 -0.4 1\nvn 0.6 -0.5 1\nvn 0.4 0.5 1\nvn -0.3 0.6 1\nvn 0.1 0 1\n"
    "f 1//1 2//2 5//5\nf 2//2 3//3 5//5\nf 3//3 4//4 5//5\nf 4//4 1//1 5//5\n";

struct Shape {
  std::string name, text;
  bool moved = false;  // by kUneven
};
std::vector<Shape> shapes() {
  const auto of = [](const std::string& type, const std::string& inside) {
    return "<shape type=\"" + type + "\">" + inside + "</shape>";
  };
  const std::string turned = matrix(kTurned);
  const std::string flip = "<boolean name=\"flip_normals\" value=\"true\"/>";
  std::vector<Shape> all;
  for (const std::string type : {"sphere", "cylinder", "disk", "rectangle", "cube"}) {
    all.push_back({type, of(type, "")});
    all.push_back({type + ", turned and flipped", of(type, flip + turned)});
    const std::string group = "<shape type=\"shapegroup\" id=\"g\">" + of(type, turned) + "</shape>";
    all.push_back(
        {type + " in an uneven instance", group + of("instance", "<ref id=\"g\"/>" + matrix(kUneven)), true});
  }
  const std::string mesh = of("obj", "<string name=\"filename\" value=\"m.obj\"/>");
  all.push_back({"mesh", mesh});
  all.push_back({"mesh in an uneven instance",
                 "<shape type=\"shapegroup\" id=\"g\">" + mesh + "</shape>" +
                     of("instance", "<ref id=\"g\"/>" + matrix(kUneven)),
                 true});
  return all;
}

std::unique_ptr<Scene> scene_of(const Shape& shape, Scene::Options options = {}) {
  auto scene = build_scene(shape.text, {{"m.obj", kObj}}, "", options);
  EXPECT_TRUE(scene.ok()) << scene.error().to_string();
  return std::move(scene).value();
}

// Calls visit(ray, hit, point) for rays that meet the scene.
template <class Visit>
int visit_points(const Shape& shape, const Scene& scene, int rays, const Visit& visit) {
  const Vec3 center = shape.moved ? Vec3{2, -1, 0.5f} : Vec3{};
  rng::Stream stream(rng::key(46, 100));
  const float size = scene.features().radius;
  int met = 0;
  for (int i = 0; i < rays; ++i) {
    const Vec3 from = center + uniform_direction(stream) * (2 * size);
    const Vec3 to = center + uniform_direction(stream) * (size * stream.next_float());
    const Ray ray{from, normalize(to - from)};
    SurfaceHit hit;
    const bool found = scene.intersect(ray, hit);
    const auto point = scene.points().intersect(ray);
    EXPECT_EQ(found, point.has_value());
    if (!found || !point) continue;
    ++met;
    visit(ray, hit, *point);
  }
  return met;
}

TEST(SurfacePoints, AreWhereRaysMeetSurfaces) {
  for (const Shape& shape : shapes()) {
    SCOPED_TRACE(shape.name);
    const auto scene = scene_of(shape);
    const double size = static_cast<double>(scene->features().radius);
    const int met = visit_points(
        shape, *scene, 1000, [&](const Ray& ray, const SurfaceHit& hit, const CanonicalPoint& point) {
          EXPECT_TRUE(scene->points().exists(point));
          const SurfaceGeometry at = scene->points().at(point);
          EXPECT_LT(length(at.p - Vec3d(hit.p)), 1e-6 * size / std::abs(dot(Vec3d(ray.direction), at.ng)));
          EXPECT_LT(length(at.ng - Vec3d(hit.ng)), 1e-5);
          EXPECT_LT(length(at.n - Vec3d(hit.shading.n)), 1e-5);
          EXPECT_NEAR(length(at.ng), 1, 1e-12);
          EXPECT_NEAR(length(at.n), 1, 1e-12);
          EXPECT_TRUE(at.has_shading_derivatives);
          // The line itself goes through it.
          const Vec3d d(ray.direction);
          const Vec3d off = cross(at.p - Vec3d(ray.origin), d) / length(d);
          EXPECT_LT(length(off), 1e-12 * size / std::abs(dot(d, at.ng)));
        });
    EXPECT_GT(met, 200);
  }
}

TEST(SurfacePoints, HaveTheHitsOfRays) {
  for (const Shape& shape : shapes()) {
    SCOPED_TRACE(shape.name);
    Scene::Options options;
    options.parameterized = true;
    const auto scene = scene_of(shape, options);
    visit_points(shape, *scene, 300, [&](const Ray& ray, const SurfaceHit& hit, const CanonicalPoint& point) {
      const SurfaceHit again = scene->points().hit(point);
      EXPECT_EQ(again.shape, hit.shape);
      EXPECT_EQ(again.bsdf, hit.bsdf);
      EXPECT_EQ(again.primitive, hit.primitive);
      EXPECT_EQ(again.distance, 0.0f);
      const float tolerance = 2e-5f / std::abs(dot(ray.direction, hit.ng));
      EXPECT_LT(length(again.p - hit.p), tolerance);
      EXPECT_LT(length(again.ng - hit.ng), tolerance);
      EXPECT_LT(length(again.shading.n - hit.shading.n), tolerance);
      const auto near = [&](float a, float b) {
        const float d = std::abs(a - b);
        EXPECT_LT(std::min(d, 1 - d), 20 * tolerance);  // angles turn around
      };
      // Only if the angle of a disk or a sphere has a meaning.
      if (length(hit.dp_du) > 0.3f && length(hit.dp_dv) > 0.3f) {
        near(again.uv.x, hit.uv.x);
        near(again.uv.y, hit.uv.y);
      }
      EXPECT_LE(again.error, 2 * hit.error + 1e-7f);
    });
  }
}

TEST(SurfacePoints, HaveTheDerivativesOfPlaceAndNormals) {
  for (const Shape& shape : shapes()) {
    SCOPED_TRACE(shape.name);
    const auto scene = scene_of(shape);
    visit_points(shape, *scene, 200, [&](const Ray&, const SurfaceHit&, const CanonicalPoint& point) {
      const SurfaceGeometry at = scene->points().at(point);
      for (const bool second : {false, true}) {
        const double h = 1e-6 * std::max(1.0, std::abs(second ? point.v : point.u));
        CanonicalPoint low = point, high = point;
        (second ? low.v : low.u) -= h;
        (second ? high.v : high.u) += h;
        const SurfaceGeometry a = scene->points().at(low), b = scene->points().at(high);
        const auto near = [&](Vec3d lower, Vec3d higher, Vec3d derivative, double scale) {
          EXPECT_LT(length((higher - lower) / (2 * h) - derivative), 1e-6 * scale);
        };
        const Vec3d dp = second ? at.dp_dv : at.dp_du;
        const double size = std::max(length(at.dp_du), length(at.dp_dv));
        near(a.p, b.p, dp, std::max(size, 1e-3));
        near(a.ng, b.ng, second ? at.dng_dv : at.dng_du, 10);
        near(a.n, b.n, second ? at.dn_dv : at.dn_du, 10);
        EXPECT_LT(std::abs(dot(dp, at.ng)), 1e-12 * size);
      }
    });
  }
}

// Both ends of the parameters' range, where they are infinite or nearly so.
TEST(SurfacePoints, PolesAreOrdinary) {
  const auto scene = scene_of({"sphere", "<shape type=\"sphere\"/>"});
  for (const double offset : {0.0, 1e-12, 1e-6, 1e-3}) {
    const Vec3d from{offset, offset / 2, 5};
    const Ray ray{{static_cast<float>(from.x), static_cast<float>(from.y), 5}, {0, 0, -1}};
    const auto point = scene->points().intersect(ray, from, {0, 0, -1});
    ASSERT_TRUE(point);
    EXPECT_TRUE(scene->points().exists(*point));
    const SurfaceGeometry at = scene->points().at(*point);
    EXPECT_NEAR(at.p.x, from.x, 1e-15);
    EXPECT_NEAR(at.p.y, from.y, 1e-15);
    EXPECT_NEAR(at.p.z, std::sqrt(1 - from.x * from.x - from.y * from.y), 1e-15);
    const double u = length(at.dp_du), v = length(at.dp_dv);
    EXPECT_GT(u, 0);
    EXPECT_LT(std::abs(dot(at.dp_du, at.dp_dv)), 1e-9 * u * v);
    EXPECT_LT(length(at.dng_du - at.dp_du), 1e-9 * u);
  }
  const auto tube = scene_of({"cylinder", "<shape type=\"cylinder\"/>"});
  const auto point = tube->points().intersect({{-5, 0, 0.25f}, {1, 0, 0}});
  ASSERT_TRUE(point);
  const SurfaceGeometry at = tube->points().at(*point);
  EXPECT_LT(length(at.p - Vec3d{-1, 0, 0.25}), 1e-12);
  EXPECT_GT(length(at.dp_du), 0);
}

// A ray in double that starts on a sphere meets its other side, as the rounded ray does.
TEST(SurfacePoints, TheLineMeetsWhatTheRayMeets) {
  const auto scene = scene_of({"sphere", "<shape type=\"sphere\"/>"});
  rng::Stream stream(rng::key(46, 101));
  for (int i = 0; i < 200; ++i) {
    const auto first = scene->points().intersect({{0.1f, 0.2f, 0}, uniform_direction(stream)});
    ASSERT_TRUE(first);
    const SurfaceGeometry here = scene->points().at(*first);
    Vec3d d(uniform_direction(stream));
    if (dot(d, here.ng) > 0) d = -d;
    if (dot(d, here.ng) > -0.1) continue;
    d = normalize(d);
    const auto second = scene->points().intersect(spawn_ray(scene->points().hit(*first), Vec3(d)), here.p, d);
    ASSERT_TRUE(second);
    const Vec3d expected = here.p - d * (2 * dot(here.p, d));
    EXPECT_LT(length(scene->points().at(*second).p - expected), 1e-12);
  }
}

TEST(SurfacePoints, MapsOfNormalsHaveNoDerivatives) {
  const std::string map =
      "<bsdf type=\"normalmap\"><texture type=\"checkerboard\" name=\"normalmap\"/>"
      "<bsdf type=\"diffuse\"/></bsdf>";
  const auto scene = scene_of({"map", "<shape type=\"rectangle\">" + map + "</shape>"});
  const auto point = scene->points().intersect({{0.1f, 0.2f, 3}, {0, 0, -1}});
  ASSERT_TRUE(point);
  EXPECT_FALSE(scene->points().at(*point).has_shading_derivatives);
}

TEST(SurfacePoints, OfOtherScenesDoNotExist) {
  const auto scene = scene_of({"sphere", "<shape type=\"sphere\"/>"});
  CanonicalPoint point;
  point.kind = static_cast<std::uint8_t>(PrimitiveKind::sphere);
  EXPECT_TRUE(scene->points().exists(point));
  const auto refused = [&](auto change) {
    CanonicalPoint other = point;
    change(other);
    EXPECT_FALSE(scene->points().exists(other));
  };
  refused([](CanonicalPoint& p) { p.kind = 9; });
  refused([](CanonicalPoint& p) { p.kind = static_cast<std::uint8_t>(PrimitiveKind::triangle); });
  refused([](CanonicalPoint& p) { p.primitive = 1; });
  refused([](CanonicalPoint& p) { p.instance = 0; });
  refused([](CanonicalPoint& p) { p.u = std::numeric_limits<double>::quiet_NaN(); });
  refused([](CanonicalPoint& p) { p.v = std::numeric_limits<double>::infinity(); });
}

}  // namespace
}  // namespace candela::scene
