// Claims: without a tree, or with one for the meshes alone, a ray finds what brute force in double finds; no
// ray passes between triangles with a common edge; thin triangles and crowds are left to the tree; no ray
// meets anything closer than the clearance.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "tests/unit/scene_fixture.h"
#include "worker/scene/accel.h"
#include "worker/scene/few_primitives.h"
#include "worker/scene/shapes/geometry_steps.h"

namespace candela::scene {
namespace {

using test::uniform_direction;

Vec3 random_point(rng::Stream& s, float scale) {
  const float x = s.next_float(), y = s.next_float();
  return Vec3{2 * x - 1, 2 * y - 1, 2 * s.next_float() - 1} * scale;
}

std::array<Vec3d, 3> random_axes(rng::Stream& s) {
  const Vec3d n = normalize(Vec3d(uniform_direction(s)));
  const Vec3d t = normalize(cross(n, std::abs(n.x) < 0.5 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0}));
  return {t, cross(n, t), n};
}

// Triangles and round primitives, of sizes up to `size`, about `center`.
void fill(Geometry& geometry, int triangles, int round, float size, Vec3 center, rng::Stream& s) {
  Shape mesh;
  for (int i = 0; i < triangles; ++i) {
    const Vec3 middle = center + random_point(s, 1);
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (int k = 0; k < 3; ++k) mesh.positions.push_back(middle + random_point(s, size));
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  if (triangles > 0) geometry.add(mesh, {});
  for (int i = 0; i < round; ++i) {
    Shape shape;
    const Vec3d middle(center + random_point(s, 1));
    const double radius = static_cast<double>(size) * (0.1 + 0.5 * static_cast<double>(s.next_float()));
    if (i % 3 == 0) shape.sphere = Sphere{middle, radius, random_axes(s), false};
    if (i % 3 == 1) shape.disk = Disk{middle, radius, random_axes(s)};
    if (i % 3 == 2) shape.cylinder = Cylinder{middle, radius, 2 * radius, random_axes(s), false};
    geometry.add(shape, {});
  }
}

struct Nearest {
  double distance = 1e300;
  PrimitiveKind kind = PrimitiveKind::triangle;
  std::uint32_t primitive = kNone;
  bool sure = true;  // no rounding decides it
};

// By distances in double, and barycentric coordinates.
Nearest brute_force(const Geometry& g, const Ray& ray, float scale) {
  Nearest best;
  double second = 1e300;
  const Vec3d o(ray.origin), d(ray.direction);
  const auto add = [&](PrimitiveKind kind, std::uint32_t primitive, double t) {
    second = std::min(second, std::max(t, best.distance));
    if (t < best.distance) best = {t, kind, primitive, best.sure};
  };
  for (std::uint32_t i = 0; i < g.triangles.size(); ++i) {
    const Triangle& t = g.triangles[i];
    const Vec3d v0(t.v0), e1 = Vec3d(t.v1) - v0, e2 = Vec3d(t.v2) - v0, s = o - v0, h = cross(d, e2);
    const double a = dot(e1, h), u = dot(s, h) / a, v = dot(d, cross(s, e1)) / a,
                 distance = dot(e2, cross(s, e1)) / a;
    const double inside = std::min({u, v, 1 - u - v});
    if (std::abs(inside) < 1e-9 || std::abs(distance) < 1e-9 * static_cast<double>(scale)) best.sure = false;
    if (inside >= 0 && distance > 0 && distance <= static_cast<double>(ray.t_max))
      add(PrimitiveKind::triangle, i, distance);
  }
  double t = 0;
  const auto end = static_cast<double>(ray.t_max);
  for (std::uint32_t i = 0; i < g.spheres.size(); ++i)
    if (meet(g.spheres[i].sphere, o, d, 0, end, t)) add(PrimitiveKind::sphere, i, t);
  for (std::uint32_t i = 0; i < g.disks.size(); ++i)
    if (meet(g.disks[i].disk, o, d, 0, end, t)) add(PrimitiveKind::disk, i, t);
  for (std::uint32_t i = 0; i < g.cylinders.size(); ++i)
    if (meet(g.cylinders[i].cylinder, o, d, 0, end, t)) add(PrimitiveKind::cylinder, i, t);
  if (best.primitive != kNone && second - best.distance < 1e-5 * static_cast<double>(scale))
    best.sure = false;
  return best;
}

// From within and from afar, with and without an end. The number of rays that met something.
int expect_brute_force(const Geometry& geometry, float scale, Vec3 center, rng::Stream& s) {
  const auto accel = Accel::build(geometry, "avx2", 1);
  EXPECT_TRUE(accel.ok());
  int met = 0, unsure = 0;
  for (int i = 0; i < 4000; ++i) {
    const float away = i % 4 == 3 ? 100 * scale : 1.2f * scale;
    const Vec3 from = center + random_point(s, away), to = center + random_point(s, scale);
    Ray ray{from, normalize(to - from)};
    if (i % 2 == 1) ray.t_max = length(to - from) * (0.5f + s.next_float());
    const Nearest expected = brute_force(geometry, ray, scale + length(center) + away);
    if (!expected.sure) {
      ++unsure;
      continue;
    }
    Accel::Found found{};
    const bool hit = accel->intersect(ray, found);
    EXPECT_EQ(hit, expected.primitive != kNone);
    EXPECT_EQ(accel->occluded(ray), hit);
    if (!hit) continue;
    ++met;
    EXPECT_EQ(found.kind, expected.kind);
    EXPECT_EQ(found.primitive, expected.primitive);
  }
  EXPECT_LT(unsure, 400);
  return met;
}

TEST(FewPrimitives, AgreeWithBruteForce) {
  rng::Stream s(rng::key(1, 87));
  for (const float scale : {1e-3f, 1.0f, 1e5f})
    for (const float offset : {0.0f, 3.0f})
      for (const auto [triangles, round] : {std::array{1, 0}, {8, 1}, {29, 9}, {64, 32}, {0, 24}}) {
        const Vec3 center = Vec3{0.7f, -1.0f, 0.4f} * offset;
        Geometry unit, geometry;
        fill(unit, triangles, round, 0.5f, center, s);
        Shape mesh;
        for (const Vec3 p : unit.positions) mesh.positions.push_back(p * scale);
        for (const auto& corners : unit.indices) mesh.triangles.push_back(corners);
        if (triangles > 0) geometry.add(mesh, {});
        const double k = static_cast<double>(scale);
        for (const ShapeRecord& record : unit.shapes) {
          Shape shape;
          if (record.sphere != kNone) {
            const Sphere& a = unit.spheres[record.sphere].sphere;
            shape.sphere = Sphere{a.center * k, a.radius * k, a.axes, false};
          } else if (record.disk != kNone) {
            const Disk& a = unit.disks[record.disk].disk;
            shape.disk = Disk{a.center * k, a.radius * k, a.axes};
          } else if (record.cylinder != kNone) {
            const Cylinder& a = unit.cylinders[record.cylinder].cylinder;
            shape.cylinder = Cylinder{a.base * k, a.radius * k, a.length * k, a.axes, false};
          } else {
            continue;
          }
          geometry.add(shape, {});
        }
        geometry.finish();
        const auto few = FewPrimitives::build(geometry);
        ASSERT_TRUE(few != nullptr && few->whole()) << scale << " " << triangles;
        EXPECT_GT(expect_brute_force(geometry, scale, center * scale, s),
                  triangles > 1 || round > 0 ? 200 : 0);
      }
}

TEST(FewPrimitives, OfAMeshAreTheRoundOnes) {
  rng::Stream s(rng::key(1, 88));
  Geometry geometry;
  fill(geometry, 300, 20, 0.3f, {}, s);
  geometry.finish();
  const auto few = FewPrimitives::build(geometry);
  ASSERT_TRUE(few != nullptr && !few->whole());
  EXPECT_GT(expect_brute_force(geometry, 1, {}, s), 2000);
}

// Claims: the ball around the round primitives beside meshes leaves out no ray that meets one, be it that it
// grazes the ball, starts in it or ends there; with one of them it leaves out many others.
TEST(FewPrimitives, AreMetThroughTheirBallAlone) {
  rng::Stream s(rng::key(1, 92));
  for (const float offset : {0.0f, 300.0f})
    for (const int round : {1, 2, 20}) {
      const Vec3 center = Vec3{0.7f, -1.0f, 0.4f} * offset;
      Geometry geometry;
      fill(geometry, 300, round, 0.3f, center, s);
      geometry.finish();
      const auto few = FewPrimitives::build(geometry);
      ASSERT_TRUE(few != nullptr && !few->whole());
      const Sphere& sphere = geometry.spheres[0].sphere;
      int met = 0, passed_by = 0;
      for (int i = 0; i < 20000; ++i) {
        const Vec3 from = center + random_point(s, i % 5 == 0 ? 0.3f : 4.0f);
        const Vec3d axis = normalize(sphere.center - Vec3d(from));
        const Vec3d side = normalize(cross(axis, Vec3d(uniform_direction(s))));
        const double rim = i % 2 == 0 ? 1 - 1e-6 * static_cast<double>(s.next_float())
                                      : 4 * static_cast<double>(s.next_float());
        const Vec3 to(sphere.center + side * (sphere.radius * rim));
        Ray ray{from, normalize(to - from)};
        if (i % 3 == 1) ray.t_max = length(to - from) * (0.9f + 0.2f * s.next_float());
        float distance = 0;
        PrimitiveKind kind{};
        std::uint32_t primitive = 0;
        const bool hit = few->intersect(ray, distance, kind, primitive);
        met += hit ? 1 : 0;
        const bool may = few->may_meet_round(ray, ray.t_max);
        passed_by += may ? 0 : 1;
        ASSERT_TRUE(may || !hit);
      }
      EXPECT_GT(met, 4000);
      EXPECT_TRUE(passed_by > 1000 || round > 1);
    }
}

// Claims: if they are the whole scene, Embree builds no tree; nothing that finds surfaces needs records of
// triangles, in a scene of few primitives or of many.
TEST(FewPrimitives, NeedNeitherTreeNorRecords) {
  for (const int triangles : {20, 300}) {
    rng::Stream s(rng::key(1, 91));
    Geometry early, late;
    fill(early, triangles, 5, 0.3f, {}, s);
    s = rng::Stream(rng::key(1, 91));
    fill(late, triangles, 5, 0.3f, {}, s);
    finish_vertices(early);
    const auto one = Accel::build(early, "avx2", 1);
    make_triangles(early);
    late.finish();
    const auto other = Accel::build(late, "avx2", 1);
    ASSERT_TRUE(one.ok() && other.ok());
    EXPECT_EQ(one->embree_scene() == nullptr, triangles == 20);
    int met = 0;
    for (int i = 0; i < 2000; ++i) {
      const Vec3 from = random_point(s, 1.2f), to = random_point(s, 1);
      const Ray ray{from, normalize(to - from)};
      Accel::Found a{}, b{};
      const bool hit = one->intersect(ray, a);
      ASSERT_EQ(other->intersect(ray, b), hit);
      if (!hit) continue;
      ++met;
      ASSERT_TRUE(a.kind == b.kind && a.primitive == b.primitive);
      SurfaceHit here, there;
      early.hit(ray, a.kind, a.primitive, here);
      late.hit(ray, b.kind, b.primitive, there);
      ASSERT_TRUE(here.p == there.p && here.ng == there.ng && here.shape == there.shape);
    }
    EXPECT_GT(met, 200);
  }
}

TEST(FewPrimitives, AreNeitherManyNorThin) {
  rng::Stream s(rng::key(1, 89));
  const auto built = [&](int triangles, int round) {
    Geometry geometry;
    fill(geometry, triangles, round, 0.3f, {}, s);
    geometry.finish();
    return FewPrimitives::build(geometry);
  };
  EXPECT_EQ(built(65, 0), nullptr);
  EXPECT_EQ(built(3, 33), nullptr);
  ASSERT_NE(built(64, 0), nullptr);
  Geometry thin;
  Shape mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0.5f, 1e-5f, 0}, {2, 0, 0}};
  mesh.triangles = {{0, 1, 2}};
  thin.add(mesh, {});
  thin.finish();
  EXPECT_EQ(FewPrimitives::build(thin), nullptr);
  // One without an area is met nowhere.
  Geometry flat;
  mesh.triangles = {{0, 1, 3}};
  flat.add(mesh, {});
  flat.finish();
  const auto few = FewPrimitives::build(flat);
  ASSERT_NE(few, nullptr);
  EXPECT_FALSE(few->occluded({{0.5f, 0, -1}, {0, 0, 1}}));
}

// Claims: no ray from a point meets anything within its clearance, in scenes of few primitives, of many, and
// of instances; the bound is tight where flat triangles or spheres are nearest, and ends at the limit.
TEST(FewPrimitives, LeaveTheClearanceEmpty) {
  rng::Stream s(rng::key(1, 92));
  for (const auto [triangles, round, instances] :
       {std::array{40, 9, 0}, {0, 20, 0}, {400, 9, 0}, {400, 60, 0}, {40, 9, 3}, {400, 9, 3}}) {
    Geometry geometry;
    fill(geometry, triangles, round, 0.3f, {}, s);
    if (instances > 0) {
      const std::uint32_t group = geometry.begin_group();
      fill(geometry, 30, 2, 0.1f, {}, s);
      for (int i = 0; i < instances; ++i) {
        const Vec3d by(random_point(s, 2));
        geometry.add_instance(group, Transform({1, 0, 0, by.x, 0, 1, 0, by.y, 0, 0, 1, by.z, 0, 0, 0, 1}));
      }
    }
    geometry.finish();
    const auto accel = Accel::build(geometry, "avx2", 1);
    ASSERT_TRUE(accel.ok());
    double free = 0;
    for (int i = 0; i < 300; ++i) {
      const std::size_t disk = static_cast<std::size_t>(i) % geometry.disks.size();
      const Vec3 p = i % 2 == 0 ? random_point(s, 2.5f)
                                : Vec3(geometry.disks[disk].disk.center) + random_point(s, 0.05f);
      const float clear = accel->clearance(p, 1e6f), limited = accel->clearance(p, 0.1f);
      EXPECT_EQ(limited, std::min(clear, 0.1f));
      free += static_cast<double>(clear);
      if (clear < 1e-4f) continue;
      for (int k = 0; k < 200; ++k)
        EXPECT_FALSE(accel->occluded({p, uniform_direction(s), clear - 1e-5f})) << i << " " << triangles;
    }
    EXPECT_GT(free / 300, 0.02) << triangles << " " << round;
  }
  // A cube of triangles, with a sphere in its middle; more triangles far away bring the tree.
  for (const bool tree : {false, true}) {
    Geometry geometry;
    Shape box;
    for (int i = 0; i < 8; ++i)
      box.positions.push_back({i & 1 ? 1.0f : -1.0f, i & 2 ? 1.0f : -1.0f, i & 4 ? 1.0f : -1.0f});
    box.triangles = {{0, 1, 3}, {0, 3, 2}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                     {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 3, 7}, {1, 7, 5}};
    geometry.add(box, {});
    Shape ball;
    ball.sphere = Sphere{{0, 0, 0}, 0.5, random_axes(s), false};
    geometry.add(ball, {});
    if (tree) fill(geometry, 200, 0, 0.1f, {10, 0, 0}, s);
    geometry.finish();
    const auto accel = Accel::build(geometry, "avx2", 1);
    ASSERT_TRUE(accel.ok());
    EXPECT_EQ(accel->embree_scene() != nullptr, tree);
    for (int i = 0; i < 200; ++i) {
      const Vec3 p = random_point(s, 1);
      const float walls = 1 - std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}),
                  nearest = std::min(walls, std::abs(length(p) - 0.5f));
      EXPECT_NEAR(accel->clearance(p, 10), nearest, 1e-5f) << p.x << " " << p.y << " " << p.z;
    }
  }
}

// A closed solid of triangles in random winding, seen from inside: rays at corners and along edges meet it.
TEST(FewPrimitives, LetNothingPassAtEdges) {
  rng::Stream s(rng::key(1, 90));
  for (int round = 0; round < 40; ++round) {
    const Vec3 center = random_point(s, round % 2 == 0 ? 0.0f : 30.0f);
    const float size = round % 4 < 2 ? 1.0f : 1e-2f;
    Shape mesh;
    for (unsigned i = 0; i < 8; ++i) {  // the corners of a crooked cube
      const Vec3 corner{(i & 1) != 0 ? 1.0f : -1.0f, (i & 2) != 0 ? 1.0f : -1.0f,
                        (i & 4) != 0 ? 1.0f : -1.0f};
      mesh.positions.push_back(center + (corner + random_point(s, 0.3f)) * size);
    }
    const std::uint32_t sides[6][4] = {{0, 1, 3, 2}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                       {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 3, 7, 5}};
    for (const auto& q : sides)
      for (std::array<std::uint32_t, 3> t : {std::array{q[0], q[1], q[2]}, {q[0], q[2], q[3]}}) {
        if (s.next_float() < 0.5f) std::swap(t[0], t[1]);
        mesh.triangles.push_back(t);
      }
    Geometry geometry;
    geometry.add(mesh, {});
    geometry.finish();
    const auto few = FewPrimitives::build(geometry);
    ASSERT_NE(few, nullptr);
    for (int i = 0; i < 3000; ++i) {
      const auto& t = geometry.indices[static_cast<std::size_t>(s.next_float() * 12)];
      const float along = i % 5 == 0 ? 0.0f : s.next_float();
      const Vec3 a = geometry.positions[t[0]], b = geometry.positions[t[static_cast<std::size_t>(1 + i % 2)]];
      const Vec3 from = center + random_point(s, 0.3f) * size;
      ASSERT_TRUE(few->occluded({from, normalize(a + (b - a) * along - from)})) << round << " " << i;
    }
  }
}

}  // namespace
}  // namespace candela::scene
