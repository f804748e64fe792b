// Shapes that become meshes or instances: curves, level sets, creases, and stretched round shapes.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>

#include "tests/unit/scene_fixture.h"
#include "worker/loaders/curves.h"
#include "worker/scene/shapes/creases.h"
#include "worker/scene/shapes/level_set.h"
#include "worker/scene/shapes/tube.h"

namespace candela::scene {
namespace {

using test::build_scene;
using test::uniform_direction;

// ---- curves ----

TEST(SweptCurves, FilesAreReadAndRefused) {
  const auto curves = loaders::load_curves("0 0 0 1\r\n0 0 1 1\n\n\n 1 2 3 0.5 \n1\t2 4 0.5", "c.txt", 2);
  ASSERT_TRUE(curves.ok()) << curves.error().to_string();
  ASSERT_EQ(curves->size(), 2u);
  EXPECT_EQ((*curves)[1][1].p.z, 4);
  EXPECT_EQ((*curves)[1][0].radius, 0.5);
  const std::pair<const char*, const char*> bad[] = {
      {"0 0 0 1\n0 0 1\n", "c.txt:2: a control point is four finite numbers: x y z radius"},
      {"0 0 0 1\n0 0 1 1 1\n", "c.txt:2: a control point is four finite numbers: x y z radius"},
      {"0 0 0 nan\n", "c.txt:1: a control point is four finite numbers: x y z radius"},
      {"0 0 0 -1\n", "c.txt:1: the radius is negative"},
      {"\n0 0 0 1\n\n0 0 0 1\n1 0 0 1\n", "c.txt:2: the curve has 1 control points, but needs 2"},
      {"\n\n", "c.txt: the file holds no curve"},
  };
  for (const auto& [text, error] : bad)
    EXPECT_EQ(loaders::load_curves(text, "c.txt", 2).error().to_string(), error) << text;
}

// Claim: a straight curve of either kind is a cylinder: the distance of hits from its axis is its radius to
// within the polygon's error, and shading normals point away from the axis.
TEST(SweptCurves, StraightOnesAreCylinders) {
  const std::string points = "0 0 -2 0.5\n0 0 -1 0.5\n0 0 0 0.5\n0 0 1 0.5\n0 0 2 0.5\n";
  for (const std::string kind : {"bsplinecurve", "linearcurve"}) {
    const auto scene = build_scene(
        "<shape type='" + kind + "'><string name='filename' value='c.txt'/></shape>", {{"c.txt", points}});
    ASSERT_TRUE(scene.ok()) << scene.error().to_string();
    // A B-spline ends one control point earlier.
    const float half = kind == "linearcurve" ? 2 : 1;
    SurfaceHit end;
    EXPECT_TRUE((*scene)->intersect({{5, 0, half - 0.01f}, {-1, 0, 0}}, end));
    EXPECT_FALSE((*scene)->intersect({{5, 0, half + 0.01f}, {-1, 0, 0}}, end));
    rng::Stream stream(rng::key(1, 7));
    int met = 0;
    double sum = 0;
    for (int i = 0; i < 4000; ++i) {
      Vec3 d = uniform_direction(stream);
      d.z *= 0.2f;
      const Vec3 to{0, 0, stream.next_float() - 0.5f};
      const Vec3 from = to + normalize(d) * 3;
      SurfaceHit hit;
      if (!(*scene)->intersect({from, normalize(to - from)}, hit)) continue;
      ++met;
      const Vec3 out{hit.p.x, hit.p.y, 0};
      sum += static_cast<double>(length(out));
      EXPECT_NEAR(length(out), 0.5f, 0.007f);
      EXPECT_GT(dot(normalize(out), hit.shading.n), 0.9995f);
    }
    EXPECT_GT(met, 3900);
    // A polygon of 16 sides that is as wide as the circle in the mean (perimeter 2 pi r): its corners are at
    // r a / sin a with a = pi / 16, and its mean radius is that times cos a ln(tan(pi / 4 + a / 2)) / a.
    EXPECT_NEAR(sum / met, 0.5 * 0.99352, 0.0005);
  }
}

// Claim: sections of a curve lie on the spline (a circle's control polygon stays as far from its center as
// the spline does), radii follow the control points, and orientation is outside all along.
TEST(SweptCurves, BentOnesFollowTheSpline) {
  loaders::Curve curve;
  for (int i = 0; i < 15; ++i) {
    const double angle = 2 * 3.14159265358979 * i / 12;
    curve.push_back({{std::cos(angle), std::sin(angle), 0}, 0.1 + 0.01 * i});
  }
  const loaders::Mesh mesh = *bspline_tubes({curve});
  ASSERT_FALSE(mesh.triangles.empty());
  // The spline of points at angles of 30 degrees: 2/3 + 1/3 cos(30 degrees) at a knot, less between.
  const double at_knot = 2.0 / 3 + std::cos(3.14159265358979 / 6) / 3;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3 p = mesh.positions[i];
    const double around = std::hypot(static_cast<double>(p.x), static_cast<double>(p.y)) - at_knot;
    const double r = std::hypot(around, static_cast<double>(p.z));
    EXPECT_GT(r, 0.105);
    EXPECT_LT(r, 0.245);
  }
  for (const auto& t : mesh.triangles) {
    const Vec3 a = mesh.positions[t[0]], b = mesh.positions[t[1]], c = mesh.positions[t[2]];
    EXPECT_GT(dot(cross(b - a, c - a), mesh.normals[t[0]]), 0);
  }
}

// Claim: pieces of a curve are joined: the two halves of a straight one make one tube, whose radius goes on
// growing, whose u goes from 0 to 1 along it, and whose v goes around.
TEST(SweptCurves, PiecesAreJoined) {
  loaders::PieceList pieces(2);
  for (std::size_t i = 0; i < 2; ++i)
    for (std::size_t k = 0; k < 4; ++k) {
      const double x = static_cast<double>(i) + static_cast<double>(k) - 1;
      pieces[i][k] = {{0, 0, x}, 0.5 + 0.25 * x};
    }
  const loaders::Mesh mesh = *piecewise_tubes({pieces});
  ASSERT_EQ(mesh.uvs.size(), mesh.positions.size());
  float low = 2, high = 0;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3 p = mesh.positions[i];
    EXPECT_NEAR(mesh.uvs[i].x, p.z / 2, 1e-6f);
    EXPECT_NEAR(std::hypot(p.x, p.y), 0.5f + 0.25f * p.z, 0.01f * (0.5f + 0.25f * p.z));
    low = std::min(low, p.z);
    high = std::max(high, p.z);
  }
  EXPECT_EQ(low, 0);
  EXPECT_EQ(high, 2);
  EXPECT_EQ(mesh.positions.size() % 17, 0U);
  EXPECT_EQ(mesh.triangles.size(), (mesh.positions.size() / 17 - 1) * 32);
  EXPECT_EQ(piecewise_tubes({pieces, pieces})->triangles.size(), 2 * mesh.triangles.size());
}

// Claim: tubes of more triangles than the limit are an error, for one curve as for many.
TEST(SweptCurves, TrianglesAreBounded) {
  loaders::Curve curve;
  for (int i = 0; i < 40; ++i) curve.push_back({{std::cos(1.0 * i), std::sin(1.0 * i), 0.1 * i}, 0.1});
  const loaders::PieceList pieces(40);
  const std::string wanted = "more than 200 triangles";
  const auto message = [](const Result<loaders::Mesh>& mesh) {
    return mesh.ok() ? "no error" : mesh.error().message;
  };
  EXPECT_NE(message(bspline_tubes({curve}, 200)).find(wanted), std::string::npos);
  EXPECT_NE(message(linear_tubes({curve}, 200)).find(wanted), std::string::npos);
  EXPECT_NE(message(piecewise_tubes({pieces}, 200)).find(wanted), std::string::npos);
  const std::vector<loaders::Curve> many(11, {{{0, 0, 0}, 1}, {{0, 0, 1}, 1}});
  EXPECT_NE(message(linear_tubes(many, 200)).find(wanted), std::string::npos);
  EXPECT_TRUE(linear_tubes(many, 20 * 23).ok());
}

// ---- level sets ----

std::string ball_field(std::int32_t n, double radius) {
  std::string out = "VOL\x03";
  const auto put = [&](auto value) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    out.append(bytes, sizeof value);
  };
  for (const std::int32_t v : {1, n, n, n, 1}) put(v);
  for (const float v : {0.0f, 0.0f, 0.0f, 1.0f, 1.0f, 1.0f}) put(v);
  for (std::int32_t z = 0; z < n; ++z)
    for (std::int32_t y = 0; y < n; ++y)
      for (std::int32_t x = 0; x < n; ++x) {
        const auto c = [&](std::int32_t i) { return static_cast<double>(i) / (n - 1) - 0.5; };
        put(static_cast<float>(std::sqrt(c(x) * c(x) + c(y) * c(y) + c(z) * c(z)) - radius));
      }
  return out;
}

// Claim: the distance field of a ball is a closed ball of its radius, whose normals point away from its
// center; rays from inside always meet it.
TEST(LevelSet, ABallIsABall) {
  const auto scene = build_scene("<shape type='sdfgrid'><string name='filename' value='ball.vol'/></shape>",
                                 {{"ball.vol", ball_field(17, 0.3)}});
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  rng::Stream stream(rng::key(1, 8));
  for (int i = 0; i < 4000; ++i) {
    const Vec3 d = uniform_direction(stream);
    const Vec3 center{0.5f, 0.5f, 0.5f};
    SurfaceHit hit;
    ASSERT_TRUE((*scene)->intersect({center + uniform_direction(stream) * 0.1f, d}, hit)) << i;
    const Vec3 out = hit.p - center;
    EXPECT_NEAR(length(out), 0.3f, 0.005f);  // what trilinear cells of 1 / 16 lose is 0.0033
    EXPECT_GT(dot(normalize(out), hit.shading.n), 0.99f);
    EXPECT_GT(dot(out, hit.ng), 0);
  }
}

TEST(LevelSet, SenselessFieldsAreRefused) {
  const auto error = [](const std::string& field) {
    const auto scene = build_scene("<shape type='sdfgrid'><string name='filename' value='f.vol'/></shape>",
                                   {{"f.vol", field}});
    return scene.ok() ? std::string("none") : scene.error().message;
  };
  EXPECT_EQ(error(ball_field(9, -1)), "the distance field is zero nowhere");
  EXPECT_EQ(error(ball_field(9, 0.3).substr(0, 100)), "the volume claims 729 values, but the file holds 13");
}

// ---- creases ----

loaders::Mesh roof(float height) {
  loaders::Mesh mesh;
  mesh.positions = {{0, 0, 0}, {0, 1, 0}, {1, 0, height}, {1, 1, height}, {2, 0, 0}, {2, 1, 0}};
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {2, 4, 3}, {3, 4, 5}};
  return mesh;
}

// Claim: a roof's ridge is split where its sides meet at more than the angle, and is not elsewhere; vertices
// that are written twice in one place are joined.
TEST(Creases, SplitWhereFacesMeetSteeply) {
  const Transform identity(description::Object{}.get_transform("to_world"));
  // Both sides rise at 45 degrees: normals differ by 90.
  EXPECT_EQ(split_at_creases(roof(1), identity, 80).positions.size(), 8u);
  EXPECT_EQ(split_at_creases(roof(1), identity, 100).positions.size(), 6u);
  EXPECT_EQ(split_at_creases(roof(0), identity, 0).positions.size(), 6u);
  loaders::Mesh loose;
  for (const auto& t : roof(1).triangles)
    for (const std::uint32_t v : t) {
      loose.triangles.resize(loose.positions.size() / 3 + 1);
      loose.triangles.back()[loose.positions.size() % 3] = static_cast<std::uint32_t>(loose.positions.size());
      loose.positions.push_back(roof(1).positions[v]);
    }
  loose.normals.assign(12, {0, 0, 1});
  const loaders::Mesh joined = split_at_creases(loose, identity, 100);
  EXPECT_EQ(joined.positions.size(), 6u);
  EXPECT_TRUE(joined.normals.empty());
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_EQ(joined.positions[joined.triangles[i][k]], roof(1).positions[roof(1).triangles[i][k]]);
}

// ---- stretched shapes ----

// Claim: an uneven to_world makes an ellipse of a disk, an ellipsoid of a sphere and a cylinder over an
// ellipse; the hit is where the quadric's equation says.
TEST(Stretched, RoundShapesBecomeElliptic) {
  const auto shoot = [](const std::string& shape, Vec3 from, Vec3 to, SurfaceHit& hit) {
    const auto scene = build_scene("<shape type='" + shape +
                                   "'><transform name='to_world'><scale x='3' y='1' z='2'/>"
                                   "<translate x='5'/></transform></shape>");
    EXPECT_TRUE(scene.ok()) << scene.error().to_string();
    return scene.ok() && (*scene)->intersect({from, normalize(to - from)}, hit);
  };
  SurfaceHit hit;
  EXPECT_TRUE(shoot("disk", {7.9f, 0, 4}, {7.9f, 0, 0}, hit));
  EXPECT_FALSE(shoot("disk", {7.9f, 0.5f, 4}, {7.9f, 0.5f, 0}, hit));
  EXPECT_TRUE(shoot("disk", {5, 0.9f, 4}, {5, 0.9f, 0}, hit));
  ASSERT_TRUE(shoot("sphere", {5, 0, 9}, {5, 0, 0}, hit));
  EXPECT_NEAR(hit.p.z, 2, 1e-5f);
  ASSERT_TRUE(shoot("sphere", {20, 0, 0}, {5, 0, 0}, hit));
  EXPECT_NEAR(hit.p.x, 8, 1e-5f);
  EXPECT_NEAR(hit.ng.x, 1, 1e-5f);
  ASSERT_TRUE(shoot("cylinder", {5, 9, 1}, {5, 0, 1}, hit));
  EXPECT_NEAR(hit.p.y, 1, 1e-5f);
  EXPECT_FALSE(shoot("cylinder", {5, 9, 2.1f}, {5, 0, 2.1f}, hit));
  ASSERT_TRUE(shoot("cylinder", {20, 0, 1}, {5, 0, 1}, hit));
  EXPECT_NEAR(hit.p.x, 8, 1e-5f);
}

}  // namespace
}  // namespace candela::scene
