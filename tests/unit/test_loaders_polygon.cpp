// Claims: polygons of OBJ and PLY files are covered exactly, whichever corner comes first: the triangles turn
// as the polygon does and have its area together. So are those with touching edges and with holes at the ends
// of bridges. Convex ones stay fans. Polygons of very many corners take seconds at most.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <numbers>
#include <string>
#include <vector>

#include "common/rng/stream.h"
#include "tests/unit/shared_cases.h"
#include "worker/core/math.h"
#include "worker/loaders/mesh.h"

namespace candela::loaders {
namespace {

using Ring = std::vector<Vec2>;

Vec3d normal_of(const Mesh& mesh, std::size_t i) {
  const auto& t = mesh.triangles[i];
  const Vec3d a(mesh.positions[t[0]]), b(mesh.positions[t[1]]), c(mesh.positions[t[2]]);
  return cross(b - a, c - a) * 0.5;
}

struct Cover {
  std::size_t triangles = 0;
  double area = 0, with_sign = 0;  // along `up`
};
Cover cover_of(const Mesh& mesh, Vec3d up = {0, 0, 1}) {
  Cover out;
  out.triangles = mesh.triangles.size();
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const double part = dot(normal_of(mesh, i), up);
    out.area += std::abs(part);
    out.with_sign += part;
  }
  return out;
}

double shoelace(const Ring& ring) {
  double sum = 0;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Vec2 a = ring[i], b = ring[(i + 1) % ring.size()];
    sum += static_cast<double>(a.x) * static_cast<double>(b.y) -
           static_cast<double>(b.x) * static_cast<double>(a.y);
  }
  return sum / 2;
}

Mesh of_obj(const Ring& ring) {
  std::string text;
  for (const Vec2 p : ring) text += fmt::format("v {} {} 0\n", p.x, p.y);
  text += "f";
  for (std::size_t i = 1; i <= ring.size(); ++i) text += fmt::format(" {}", i);
  auto mesh = load_obj(text + "\n", "a.obj", false);
  EXPECT_TRUE(mesh.ok()) << mesh.error().to_string();
  return mesh.ok() ? std::move(mesh).value() : Mesh{};
}

Mesh of_ply(const Ring& ring) {
  std::string text = fmt::format(
      "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list int int vertex_indices\nend_header\n",
      ring.size());
  for (const Vec2 p : ring) text += fmt::format("{} {} 0\n", p.x, p.y);
  text += fmt::format("{}", ring.size());
  for (std::size_t i = 0; i < ring.size(); ++i) text += fmt::format(" {}", i);
  auto mesh = load_ply(text + "\n", "a.ply");
  EXPECT_TRUE(mesh.ok()) << mesh.error().to_string();
  return mesh.ok() ? std::move(mesh).value() : Mesh{};
}

Ring turned(Ring ring, std::size_t first) {
  std::rotate(ring.begin(), ring.begin() + static_cast<std::ptrdiff_t>(first), ring.end());
  return ring;
}

void expect_covered(const Ring& ring, const std::string& what) {
  const double area = shoelace(ring);
  for (std::size_t first = 0; first < ring.size(); ++first) {
    const Ring from = turned(ring, first);
    Ring back = from;
    std::reverse(back.begin(), back.end());
    for (const auto& [mesh, sign] :
         {std::pair(of_obj(from), 1.0), std::pair(of_obj(back), -1.0), std::pair(of_ply(from), 1.0)}) {
      const Cover cover = cover_of(mesh);
      EXPECT_EQ(cover.triangles, ring.size() - 2) << what << " from corner " << first;
      EXPECT_NEAR(cover.area, area, 1e-9 * area) << what << " from corner " << first;
      EXPECT_NEAR(cover.with_sign, sign * area, 1e-9 * area) << what << " from corner " << first;
    }
  }
}

TEST(Polygon, ConcaveOnesAreCoveredFromEveryCorner) {
  expect_covered({{-1, -1}, {0, -0.2f}, {1, -1}, {0, 1}}, "dart");
  expect_covered({{-1, -1}, {-0.3f, -1}, {-0.3f, 0.3f}, {0.3f, 0.3f}, {0.3f, -1}, {1, -1}, {1, 1}, {-1, 1}},
                 "wall with a door");
  expect_covered({{0, 0}, {3, 0}, {3, 1}, {2, 1}, {2, 2}, {1, 2}, {1, 1}, {0, 1}}, "T");
  expect_covered({{0, 0},
                  {4, 0},
                  {4, 3},
                  {1, 3},
                  {1, 1},
                  {3, 1},
                  {3, 2},
                  {2, 2},
                  {2, 1.5f},
                  {2.5f, 1.5f},
                  {2.5f, 1.25f},
                  {1.5f, 1.25f},
                  {1.5f, 2.5f},
                  {3.5f, 2.5f},
                  {3.5f, 0.5f},
                  {0.5f, 0.5f},
                  {0.5f, 3},
                  {0, 3}},
                 "spiral");
}

TEST(Polygon, TouchingEdgesAndHolesAreCovered) {
  // A square with one square hole: there over a bridge and back.
  const Ring hole = {{0, 0}, {4, 0}, {4, 4}, {0, 4}, {0, 0}, {1, 1}, {1, 3}, {3, 3}, {3, 1}, {1, 1}};
  EXPECT_EQ(shoelace(hole), 12);
  expect_covered(hole, "keyhole");
  // Two holes at bridges from one corner, and a bridge that ends within an edge.
  expect_covered({{0, 0},
                  {6, 0},
                  {6, 4},
                  {0, 4},
                  {0, 0},
                  {1, 1},
                  {1, 3},
                  {2, 3},
                  {2, 1},
                  {1, 1},
                  {0, 0},
                  {4, 1},
                  {4, 3},
                  {5, 3},
                  {5, 1},
                  {4, 1}},
                 "two keyholes");
  expect_covered({{0, 0}, {2, 0}, {2, 1}, {1, 2}, {2, 3}, {3, 2}, {2, 1}, {2, 0}, {4, 0}, {4, 4}, {0, 4}},
                 "a bridge from an edge");
  // The outline touches itself at a corner, from inside and from outside, and along an edge.
  expect_covered({{0, 0}, {4, 0}, {4, 4}, {2, 0}, {0, 4}}, "a tooth that touches the edge");
  expect_covered({{0, 0}, {1, 1}, {2, 0}, {2, 2}, {1, 1}, {0, 2}}, "two triangles at a corner");
  expect_covered({{0, 0}, {4, 0}, {4, 2}, {3, 2}, {3, 1}, {1, 1}, {1, 2}, {3, 2}, {3, 3}, {0, 3}},
                 "a ring that closes along an edge");
  expect_covered({{0, 0}, {2, 0}, {2, 0}, {2, 2}, {1, 1}, {1, 1}, {0, 2}}, "corners twice");
}

// Outlines around a point with random radii, in random planes, with noise of float in the third coordinate.
TEST(Polygon, RandomOutlinesInRandomPlanesAreCovered) {
  rng::Stream stream(17);
  for (int k = 0; k < 400; ++k) {
    const auto random = [&] { return static_cast<double>(stream.next_float()); };
    const int count = 4 + static_cast<int>(40 * random() * random());
    const Vec3d n = normalize(Vec3d{random() - 0.5, random() - 0.5, random() - 0.5});
    const Frame frame = make_frame(Vec3(n));
    std::string text, face = "f";
    Vec3d sum, first, before;
    for (int i = 0; i < count; ++i) {
      double sine = 0, cosine = 0;
      math::sincos(2 * std::numbers::pi * i / count, sine, cosine);
      const double r = 0.05 + random();
      const Vec3 p = Vec3(Vec3d(frame.s) * (r * cosine) + Vec3d(frame.t) * (r * sine));
      text += fmt::format("v {} {} {}\n", p.x, p.y, p.z);
      face += fmt::format(" {}", i + 1);
      if (i == 0)
        first = Vec3d(p);
      else
        sum += cross(before, Vec3d(p)) * 0.5;
      before = Vec3d(p);
    }
    sum += cross(before, first) * 0.5;
    auto mesh = load_obj(text + face + "\n", "a.obj", false);
    ASSERT_TRUE(mesh.ok());
    const Cover cover = cover_of(*mesh, Vec3d(frame.n));
    const double area = dot(sum, Vec3d(frame.n));
    EXPECT_EQ(cover.triangles, static_cast<std::size_t>(count - 2));
    EXPECT_NEAR(cover.with_sign, area, 1e-6) << k;
    EXPECT_NEAR(cover.area, area, 1e-6) << k;
  }
}

TEST(Polygon, ConvexOnesStayFans) {
  rng::Stream stream(18);
  for (int k = 0; k < 200; ++k) {
    const auto random = [&] { return static_cast<double>(stream.next_float()); };
    const int count = 4 + static_cast<int>(12 * random());
    // Corners and some points within the edges, tilted and moved: rounding makes them a little concave.
    const Frame frame = make_frame(Vec3(normalize(Vec3d{random() - 0.5, random() - 0.5, random() - 0.5})));
    std::vector<Vec3d> ring;
    for (int i = 0; i < count; ++i) {
      double sine = 0, cosine = 0;
      math::sincos(2 * std::numbers::pi * i / count, sine, cosine);
      const Vec3d p = Vec3d(frame.s) * (3 * cosine) + Vec3d(frame.t) * sine + Vec3d{10, -5, 2};
      if (i > 0 && i % 2 == 0) ring.push_back((ring.back() + p) * 0.5);
      ring.push_back(p);
    }
    std::string text, face = "f";
    for (std::size_t i = 0; i < ring.size(); ++i) {
      text += fmt::format("v {} {} {}\n", ring[i].x, ring[i].y, ring[i].z);
      face += fmt::format(" {}", i + 1);
    }
    auto mesh = load_obj(text + face + "\n", "a.obj", false);
    ASSERT_TRUE(mesh.ok());
    for (std::uint32_t i = 0; i < mesh->triangles.size(); ++i)
      EXPECT_EQ(mesh->triangles[i], (std::array<std::uint32_t, 3>{0, i + 1, i + 2})) << k;
  }
  // A quad that is not planar, and is convex seen along its normal.
  const auto bent = load_obj("v 0 0 0\nv 1 0 1\nv 1 1 0\nv 0 1 1\nf 1 2 3 4\n", "a.obj", false);
  ASSERT_TRUE(bent.ok());
  EXPECT_EQ(bent->triangles[0], (std::array<std::uint32_t, 3>{0, 1, 2}));
  EXPECT_EQ(bent->triangles[1], (std::array<std::uint32_t, 3>{0, 2, 3}));
}

TEST(Polygon, TextureCoordinatesStayAtTheirCorners) {
  // Coordinates that are the positions, with indices of their own, so that corners are joined.
  auto mesh = load_obj(
      "v -1 -1 0\nv 0 -0.2 0\nv 1 -1 0\nv 0 1 0\nvt 0 1\nvt 1 -1\nvt 0 -0.2\nvt -1 -1\nvn 0 0 1\n"
      "f 1/4/1 2/3/1 3/2/1 4/1/1\n",
      "a.obj", false);
  ASSERT_TRUE(mesh.ok());
  ASSERT_EQ(mesh->uvs.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(mesh->uvs[i].x, mesh->positions[i].x);
    EXPECT_EQ(mesh->uvs[i].y, mesh->positions[i].y);
  }
  EXPECT_NEAR(cover_of(*mesh).area, 1.2, 1e-6);
}

TEST(Polygon, FacesOfAPlyKeepTheirAttributes) {
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 7\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 3\nproperty list uchar int vertex_indices\nproperty float heat_0\nend_header\n"
      "-1 -1 0\n0 -0.2 0\n1 -1 0\n0 1 0\n5 0 0\n6 0 0\n5 1 0\n3 4 5 6 10\n4 0 1 2 3 20\n3 4 5 6 30\n";
  auto mesh = load_ply(text, "a.ply", {{"face_heat"}, std::nullopt});
  ASSERT_TRUE(mesh.ok()) << mesh.error().to_string();
  ASSERT_EQ(mesh->attributes.size(), 1u);
  const auto& values = mesh->attributes[0].values;
  ASSERT_EQ(values.size(), 4u);
  EXPECT_EQ(values[0].r, 10);
  EXPECT_EQ(values[1].r, 20);
  EXPECT_EQ(values[2].r, 20);
  EXPECT_EQ(values[3].r, 30);
  EXPECT_NEAR(cover_of(*mesh).area, 0.5 + 1.2 + 0.5, 1e-6);
}

TEST(Polygon, DegenerateOnesHaveAllTheirTriangles) {
  const std::vector<std::pair<const char*, Ring>> rings = {
      {"all in a line", {{0, 0}, {1, 0}, {3, 0}, {2, 0}, {-1, 0}}},
      {"one point", {{1, 1}, {1, 1}, {1, 1}, {1, 1}}},
      {"bow tie", {{0, 0}, {1, 1}, {1, 0}, {0, 1}}},
      {"bow tie of unlike halves", {{0, 0}, {2, 2}, {2, 0}, {0, 1}}},
      {"star", {{0, 3}, {2, -2}, {-3, 1}, {3, 1}, {-2, -2}}},
      {"hair", {{0, 0}, {4, 0}, {4, 4}, {4, 9}, {4, 4}, {0, 4}, {-7, 4}, {0, 4}}}};
  for (const auto& [what, ring] : rings) EXPECT_EQ(of_obj(ring).triangles.size(), ring.size() - 2) << what;
}

TEST(Polygon, ManyCornersTakeSecondsAtMost) {
  const int count = 100'000;
  Ring star, comb, spiral;
  for (int i = 0; i < count; ++i) {
    double sine = 0, cosine = 0;
    math::sincos(2 * std::numbers::pi * i / count, sine, cosine);
    const double r = i % 2 == 0 ? 1 : 0.5;
    star.push_back({static_cast<float>(r * cosine), static_cast<float>(r * sine)});
    comb.push_back({static_cast<float>(i), i % 2 == 0 ? 0.0f : 1.0f});
  }
  comb.push_back({static_cast<float>(count), -1});
  comb.push_back({-1, -1});
  for (const bool outer : {true, false})
    for (int k = 0; k < count / 2; ++k) {
      const int i = outer ? k : count / 2 - 1 - k;
      double sine = 0, cosine = 0;
      math::sincos(50 * std::numbers::pi * i / count, sine, cosine);
      const double r = 1 + 4.0 * i / count + (outer ? 0.04 : 0);
      spiral.push_back({static_cast<float>(r * cosine), static_cast<float>(r * sine)});
    }
  for (const auto& [what, ring] : {std::pair("star", star), {"comb", comb}, {"spiral", spiral}}) {
    const std::clock_t begin = std::clock();  // of the processor: the machine may be busy
    const Cover cover = cover_of(of_obj(ring));
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    EXPECT_LT(seconds, 5) << what;
    RecordProperty(fmt::format("seconds_{}", what), fmt::format("{:.2f}", seconds));
    EXPECT_EQ(cover.triangles, ring.size() - 2) << what;
    EXPECT_NEAR(cover.area, std::abs(shoelace(ring)), 1e-6 * cover.area) << what;
  }
}

TEST(Polygon, SharedCaseDart) {
  const auto folder = test::shared_case("concave_polygon");
  if (folder.empty()) GTEST_SKIP() << "../shared/cases/concave_polygon is not here";
  auto mesh = load_obj(test::file_text(folder / "dart.obj"), "dart.obj", false);
  ASSERT_TRUE(mesh.ok());
  EXPECT_NEAR(cover_of(*mesh).area, 1.2, 1e-6);  // by the shoelace formula
}

}  // namespace
}  // namespace candela::loaders
