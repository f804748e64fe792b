// Claims: the triangles of a Shape directive are those that pbrt has: meshes as they are written, patches and
// parts of quadrics on their surfaces, subdivisions that tend to Loop's limit. Damaged directives are errors
// that name their line.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "worker/loaders/loop_subdivision.h"
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

}  // namespace
}  // namespace candela::loaders
