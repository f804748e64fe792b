// Claims: what Embree finds is what brute force in double finds; rays that leave a surface do not meet it
// again, and shadow rays reach their light, from 1e-4 to 1e6 times unit scale and far from the origin; an
// instruction set the machine lacks is refused.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "common/base/work_monitor.h"
#include "tests/unit/scene_fixture.h"
#include "worker/scene/accel.h"

namespace candela::scene {
namespace {

using test::build_scene;
using test::matrix;
using test::uniform_direction;

Vec3 random_point(rng::Stream& s, float scale) {
  const float x = s.next_float(), y = s.next_float();
  return Vec3{2 * x - 1, 2 * y - 1, 2 * s.next_float() - 1} * scale;
}

Shape random_triangles(int count, rng::Stream& stream, float size) {
  Shape shape;
  for (int i = 0; i < count; ++i) {
    const Vec3 center = random_point(stream, 1);
    const auto first = static_cast<std::uint32_t>(shape.positions.size());
    for (int k = 0; k < 3; ++k) shape.positions.push_back(center + random_point(stream, size));
    shape.triangles.push_back({first, first + 1, first + 2});
  }
  return shape;
}

// The nearest distance to a triangle in double, and how far the nearest meeting is from being decided by
// rounding.
double brute_force(const Geometry& g, const Ray& ray, double& margin) {
  const Vec3d o(ray.origin), d(ray.direction);
  double best = 1e300;
  margin = 1;
  for (const Triangle& t : g.triangles) {
    const Vec3d v0(t.v0), e1 = Vec3d(t.v1) - v0, e2 = Vec3d(t.v2) - v0, s = o - v0, h = cross(d, e2);
    const double a = dot(e1, h);
    const double u = dot(s, h) / a, v = dot(d, cross(s, e1)) / a, distance = dot(e2, cross(s, e1)) / a;
    if (!(distance > -1e-4)) continue;
    const double inside = std::min(std::min(u, v), 1 - u - v);
    if (std::abs(inside) < 1e-4 || std::abs(distance) < 1e-4 || std::abs(a) < 1e-5) margin = 0;
    if (inside >= 0 && distance > 0 && distance < best) {
      if (best - distance < 1e-4) margin = 0;
      best = distance;
    } else if (inside >= 0 && distance > 0 && distance - best < 1e-4) {
      margin = 0;
    }
  }
  return best;
}

// Claim: Embree tells of its steps while it builds a tree, so that who watches sees it go on, and it can be
// stopped there.
TEST(Accel, IsWatchedWhileItIsBuilt) {
  rng::Stream stream(rng::key(1, 82));
  const auto steps_of = [&](int triangles, bool stop) {
    Geometry geometry;
    geometry.add(random_triangles(triangles, stream, 0.01f), {});
    geometry.finish();
    WorkMonitor monitor;
    const WatchedWork watch(&monitor);
    monitor.stop = stop;
    bool stopped = false;
    try {
      EXPECT_TRUE(Accel::build(geometry, "avx2", 1).ok());
    } catch (const WorkStopped&) {
      stopped = true;
    }
    EXPECT_EQ(stopped, stop);
    return monitor.steps.load();
  };
  const auto few = steps_of(3, false), many = steps_of(100'000, false);
  EXPECT_GT(many, few + 10);
  EXPECT_LT(steps_of(100'000, true), many / 2) << "it goes no further";
}

TEST(Accel, AgreesWithBruteForce) {
  rng::Stream stream(rng::key(1, 81));
  Geometry geometry;
  geometry.add(random_triangles(300, stream, 0.3f), {});
  geometry.finish();
  auto accel = Accel::build(geometry, "avx2", 1);
  ASSERT_TRUE(accel.ok()) << accel.error().to_string();
  int compared = 0, found_count = 0;
  for (int i = 0; i < 20000; ++i) {
    Ray ray{random_point(stream, 1.5f), uniform_direction(stream)};
    double margin = 0;
    const double expected = brute_force(geometry, ray, margin);
    if (margin == 0) continue;
    ++compared;
    Accel::Found found{};
    const bool hit = accel->intersect(ray, found);
    ASSERT_EQ(hit, expected < 1e300);
    ASSERT_EQ(accel->occluded(ray), hit);
    if (!hit) continue;
    ++found_count;
    SurfaceHit surface;
    geometry.triangle_hit(ray, found.primitive, surface);
    ASSERT_NEAR(static_cast<double>(surface.distance), expected, 1e-6);
    ASSERT_LT(length(surface.p - (ray.origin + ray.direction * surface.distance)), 1e-5f);
    ray.t_max = surface.distance * 0.999f;
    ASSERT_FALSE(accel->intersect(ray, found) && found.primitive == surface.primitive);
  }
  EXPECT_GT(compared, 15000);
  EXPECT_GT(found_count, 3000);
}

TEST(Accel, RefusesForeignInstructionSets) {
  Geometry geometry;
  geometry.finish();
  EXPECT_EQ(Accel::build(geometry, "neon", 1).error().to_string(),
            "isa: unknown instruction set 'neon' (sse2, sse4.2, avx, avx2, avx512)");
  for (const char* isa : {"sse2", "sse4.2", "avx", "avx2"})
    EXPECT_TRUE(Accel::build(geometry, isa, 2).ok()) << isa;
  if (!__builtin_cpu_supports("avx512f")) {
    EXPECT_FALSE(Accel::build(geometry, "avx512", 1).ok());
  }
  auto empty = Accel::build(geometry, "avx2", 1);
  Accel::Found found{};
  EXPECT_FALSE(empty->intersect({{0, 0, 0}, {0, 0, 1}}, found));
  const float nan = std::nanf("");
  EXPECT_FALSE(empty->occluded({{nan, 0, 0}, {0, nan, 1}}));
}

struct Placement {
  float scale;
  Vec3 offset;
};
std::vector<Placement> placements() {
  std::vector<Placement> out;
  for (const float scale : {1e-4f, 1e-2f, 1.0f, 1e3f, 1e6f}) {
    for (const float offset : {0.0f, 1.0f, 1e3f, 1e5f}) {
      out.push_back({scale, Vec3{0.7f, -1.0f, 0.4f} * (offset * scale)});
    }
  }
  return out;
}

// Rays leaving points of a tilted triangle, also far from it where floats are coarse, into all directions of
// one side.
// Every second triangle is in Embree's tree, as a crowd of others stands behind it.
TEST(Accel, RaysLeavingATriangleDoNotMeetItAgain) {
  rng::Stream stream(rng::key(1, 82));
  for (const Placement& placement : placements()) {
    for (int shape_round = 0; shape_round < 20; ++shape_round) {
      Geometry geometry;
      Shape shape = random_triangles(1, stream, 1);
      if (shape_round % 2 == 0)
        for (std::uint32_t i = 0; i < 64; ++i) {
          for (int k = 0; k < 3; ++k) shape.positions.push_back(Vec3{9, 9, 9} + random_point(stream, 1));
          shape.triangles.push_back({3 * i + 3, 3 * i + 4, 3 * i + 5});
        }
      for (Vec3& p : shape.positions) p = p * placement.scale + placement.offset;
      geometry.add(shape, {});
      geometry.finish();
      auto accel = Accel::build(geometry, "avx2", 1);
      ASSERT_TRUE(accel.ok());
      for (int i = 0; i < 500; ++i) {
        const float x = stream.next_float();
        const Vec2 b = warp::uniform_triangle({x, stream.next_float()});
        const Triangle& t = geometry.triangles[0];
        const Vec3 target = t.v0 + (t.v1 - t.v0) * b.x + (t.v2 - t.v0) * b.y;
        SurfaceHit hit;
        const Vec3 from = uniform_direction(stream);
        geometry.triangle_hit({target - from * placement.scale, from}, 0, hit);
        EXPECT_LE(hit.error, 4e-5f * placement.scale + 1e-6f * length(placement.offset));
        Vec3 d = uniform_direction(stream);
        if (i % 3 == 0)
          d = normalize(d - t.ng * dot(d, t.ng) + t.ng * (1e-4f * stream.next_float()));  // grazing
        Accel::Found found{};
        ASSERT_FALSE(accel->intersect(spawn_ray(hit, d), found) && found.primitive == 0)
            << "scale " << placement.scale << " offset " << placement.offset.x << " round " << shape_round;
      }
    }
  }
}

TEST(Accel, RaysLeavingASphereOutwardsDoNotMeetItAgain) {
  rng::Stream stream(rng::key(1, 83));
  for (const Placement& placement : placements()) {
    Geometry geometry;
    Shape shape;
    shape.sphere = Sphere{Vec3d(placement.offset),
                          0.3 * static_cast<double>(placement.scale),
                          {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}},
                          false};
    geometry.add(shape, {});
    geometry.finish();
    auto accel = Accel::build(geometry, "avx2", 1);
    ASSERT_TRUE(accel.ok());
    for (int i = 0; i < 3000; ++i) {
      const Vec3 from = uniform_direction(stream);
      const Ray ray{placement.offset - from * placement.scale, from};
      Accel::Found found{};
      ASSERT_TRUE(accel->intersect(ray, found) && found.kind == PrimitiveKind::sphere);
      SurfaceHit hit;
      geometry.sphere_hit(ray, found.primitive, hit);
      Vec3 d = uniform_direction(stream);
      if (dot(d, hit.ng) < 0) d = -d;
      ASSERT_FALSE(accel->intersect(spawn_ray(hit, d), found));
      // Inwards it must: the ray starts just inside and leaves through the other side, unless it only grazes.
      if (dot(d, hit.ng) > 0.05f) {
        ASSERT_TRUE(accel->intersect(spawn_ray(hit, -d), found));
      }
    }
  }
}

std::array<Vec3d, 3> tilted_axes(rng::Stream& stream) {
  const Vec3d n = normalize(Vec3d(uniform_direction(stream)));
  const Vec3d s = normalize(cross(n, std::abs(n.x) < 0.5 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0}));
  return {s, cross(n, s), n};
}

// A disk and the inside and outside of a cylinder: rays aimed at a point on them find that point to within
// the stated error, and rays leaving it into its own side, also grazing ones, do not find it again.
TEST(Accel, DisksAndCylindersAreMetWhereTheyAreAndNotLeftTwice) {
  rng::Stream stream(rng::key(1, 85));
  for (Placement placement : placements()) {
    // Also a place along one axis, where rounding moves points along the surface.
    for (int round = 0; round < 6; ++round) {
      if (round == 5) placement.offset = {length(placement.offset), 0, 0};
      const double scale = static_cast<double>(placement.scale);
      for (const bool cylindrical : {false, true}) {
        Geometry geometry;
        Shape shape;
        const std::array<Vec3d, 3> axes =
            round == 5 ? std::array<Vec3d, 3>{Vec3d{0, 1, 0}, {0, 0, 1}, {1, 0, 0}} : tilted_axes(stream);
        const Disk disk{Vec3d(placement.offset), 0.4 * scale, axes};
        const Cylinder cylinder{Vec3d(placement.offset), 0.3 * scale, 0.8 * scale, axes, (round & 1) != 0};
        if (cylindrical) {
          shape.cylinder = cylinder;
        } else {
          shape.disk = disk;
        }
        geometry.add(shape, {});
        geometry.finish();
        auto accel = Accel::build(geometry, "avx2", 1);
        ASSERT_TRUE(accel.ok());
        const PrimitiveKind kind = cylindrical ? PrimitiveKind::cylinder : PrimitiveKind::disk;
        int near_target = 0;
        for (int i = 0; i < 300; ++i) {
          const double angle = 6.2831853 * static_cast<double>(stream.next_float());
          const double along = static_cast<double>(stream.next_float());
          const Vec3d around = axes[0] * std::cos(angle) + axes[1] * std::sin(angle);
          const Vec3d target =
              cylindrical ? cylinder.base + around * cylinder.radius + axes[2] * (along * cylinder.length)
                          : disk.center + around * (disk.radius * along * 0.99);
          const Vec3 from = uniform_direction(stream);
          const Ray ray{Vec3(target) - from * placement.scale, from};
          Accel::Found found{};
          if (!accel->intersect(ray, found)) continue;  // past the rim or edge-on, by rounding
          ASSERT_EQ(found.kind, kind);
          ASSERT_TRUE(accel->occluded(ray));
          SurfaceHit hit;
          geometry.hit(ray, found.kind, found.primitive, hit);
          const Vec3d p(hit.p), f = p - Vec3d(placement.offset);
          const double height = dot(f, axes[2]);
          const double off_surface =
              cylindrical ? std::abs(length(f - axes[2] * height) - cylinder.radius) : std::abs(height);
          ASSERT_LE(off_surface, static_cast<double>(hit.error));
          EXPECT_LE(hit.error, 1e-6f * placement.scale + 1e-6f * length(placement.offset));
          if (length(p - target) < 1e-3 * scale + 1e-6 * length(Vec3d(placement.offset))) ++near_target;
          Vec3 d = uniform_direction(stream);
          if (i % 3 == 0) d = normalize(d - hit.ng * dot(d, hit.ng) + hit.ng * (1e-4f * stream.next_float()));
          if (dot(d, hit.ng) < 0) d = -d;
          if (!cylindrical) {
            ASSERT_FALSE(accel->intersect(spawn_ray(hit, d), found));
            ASSERT_FALSE(accel->intersect(spawn_ray(hit, -d), found));
          } else if (!cylinder.inside_out) {
            ASSERT_FALSE(accel->intersect(spawn_ray(hit, d), found));
          }
          // From within, the ray leaves through the other side or an end, never by the same spot.
          const Vec3 inwards = cylinder.inside_out ? d : -d;
          if (cylindrical && std::abs(dot(inwards, hit.ng)) > 0.05f) {
            const Ray leaving = spawn_ray(hit, inwards);
            if (accel->intersect(leaving, found)) {
              SurfaceHit second;
              geometry.hit(leaving, found.kind, found.primitive, second);
              ASSERT_GT(second.distance, 1e-3f * placement.scale);
            }
          }
        }
        EXPECT_GT(near_target, cylindrical ? 100 : 250);
      }
    }
  }
}

// dp_du and dp_dv of every kind of shape against finite differences: a step of the parameters by what a step
// on the surface changes them moves the point by that step.
TEST(Accel, PartialDerivativesAreThoseOfTheParameterisation) {
  rng::Stream stream(rng::key(1, 86));
  for (int kind = 0; kind < 5; ++kind) {
    const std::array<Vec3d, 3> axes = tilted_axes(stream);
    Shape shape;
    if (kind <= 1) {  // with and without texture coordinates
      shape = random_triangles(1, stream, 1);
      if (kind == 1) shape.uvs = {{0.2f, 0.1f}, {0.9f, -0.3f}, {0.4f, 0.8f}};
    } else if (kind == 2) {
      shape.sphere = Sphere{{1, 2, 3}, 0.7, axes, false};
    } else if (kind == 3) {
      shape.disk = Disk{{1, 2, 3}, 0.7, axes};
    } else {
      shape.cylinder = Cylinder{{1, 2, 3}, 0.7, 1.5, axes, true};
    }
    Geometry geometry;
    ShapeRecord record;
    record.reads_uv = record.reads_partials = true;
    geometry.add(shape, record);
    geometry.finish();
    auto accel = Accel::build(geometry, "avx2", 1);
    ASSERT_TRUE(accel.ok());
    int compared = 0;
    for (int i = 0; i < 4000; ++i) {
      const Vec3 from = Vec3(geometry.bounds.center()) + uniform_direction(stream) * 3.0f;
      const Vec3 to = Vec3(geometry.bounds.center()) + uniform_direction(stream) * 0.5f;
      const Ray ray{from, normalize(to - from)};
      const Ray beside{from, normalize(to + uniform_direction(stream) * 3e-3f - from)};
      Accel::Found a{}, b{};
      if (!accel->intersect(ray, a) || !accel->intersect(beside, b)) continue;
      SurfaceHit first, second;
      geometry.hit(ray, a.kind, a.primitive, first);
      geometry.hit(beside, b.kind, b.primitive, second);
      const Vec3 step = second.p - first.p;
      const float du = second.uv.x - first.uv.x, dv = second.uv.y - first.uv.y;
      // Not across the seam, a far side, or near a pole where the second order is all.
      if (length(step) > 0.02f || std::abs(du) > 0.01f || std::abs(dv) > 0.05f) continue;
      ++compared;
      ASSERT_LT(length(first.dp_du * du + first.dp_dv * dv - step), 0.1f * length(step) + 2e-5f) << kind;
      ASSERT_LT(std::abs(dot(first.dp_du, first.ng)) + std::abs(dot(first.dp_dv, first.ng)), 1e-4f) << kind;
      if (kind != 0) {
        ASSERT_GT(dot(normalize(first.dp_du), first.shading.s), 0.999f) << kind;
      }
    }
    EXPECT_GT(compared, 300) << kind;
  }
}

// From a floor to a rectangle lamp above, over the lamp's whole area: nothing is between.
TEST(Accel, ShadowRaysReachTheirLight) {
  rng::Stream stream(rng::key(1, 84));
  for (const Placement& p : placements()) {
    const double s = static_cast<double>(p.scale), x = static_cast<double>(p.offset.x),
                 y = static_cast<double>(p.offset.y), z = static_cast<double>(p.offset.z);
    const std::string body =
        "<shape type=\"rectangle\">" + matrix({5 * s, 0, 0, x, 0, 5 * s, 0, y, 0, 0, s, z, 0, 0, 0, 1}) +
        "</shape><shape type=\"rectangle\">" +
        matrix({s, 0, 0, x, 0, -s, 0, y, 0, 0, -s, z + s, 0, 0, 0, 1}) + "<emitter type=\"area\"/></shape>";
    auto scene = build_scene(body);
    ASSERT_TRUE(scene.ok()) << scene.error().to_string();
    int sampled = 0;
    for (int i = 0; i < 2000; ++i) {
      const float a = stream.next_float(), b = stream.next_float(), c = stream.next_float();
      SurfaceHit hit;
      const Vec3 above = p.offset + Vec3{8 * a - 4, 8 * b - 4, 0.5f} * p.scale;
      ASSERT_TRUE((*scene)->intersect({above, {0, 0, -1}}, hit));
      DirectSample light;
      if ((*scene)->sample_direct(hit, hit.shading.n, c, {stream.next_float(), stream.next_float()}, light) !=
          DirectOutcome::sampled)
        continue;
      ++sampled;
      ASSERT_FALSE((*scene)->occluded(light.shadow_ray)) << "scale " << p.scale << " offset " << p.offset.x;
    }
    EXPECT_GT(sampled, 1900);
  }
}

// A walk through a medium without end may come this far.
TEST(Accel, RaysFromBeyondItsRangeMeetNothing) {
  auto scene = build_scene("<shape type=\"sphere\"/><shape type=\"cube\"/>");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  SurfaceHit hit;
  for (const float far : {2e18f, 1e30f, std::numeric_limits<float>::infinity(), std::nanf("")}) {
    const Ray ray{{0, 0, far}, {0, 0, -1}};
    EXPECT_FALSE((*scene)->intersect(ray, hit)) << far;
    EXPECT_FALSE((*scene)->occluded(ray)) << far;
  }
}

}  // namespace
}  // namespace candela::scene
