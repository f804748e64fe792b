// Claims: the triangles of a Shape directive are those that pbrt has: meshes as they are written, patches and
// parts of quadrics on their surfaces, subdivisions that tend to Loop's limit. Damaged directives are errors
// that name their line.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "common/rng/stream.h"
#include "worker/loaders/loop_subdivision.h"
#include "worker/loaders/pbrt_cloud.h"
#include "worker/loaders/pbrt_curve.h"
#include "worker/loaders/pbrt_grid.h"
#include "worker/loaders/pbrt_mesh.h"

namespace candela::loaders {
namespace {

Mesh pbrt_mesh(const std::string& directive) {
  auto mesh = load_pbrt_shape(directive, "a.pbrt", 0, 1);
  EXPECT_TRUE(mesh.ok()) << mesh.error().to_string();
  return mesh.ok() ? std::move(mesh).value() : Mesh{};
}

std::string pbrt_error(const std::string& bytes, std::int64_t offset = 0) {
  auto mesh = load_pbrt_shape(bytes, "a.pbrt", offset, 7);
  return mesh.ok() ? "no error" : mesh.error().to_string();
}

TEST(PbrtMesh, TriangleMeshIsAsWritten) {
  const std::string before = "Material \"diffuse\"\n";
  const std::string shape =
      "Shape \"trianglemesh\" \"integer indices\" [0 1 2 2 1 3] \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0.5]\n"
      "  \"normal N\" [0 0 1 0 0 1 0 0 1 0 0 1] \"point2 uv\" [0 0 1 0 0 1 1 1] Shape \"sphere\"";
  const auto mesh = load_pbrt_shape(before + shape, "a.pbrt", static_cast<std::int64_t>(before.size()), 2);
  ASSERT_TRUE(mesh.ok()) << mesh.error().to_string();
  ASSERT_EQ(mesh->triangles.size(), 2U);
  EXPECT_EQ(mesh->triangles[1], (std::array<std::uint32_t, 3>{2, 1, 3}));
  ASSERT_EQ(mesh->positions.size(), 4U);
  EXPECT_EQ(mesh->positions[3], (Vec3{1, 1, 0.5f}));
  EXPECT_EQ(mesh->normals.size(), 4U);
  EXPECT_EQ(mesh->uvs[2].y, 1);
  // One triangle needs no indices.
  EXPECT_EQ(pbrt_mesh("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]").triangles.size(), 1U);
}

// Claim: numbers of a list are what they say, however they are written and whatever stands between them; what
// is none is an error of its line.
TEST(PbrtMesh, NumbersOfEverySpelling) {
  const Mesh mesh = pbrt_mesh(
      "Shape \"trianglemesh\" \"integer indices\" [0 1 2\t2 1 3e0] \"point3 P\" [+1 .5 -.25\r\n2. 1e1 -0 # "
      "7\n"
      "0.1 123456789.123456789 -12.5E-1 3 4 5]");
  ASSERT_EQ(mesh.positions.size(), 4U);
  EXPECT_EQ(mesh.positions[0], (Vec3{1, 0.5f, -0.25f}));
  EXPECT_EQ(mesh.positions[1], (Vec3{2, 10, 0}));
  EXPECT_EQ(mesh.positions[2], (Vec3{0.1f, 123456789.123456789f, -1.25f}));
  EXPECT_EQ(mesh.triangles.back(), (std::array<std::uint32_t, 3>{2, 1, 3}));
  EXPECT_EQ(pbrt_error("Shape \"trianglemesh\" \"point3 P\" [0 1 2\n3 4x 5]").substr(0, 9), "a.pbrt:8:");
  EXPECT_EQ(pbrt_error("Shape \"trianglemesh\" \"integer indices\" [0 1\n\n 2.5]").substr(0, 9), "a.pbrt:9:");
}

TEST(PbrtMesh, FlatPatchesAreTwoTriangles) {
  const Mesh flat = pbrt_mesh("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 2 0 0 0 1 0 2 1 0]");
  EXPECT_EQ(flat.triangles.size(), 2U);
  for (const Vec3& n : flat.normals) EXPECT_EQ(n, (Vec3{0, 0, 2}));
  EXPECT_EQ(flat.uvs[3].x, 1);
  EXPECT_EQ(flat.uvs[3].y, 1);
}

TEST(PbrtMesh, OtherPatchesLieOnTheirSurface) {
  // z = u v
  const Mesh saddle = pbrt_mesh("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1]");
  EXPECT_GT(saddle.triangles.size(), 100U);
  for (std::size_t i = 0; i < saddle.positions.size(); ++i) {
    const Vec3 p = saddle.positions[i], n = saddle.normals[i];
    EXPECT_NEAR(p.z, p.x * p.y, 1e-6f);
    EXPECT_NEAR(n.x, -p.y, 1e-6f);
    EXPECT_NEAR(n.y, -p.x, 1e-6f);
    EXPECT_EQ(n.z, 1);
  }
}

TEST(PbrtMesh, PartsOfQuadricsLieOnThem) {
  const Mesh cap = pbrt_mesh("Shape \"sphere\" \"float radius\" 2 \"float zmin\" 1 \"float phimax\" 90");
  float highest = 0, lowest = 2;
  for (std::size_t i = 0; i < cap.positions.size(); ++i) {
    const Vec3 p = cap.positions[i];
    EXPECT_NEAR(length(p), 2, 1e-6f);
    EXPECT_NEAR(dot(cap.normals[i], p), 2, 1e-6f);
    EXPECT_GT(p.x, -1e-6f);
    EXPECT_GT(p.y, -1e-6f);
    highest = std::max(highest, p.z);
    lowest = std::min(lowest, p.z);
  }
  EXPECT_NEAR(highest, 2, 1e-6f);
  EXPECT_NEAR(lowest, 1, 1e-6f);
  double area = 0;
  const Mesh ring = pbrt_mesh("Shape \"disk\" \"float radius\" 2 \"float innerradius\" 1 \"float height\" 3");
  for (const auto& t : ring.triangles) {
    const Vec3 a = ring.positions[t[0]];
    area += 0.5 * static_cast<double>(length(cross(ring.positions[t[1]] - a, ring.positions[t[2]] - a)));
  }
  EXPECT_NEAR(area, 3 * 3.14159265, 0.01);
  for (const Vec3& p : ring.positions) EXPECT_EQ(p.z, 3);
  for (const Vec3& p : pbrt_mesh("Shape \"cylinder\" \"float radius\" 2 \"float phimax\" 180").positions)
    EXPECT_NEAR(p.x * p.x + p.y * p.y, 4, 1e-5f);
}

Mesh tetrahedron() {
  Mesh mesh;
  mesh.positions = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  mesh.triangles = {{0, 1, 2}, {0, 3, 1}, {0, 2, 3}, {1, 3, 2}};
  return mesh;
}

// Claim: levels change how finely the limit surface is sampled, not the surface. A vertex of a tetrahedron
// moves to a fifth of its distance: v (1 - 3 / 5) + (sum of the others, -v) / 5.
TEST(LoopSubdivision, TendsToOneSurface) {
  for (int levels = 0; levels < 5; ++levels) {
    const Mesh mesh = loop_subdivision(tetrahedron(), levels);
    EXPECT_EQ(mesh.triangles.size(), 4U << (2 * levels));
    // Euler: a closed surface stays one.
    EXPECT_EQ(mesh.positions.size(), mesh.triangles.size() / 2 + 2);
    for (std::size_t v = 0; v < 4; ++v) {
      const Vec3 corner = tetrahedron().positions[v];
      EXPECT_NEAR(length(mesh.positions[v] - corner * 0.2f), 0, 1e-6f) << levels;
    }
  }
}

// Claim: a flat sheet stays in its plane, and its outline shrinks only at corners.
TEST(LoopSubdivision, SheetsStayFlat) {
  const Mesh mesh = pbrt_mesh(
      "Shape \"loopsubdiv\" \"integer levels\" 3 \"point3 P\" [0 0 5 1 0 5 2 0 5 0 1 5 1 1 5 2 1 5 0 2 5 1 2 "
      "5 2 2 5]\n"
      "\"integer indices\" [0 1 4 0 4 3 1 2 5 1 5 4 3 4 7 3 7 6 4 5 8 4 8 7]");
  EXPECT_EQ(mesh.triangles.size(), 8U * 64);
  for (const Vec3& p : mesh.positions) {
    EXPECT_NEAR(p.z, 5, 1e-6f);
    EXPECT_GT(p.x, -1e-6f);
    EXPECT_LT(p.x, 2 + 1e-6f);
  }
  EXPECT_NEAR(mesh.positions[1].y, 0, 1e-6f);
  EXPECT_NEAR(mesh.positions[4].x, 1, 1e-6f);
}

TEST(PbrtMesh, DamagedDirectivesAreErrors) {
  EXPECT_EQ(pbrt_error("Shape \"trianglemesh\""),
            "a.pbrt:7: the mesh has no vertices: the parameter 'P' is missing");
  EXPECT_EQ(pbrt_error("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0]"),
            "a.pbrt:7: the mesh has no indices");
  EXPECT_EQ(
      pbrt_error("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]\n\"integer indices\" [0 1 3]"),
      "a.pbrt:8: an index is outside of the mesh's 3 vertices");
  EXPECT_EQ(
      pbrt_error("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 -1 2]"),
      "a.pbrt:7: an index is outside of the mesh's 3 vertices");
  EXPECT_EQ(pbrt_error("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1]"),
            "a.pbrt:7: the number of indices is no multiple of 3");
  EXPECT_EQ(pbrt_error("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"point2 uv\" [0 0]"),
            "a.pbrt:7: the mesh has 3 positions, but 1 normals or texture coordinates");
  EXPECT_EQ(pbrt_error("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1e300 0]"),
            "a.pbrt:7: a number of parameter 'P' is too large");
  EXPECT_EQ(pbrt_error("Shape \"loopsubdiv\" \"integer levels\" 40 \"point3 P\" [0 0 0 1 0 0 0 1 0]"),
            "a.pbrt:7: a subdivision of 40 levels has too many triangles");
  EXPECT_EQ(pbrt_error("Shape \"sphere\" \"float zmin\" 2"),
            "a.pbrt:7: the shape's parameters leave nothing of it");
  EXPECT_EQ(pbrt_error("Shape \"curve\""), "a.pbrt:7: a shape 'curve' is not made of triangles");
  EXPECT_EQ(pbrt_error("Shape"), "a.pbrt:7: the Shape directive names no type");
  EXPECT_EQ(pbrt_error("Scale 1 1 1", 6), "a.pbrt:7: no Shape directive begins at byte 6");
  EXPECT_EQ(pbrt_error("Scale", 5), "a.pbrt:7: the offset of a shape lies outside of the file");
}

std::vector<PieceList> pbrt_curves(const std::string& text, std::int64_t count = 1) {
  auto curves = load_pbrt_curves(text, "a.pbrt", 0, 1, count);
  EXPECT_TRUE(curves.ok()) << curves.error().to_string();
  return curves.ok() ? std::move(curves).value() : std::vector<PieceList>{};
}

std::string curve_error(const std::string& text, std::int64_t count = 1) {
  auto curves = load_pbrt_curves(text, "a.pbrt", 0, 7, count);
  return curves.ok() ? "no error" : curves.error().to_string();
}

// A uniform cubic B-spline by its blossom: repeated interpolation between its control points.
ControlPoint on_piece(const CubicPiece& piece, double t) {
  std::array<Vec3d, 4> p;
  std::array<double, 4> r{};
  for (std::size_t i = 0; i < 4; ++i) {
    p[i] = piece[i].p;
    r[i] = piece[i].radius;
  }
  for (int level = 1; level <= 3; ++level)
    for (int i = 0; i + level < 4; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double a = (t - (i + level - 3)) / (4 - level);  // knots -2 .. 3
      p[k] = p[k] * (1 - a) + p[k + 1] * a;
      r[k] = r[k] * (1 - a) + r[k + 1] * a;
    }
  return {p[0], r[0]};
}

void expect_near(Vec3d a, Vec3d b) {
  EXPECT_NEAR(a.x, b.x, 1e-12);
  EXPECT_NEAR(a.y, b.y, 1e-12);
  EXPECT_NEAR(a.z, b.z, 1e-12);
}

// Claim: Bezier curves and B-splines of both degrees are the polynomials that their control points define,
// and the radius is half of the width, linear in the parameter of the whole curve.
TEST(PbrtCurve, PiecesAreTheDirectivesPolynomials) {
  const auto cubic = pbrt_curves(
      "Shape \"curve\" \"point3 P\" [0 0 0 1 2 0 3 3 0 4 0 1 5 -3 2 6 0 0 7 1 1] \"float width0\" 4 \"float "
      "width1\" 0");
  ASSERT_EQ(cubic.size(), 1U);
  ASSERT_EQ(cubic[0].size(), 2U);
  expect_near(on_piece(cubic[0][0], 0).p, {0, 0, 0});
  expect_near(on_piece(cubic[0][0], 0.5).p, {2, 15.0 / 8, 0.125});
  expect_near(on_piece(cubic[0][0], 1).p, {4, 0, 1});
  expect_near(on_piece(cubic[0][1], 0).p, {4, 0, 1});
  expect_near(on_piece(cubic[0][1], 1).p, {7, 1, 1});
  EXPECT_NEAR(on_piece(cubic[0][0], 0).radius, 2, 1e-12);
  EXPECT_NEAR(on_piece(cubic[0][0], 0.5).radius, 1.5, 1e-12);
  EXPECT_NEAR(on_piece(cubic[0][1], 1).radius, 0, 1e-12);
  const auto quadratic =
      pbrt_curves("Shape \"curve\" \"integer degree\" 2 \"point3 P\" [0 0 0 1 2 0 2 0 0] \"float width\" 3");
  ASSERT_EQ(quadratic[0].size(), 1U);
  expect_near(on_piece(quadratic[0][0], 0.5).p, {1, 1, 0});
  expect_near(on_piece(quadratic[0][0], 0.25).p, {0.5, 0.75, 0});
  EXPECT_NEAR(on_piece(quadratic[0][0], 0.25).radius, 1.5, 1e-12);
  const auto spline = pbrt_curves(
      "Shape \"curve\" \"string basis\" \"bspline\" \"point3 P\" [0 0 0 1 6 0 2 0 0 3 0 0 4 0 0]");
  ASSERT_EQ(spline[0].size(), 2U);
  expect_near(on_piece(spline[0][0], 0).p, {1, 4, 0});
  expect_near(on_piece(spline[0][1], 0).p, {2, 1, 0});
  const auto hoop = pbrt_curves(
      "Shape \"curve\" \"string basis\" \"bspline\" \"integer degree\" 2 \"point3 P\" [0 0 0 2 4 0 4 0 0]");
  ASSERT_EQ(hoop[0].size(), 1U);
  expect_near(on_piece(hoop[0][0], 0).p, {1, 2, 0});
  expect_near(on_piece(hoop[0][0], 0.5).p, {2, 3, 0});
  expect_near(on_piece(hoop[0][0], 1).p, {3, 2, 0});
}

// Claim: several directives are read where the first one begins; what is no curve is an error at its line.
TEST(PbrtCurve, DirectivesFollowEachOther) {
  const std::string one = "Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]\n";
  EXPECT_EQ(pbrt_curves(one + one + one + "Shape \"sphere\"", 3).size(), 3U);
  EXPECT_NE(curve_error(one + one, 3).find("no directive"), std::string::npos) << curve_error(one + one, 3);
  const std::string other = curve_error(one + "Shape \"sphere\"", 2);
  EXPECT_NE(other.find("a.pbrt:8"), std::string::npos) << other;
  for (const std::string wrong :
       {"\"point3 P\" [0 0 0 1 0 0 2 0 0]", "\"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0 4 0 0]",
        "\"float width\" 1", "\"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0] \"float width\" -1",
        "\"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0] \"integer degree\" 4",
        "\"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0] \"string basis\" \"hermite\"",
        "\"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0] \"string type\" \"tape\"",
        "\"point3 P\" [0 0 0 1 0 0 2 0 0 1e300 0 0]"})
    EXPECT_NE(curve_error("Shape \"curve\" " + wrong).find("a.pbrt:7"), std::string::npos) << wrong;
}

// Claim: more pieces than the limit are an error at the line of the directive that has them, before they take
// memory.
TEST(PbrtCurve, PiecesAreBounded) {
  const std::string one = "Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0 4 0 0 5 0 0 6 0 0]\n";
  EXPECT_TRUE(load_pbrt_curves(one + one + one, "a.pbrt", 0, 7, 3, 6).ok());
  const auto bad = load_pbrt_curves(one + one + one, "a.pbrt", 0, 7, 3, 5);
  ASSERT_FALSE(bad.ok());
  EXPECT_NE(bad.error().to_string().find("a.pbrt:9"), std::string::npos) << bad.error().to_string();
}

// Claim: the densities of a medium are read where its directive begins, x fastest; a list that is not as long
// as the grid and negative densities are errors at their line.
TEST(PbrtGrid, DensitiesAreAsWritten) {
  const std::string before = "WorldBegin\n";
  const std::string medium =
      "MakeNamedMedium \"smoke\" \"string type\" \"uniformgrid\" \"integer nx\" 2 \"integer nz\" [ 3 ]\n"
      "  \"float density\" [ 0 1 2 3 4.5 1e-50 ] \"rgb sigma_a\" [ 1 1 1 ]";
  const auto grid = load_pbrt_grid(before + medium, "a.pbrt", static_cast<std::int64_t>(before.size()), 2);
  ASSERT_TRUE(grid.ok()) << grid.error().to_string();
  EXPECT_EQ(grid->size, (std::array<std::uint32_t, 3>{2, 1, 3}));
  EXPECT_EQ(grid->channels, 1U);
  EXPECT_EQ(grid->values, (std::vector<float>{0, 1, 2, 3, 4.5f, 0}));
  const std::string directive = "MakeNamedMedium \"m\" ";
  for (const std::string& wrong :
       {directive, directive + "\"float density\" [ 1 2 ]", directive + "\"float density\" -1",
        directive + "\"float density\" 1e60", directive + "\"integer nx\" 0 \"float density\" []",
        directive + "\"integer nx\" 9000000 \"integer ny\" 9000000 \"float density\" 1",
        std::string("Medium \"m\""), std::string("MakeNamedMedium m"), std::string()}) {
    const auto bad = load_pbrt_grid(wrong, "a.pbrt", 0, 7);
    EXPECT_NE((bad.ok() ? "no error" : bad.error().to_string()).find("a.pbrt:7"), std::string::npos) << wrong;
  }
}

// Claim: colors of a medium 'rgbgrid' give extinction and albedo of each cell; a coefficient that is not
// there is 1.
TEST(PbrtGrid, ColorsAreExtinctionAndAlbedo) {
  const std::string medium =
      "MakeNamedMedium \"m\" \"string type\" \"rgbgrid\" \"integer nx\" 2 \"rgb sigma_a\" [ 1 0 3 0 0 0 ]";
  const auto extinction =
      load_pbrt_grid(medium + "\"rgb sigma_s\" [ 1 2 1 0 0 6 ]", "a.pbrt", 0, 1, "sigma_t");
  ASSERT_TRUE(extinction.ok()) << extinction.error().to_string();
  EXPECT_EQ(extinction->channels, 3U);
  EXPECT_EQ(extinction->values, (std::vector<float>{2, 2, 4, 0, 0, 6}));
  const auto albedo = load_pbrt_grid(medium + "\"rgb sigma_s\" [ 1 2 1 0 0 6 ]", "a.pbrt", 0, 1, "albedo");
  ASSERT_TRUE(albedo.ok()) << albedo.error().to_string();
  EXPECT_EQ(albedo->values, (std::vector<float>{0.5f, 1, 0.25f, 0, 0, 1}));
  const auto alone = load_pbrt_grid(medium, "a.pbrt", 0, 1, "sigma_t");
  ASSERT_TRUE(alone.ok()) << alone.error().to_string();
  EXPECT_EQ(alone->values, (std::vector<float>{2, 1, 4, 1, 1, 1}));
  for (const std::string& wrong :
       {std::string("MakeNamedMedium \"m\" \"rgb sigma_a\" [ -1 0 0 ]"), std::string("MakeNamedMedium \"m\""),
        medium + "\"rgb sigma_s\" [ 1 2 1 ]"})
    EXPECT_FALSE(load_pbrt_grid(wrong, "a.pbrt", 0, 7, "albedo").ok()) << wrong;
}

// Claim: the noise is Perlin's: 0 on the lattice, with a slope of two components of +-1 there, of mean 0 and
// within -1 and 1. A cloud is 1 at the ground and 0 at the top, and the grid holds its values at the centers
// of cells.
TEST(PbrtCloud, IsNoiseThatThinsOutWithHeight) {
  EXPECT_EQ(gradient_noise({3, -2, 17}), 0);
  // Near a corner of the lattice the noise is its gradient times the way from there; gradients have two
  // components of +1 or -1.
  for (int i = 0; i < 50; ++i) {
    const Vec3 corner{static_cast<float>(i * 7 - 100), static_cast<float>(3 * i), static_cast<float>(-i)};
    const float h = 1e-3f;
    const float x = gradient_noise(corner + Vec3{h, 0, 0}) / h,
                y = gradient_noise(corner + Vec3{0, h, 0}) / h,
                z = gradient_noise(corner + Vec3{0, 0, h}) / h;
    EXPECT_NEAR(std::abs(x) + std::abs(y) + std::abs(z), 2, 0.2f);
  }
  rng::Stream stream(rng::key(92));
  double sum = 0, low = 1, high = -1;
  for (int i = 0; i < 20000; ++i) {
    const auto next = [&] { return 40 * stream.next_float() - 20; };
    const float x = next(), y = next();
    const auto v = static_cast<double>(gradient_noise({x, y, next()}));
    sum += v;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  EXPECT_NEAR(sum / 20000, 0, 0.01);
  EXPECT_GT(low, -1.01);
  EXPECT_LT(high, 1.01);
  const PbrtCloud cloud;
  EXPECT_EQ(cloud.at({0.3f, 0, 0.4f}), 1);  // at the ground
  EXPECT_EQ(cloud.at({0.3f, 1, 0.4f}), 0);  // at the top
  const std::string directive =
      "MakeNamedMedium \"c\" \"string type\" \"cloud\" \"float frequency\" 3 \"point3 p1\" [ 1 2 1 ]";
  const auto grid = load_pbrt_grid(directive, "a.pbrt", 0, 1);
  ASSERT_TRUE(grid.ok()) << grid.error().to_string();
  EXPECT_EQ(grid->size, (std::array<std::uint32_t, 3>{128, 128, 128}));
  PbrtCloud three;
  three.frequency = 3;
  const auto cell = [](int i, float extent) { return (static_cast<float>(i) + 0.5f) / 128 * extent; };
  for (const auto& [x, y, z] : {std::array{7, 40, 100}, {0, 0, 0}, {127, 20, 3}, {64, 70, 64}})
    EXPECT_NEAR(grid->values[static_cast<std::size_t>((z * 128 + y) * 128 + x)],
                three.at({cell(x, 1), cell(y, 2), cell(z, 1)}), 1e-4f)
        << x;
  EXPECT_FALSE(load_pbrt_grid(directive + " \"float density\" 1e9", "a.pbrt", 0, 1).ok());
}

// Claim: whatever the bytes of a directive, the answer is curves, a grid, or one error; grids are as large as
// they say.
TEST(PbrtGrid, MutatedDirectivesAreReadOrErrors) {
  const std::string seeds[] = {
      "Shape \"curve\" \"point3 P\" [ 0 0 0 1 0 0 2 1 0 3 0 0 ] \"float width0\" 0.1 \"string basis\" "
      "\"bspline\"\n"
      "Shape \"curve\" \"integer degree\" 2 \"point3 P\" [ 0 0 0 1 0 0 2 1 0 ] \"string type\" \"flat\"",
      "MakeNamedMedium \"m\" \"integer nx\" 2 \"integer ny\" 1 \"integer nz\" 3 \"float density\" [ 0 1 2 3 "
      "4 5 ]"};
  rng::Stream stream(rng::key(91));
  const std::string alphabet = "0123456789-+.e[]\" \nPxyz";
  std::size_t read = 0;
  for (int i = 0; i < 20000; ++i) {
    std::string bytes = seeds[i % 2];
    for (std::uint32_t k = stream.next_u32() % 4; k > 0; --k)
      bytes[stream.next_u32() % bytes.size()] = alphabet[stream.next_u32() % alphabet.size()];
    if (stream.next_u32() % 8 == 0) bytes.resize(stream.next_u32() % bytes.size());
    if (const auto curves = load_pbrt_curves(bytes, "a.pbrt", 0, 1, 2); curves.ok()) {
      ++read;
      EXPECT_EQ(curves->size(), 2U);
    } else {
      EXPECT_FALSE(curves.error().message.empty());
    }
    if (const auto grid = load_pbrt_grid(bytes, "a.pbrt", 0, 1); grid.ok()) {
      ++read;
      EXPECT_EQ(grid->values.size(), std::size_t{grid->size[0]} * grid->size[1] * grid->size[2]);
    } else {
      EXPECT_FALSE(grid.error().message.empty());
    }
  }
  EXPECT_GT(read, 4000U);
}

}  // namespace
}  // namespace candela::loaders
