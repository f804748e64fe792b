// Claims: an instance shows its shapegroup as the transformed shapes themselves would look, also under uneven
// scales, shears and mirrors; rays leaving it do not meet it again from 1e-4 to 1e6 times unit scale and far
// from the origin; groups that nothing refers to are not rendered; what Mitsuba refuses is refused.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <string>

#include "tests/unit/scene_fixture.h"
#include "worker/scene/accel.h"

namespace candela::scene {
namespace {

using test::build_scene;
using test::matrix;
using test::uniform_direction;

const std::string kTextured =
    "<bsdf type=\"diffuse\"><texture type=\"checkerboard\" name=\"reflectance\"/></bsdf>";
const std::string kInstance = "<shape type=\"instance\"><ref id=\"g\"/>";

std::string group(const std::string& shapes) {
  return "<shape type=\"shapegroup\" id=\"g\">" + shapes + "</shape>";
}

// A mirror, an uneven scale and a shear, somewhere.
const std::vector<double> kUneven = {-1.5, 0.3, 0, 2, 0, 0.7, 0.2, -1, 0.1, 0, 2, 0.5, 0, 0, 0, 1};

// Calls same(a, b) for hits of random rays about `center`; the number of rays that met both.
template <class Same>
int compare(const Scene& a, const Scene& b, Vec3 center, float size, std::uint64_t seed, const Same& same) {
  rng::Stream stream(rng::key(1, seed));
  int met = 0, differ = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vec3 from = center + uniform_direction(stream) * (3 * size);
    const Vec3 to = center + uniform_direction(stream) * (size * stream.next_float());
    const Ray ray{from, normalize(to - from)};
    SurfaceHit first, second;
    const bool in_a = a.intersect(ray, first), in_b = b.intersect(ray, second);
    EXPECT_EQ(a.occluded(ray), in_a);
    EXPECT_EQ(b.occluded(ray), in_b);
    if (in_a != in_b || (in_a && length(first.p - second.p) > 1e-3f * size)) {
      ++differ;  // at an outline, by rounding
      continue;
    }
    if (!in_a) continue;
    ++met;
    same(first, second);
  }
  EXPECT_LE(differ, 5);
  return met;
}

void expect_near(Vec3 a, Vec3 b, float tolerance) {
  EXPECT_LT(length(a - b), tolerance * std::max(1.0f, length(b)))
      << a.x << " " << a.y << " " << a.z << ", not " << b.x << " " << b.y << " " << b.z;
}

TEST(Instance, TheIdentityChangesNothing) {
  for (const std::string shape : {"cube", "sphere", "disk", "cylinder"}) {
    const std::string text = "<shape type=\"" + shape + "\">" + kTextured + "</shape>";
    const auto plain = build_scene(text), instanced = build_scene(group(text) + kInstance + "</shape>");
    ASSERT_TRUE(plain.ok() && instanced.ok()) << instanced.error().to_string();
    EXPECT_EQ((*instanced)->features().instances, 1u);
    EXPECT_NEAR((*plain)->features().radius, (*instanced)->features().radius, 1e-6f);
    const int met =
        compare(**plain, **instanced, {0, 0, 0}, 1.5f, 91, [](const SurfaceHit& a, const SurfaceHit& b) {
          expect_near(b.p, a.p, 1e-6f);
          expect_near(b.ng, a.ng, 1e-6f);
          expect_near(b.shading.n, a.shading.n, 1e-6f);
          expect_near(b.shading.s, a.shading.s, 1e-4f);
          EXPECT_NEAR(a.distance, b.distance, 1e-5f);
          EXPECT_LT(std::abs(a.uv.x - b.uv.x) + std::abs(a.uv.y - b.uv.y), 1e-4f);
          EXPECT_EQ(a.bsdf, b.bsdf);
          EXPECT_LT(b.error, 10 * a.error + 1e-6f);
        });
    EXPECT_GT(met, 1000) << shape;
  }
}

// A mesh whose vertices have been through the same transform.
TEST(Instance, UnevenScalesAndMirrorsAreThoseOfTheMesh) {
  const auto place = matrix(kUneven);
  const std::string obj =
      "v -1 -1 0\nv 1 -1 0.2\nv 1 1 0\nv -1 1 0.5\nv 0 0 1\nvt 0 0\nvt 1 0.2\nvt 0.9 1\nvt 0 1\nvt 0.4 0.6\n"
      "f 1/1 2/2 5/5\nf 2/2 3/3 5/5\nf 3/3 4/4 5/5\nf 4/4 1/1 5/5\n";
  const std::string mesh =
      "<shape type=\"obj\"><string name=\"filename\" value=\"m.obj\"/>"
      "<boolean name=\"face_normals\" value=\"true\"/>";
  const auto baked = build_scene(mesh + kTextured + place + "</shape>", {{"m.obj", obj}});
  const auto instanced =
      build_scene(group(mesh + kTextured + "</shape>") + kInstance + place + "</shape>", {{"m.obj", obj}});
  ASSERT_TRUE(baked.ok()) << baked.error().to_string();
  ASSERT_TRUE(instanced.ok()) << instanced.error().to_string();
  // Normals of both stay outside.
  const int met =
      compare(**baked, **instanced, {2, -1, 1}, 2, 92, [](const SurfaceHit& a, const SurfaceHit& b) {
        expect_near(b.p, a.p, 1e-5f);
        expect_near(b.ng, a.ng, 1e-5f);
        expect_near(b.shading.s, a.shading.s, 1e-4f);
        EXPECT_LT(std::abs(a.uv.x - b.uv.x) + std::abs(a.uv.y - b.uv.y), 1e-4f);
      });
  EXPECT_GT(met, 500);
}

// A sphere becomes the ellipsoid x' M^-T M^-1 x = 1, whose gradient is its outward normal.
TEST(Instance, ASphereBecomesAnEllipsoid) {
  const auto scene =
      build_scene(group("<shape type=\"sphere\"/>") + kInstance + matrix(kUneven) + "</shape>");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  description::Mat4 m{};
  std::copy(kUneven.begin(), kUneven.end(), m.begin());
  const Transform to_world(m);
  const int met =
      compare(**scene, **scene, {2, -1, 0.5f}, 2, 93, [&](const SurfaceHit& hit, const SurfaceHit&) {
        const Vec3d local = to_world.inverse_point(Vec3d(hit.p));
        EXPECT_NEAR(length(local), 1, 1e-6);
        expect_near(hit.ng, Vec3(normalize(to_world.covector(local))), 1e-5f);
      });
  EXPECT_GT(met, 1000);
}

TEST(Instance, RaysLeavingItDoNotMeetItAgain) {
  rng::Stream stream(rng::key(1, 94));
  int left = 0;
  for (const float scale : {1e-4f, 1e-2f, 1.0f, 1e3f, 1e6f}) {
    for (const float offset : {0.0f, 1.0f, 1e3f, 1e5f}) {
      for (int round = 0; round < 12; ++round) {
        const auto u = [&] { return 2.0 * static_cast<double>(stream.next_float()) - 1; };
        const auto s = static_cast<double>(scale);
        description::Mat4 m{};
        for (std::size_t i = 0; i < 12; ++i)
          m[i] = i % 4 == 3 ? u() * static_cast<double>(offset) * s : u() * s;
        for (const std::size_t i : {0u, 5u, 10u}) m[i] += m[i] < 0 ? -0.5 * s : 0.5 * s;
        m[15] = 1;
        const Transform to_world(m);
        if (std::abs(to_world.determinant()) < 0.05 * s * s * s) continue;
        // Also a group that is far from its own origin.
        const double local_offset = round % 3 == 0 ? 1000 : 0;
        const Vec3d center{local_offset, 0.3 * local_offset, -local_offset};
        Geometry geometry;
        geometry.begin_group();
        Shape shape;
        const std::array<Vec3d, 3> axes = {Vec3d{0.6, 0.8, 0}, Vec3d{-0.8, 0.6, 0}, Vec3d{0, 0, 1}};
        if (round % 4 == 0) {
          for (int k = 0; k < 3; ++k) shape.positions.push_back(Vec3(center + Vec3d{u(), u(), u()}));
          shape.triangles = {{0, 1, 2}};
        } else if (round % 4 == 1) {
          shape.sphere = Sphere{center, 0.7, axes, false};
        } else if (round % 4 == 2) {
          shape.disk = Disk{center, 0.7, axes};
        } else {
          shape.cylinder = Cylinder{center, 0.7, 1.5, axes, false};
        }
        geometry.add(shape, {});
        geometry.add_instance(1, to_world);
        geometry.finish();
        auto accel = Accel::build(geometry, "avx2", 1);
        ASSERT_TRUE(accel.ok());
        const Vec3 middle = Vec3(to_world.point(geometry.groups[1].bounds.center()));
        for (int i = 0; i < 300; ++i) {
          const Vec3 from = middle + uniform_direction(stream) * (4 * scale);
          const Ray ray{from, normalize(middle + uniform_direction(stream) * (0.5f * scale) - from)};
          Accel::Found found{};
          if (!accel->intersect(ray, found)) continue;
          ASSERT_EQ(found.instance, 0u);
          SurfaceHit hit;
          geometry.instance_hit(ray, found.instance, found.kind, found.primitive, hit);
          EXPECT_LE(hit.error, 1e-4f * scale + 1e-5f * scale * (offset + static_cast<float>(local_offset)));
          Vec3 d = uniform_direction(stream);
          if (i % 3 == 0)
            d = normalize(d - hit.ng * dot(d, hit.ng) + hit.ng * (1e-4f * stream.next_float()));  // grazing
          if (dot(d, hit.ng) < 0) d = -d;
          ++left;
          const bool flat = found.kind == PrimitiveKind::triangle || found.kind == PrimitiveKind::disk;
          ASSERT_FALSE(accel->intersect(spawn_ray(hit, d), found))
              << "scale " << scale << " offset " << offset << " round " << round;
          if (flat) {
            ASSERT_FALSE(accel->intersect(spawn_ray(hit, -d), found));
          } else if (dot(d, hit.ng) > 0.2f) {
            // Inwards: where it meets the surface it leaves; entering would be by the same place again.
            const Ray inwards = spawn_ray(hit, -d);
            if (accel->intersect(inwards, found)) {
              SurfaceHit second;
              geometry.instance_hit(inwards, found.instance, found.kind, found.primitive, second);
              ASSERT_LT(dot(d, second.ng), 0);
            }
          }
        }
      }
    }
  }
  EXPECT_GT(left, 10000);
}

// The nearest of plain shapes and instances wins, whichever Embree looks at first; unused groups are not
// there.
TEST(Instance, LivesBesideOtherShapes) {
  std::string body = "<shape type=\"rectangle\"/>";
  body += group(
      "<shape type=\"sphere\"><float name=\"radius\" value=\"0.2\"/><bsdf type=\"conductor\"/></shape>"
      "<shape type=\"cube\">" +
      matrix({0.1, 0, 0, 0, 0, 0.1, 0, 0, 0, 0, 0.1, -0.5, 0, 0, 0, 1}) + "</shape>");
  for (int i = 0; i < 3; ++i)
    body += kInstance + matrix({1, 0, 0, 0.5 * i - 0.5, 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 1}) + "</shape>";
  const auto scene =
      build_scene(body + "<shape type=\"shapegroup\" id=\"unused\"><shape type=\"sphere\"/></shape>");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  EXPECT_EQ((*scene)->features().instances, 3u);
  EXPECT_EQ((*scene)->features().spheres, 1u);
  EXPECT_EQ((*scene)->features().triangles, 14u);
  SurfaceHit sphere, cube, floor;
  ASSERT_TRUE((*scene)->intersect({{0.5f, 0, 5}, {0, 0, -1}}, sphere));
  EXPECT_NEAR(sphere.p.z, 1.2f, 1e-6f);
  ASSERT_TRUE((*scene)->intersect({{-0.25f, 0, 0.5f}, {1, 0, 0}}, cube));
  EXPECT_NEAR(cube.p.x, -0.1f, 1e-6f);
  ASSERT_TRUE((*scene)->intersect({{0.25f, 0, 5}, {0, 0, -1}}, floor));
  EXPECT_NEAR(floor.p.z, 0, 1e-6f);
  EXPECT_NE(sphere.bsdf, cube.bsdf);
  EXPECT_EQ(cube.bsdf, floor.bsdf);
  EXPECT_TRUE((*scene)->occluded({{0.5f, 0, 0.1f}, {0, 0, 1}}));
  EXPECT_FALSE((*scene)->occluded({{0.25f, 0, 0.1f}, {0, 0, 1}}));
  EXPECT_FALSE((*scene)->occluded({{0.5f, 0, 0.1f}, {0, 0, 1}, 0.2f}));
}

TEST(Instance, WhatItCannotBeIsRefused) {
  const auto message = [](const std::string& body) {
    const auto scene = build_scene(body);
    return scene.ok() ? std::string("no error") : scene.error().message;
  };
  const std::string lamp = "<shape type=\"sphere\"><emitter type=\"area\"/></shape>";
  EXPECT_EQ(message(group(lamp) + kInstance + "</shape>"),
            "a shape inside a shapegroup cannot be an emitter");
  EXPECT_EQ(message(group("<shape type=\"shapegroup\"><shape type=\"cube\"/></shape>")),
            "shape 'shapegroup' cannot be inside a shapegroup");
  EXPECT_EQ(message(group("")), "the shapegroup has no shapes");
  EXPECT_EQ(message("<shape type=\"instance\"/>"), "the instance has no shapegroup");
  EXPECT_EQ(message("<shape type=\"instance\"><shape type=\"cube\"/></shape>"),
            "an instance is of a shapegroup, not of shape 'cube'");
  EXPECT_EQ(message(group("<shape type=\"cube\"/>") + kInstance + "<bsdf type=\"diffuse\"/></shape>"),
            "bsdf 'diffuse' cannot be inside shape 'instance'");
  EXPECT_EQ(message(group("<shape type=\"cube\"/>") + kInstance +
                    "<transform name=\"to_world\"><scale value=\"1e19\"/></transform></shape>"),
            "the instance lies beyond 1e18 in the scene");
  EXPECT_EQ(message(group("<shape type=\"cube\"/>") + kInstance +
                    "<transform name=\"to_world\"><scale value=\"1e-19\"/></transform></shape>"),
            "to_world makes the instance smaller than 1e-18 of its group");
}

// In units of the group the ray begins beyond what Embree can trace; it cannot be told from one that misses.
TEST(Instance, TinyOnesFarAwayAreNotSeen) {
  const auto scene = build_scene(group("<shape type=\"sphere\"/><shape type=\"cube\"/>") + kInstance +
                                 "<transform name=\"to_world\"><scale value=\"1e-16\"/></transform></shape>");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  SurfaceHit hit;
  EXPECT_FALSE((*scene)->intersect({{0, 0, 1e4f}, {0, 0, -1}}, hit));
  EXPECT_FALSE((*scene)->occluded({{0, 0, 1e4f}, {0, 0, -1}}));
}

// A hundred thousand of them: no object of Embree's for each. The bound on time is loose for slow machines.
TEST(Instance, ManyAreCheap) {
  Geometry geometry;
  geometry.begin_group();
  Shape shape;
  shape.sphere = Sphere{{0, 0, 0}, 0.4, {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}}, false};
  geometry.add(shape, {});
  for (int i = 0; i < 100000; ++i) {
    description::Mat4 m = {
        1, 0, 0, static_cast<double>(i % 316), 0, 1, 0, static_cast<double>(i / 316), 0, 0, 1, 0, 0, 0, 0, 1};
    geometry.add_instance(1, Transform(m));
  }
  geometry.finish();
  EXPECT_LE(sizeof(Instance), 256u);
  const auto begin = std::chrono::steady_clock::now();
  auto accel = Accel::build(geometry, "avx2", 1);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  ASSERT_TRUE(accel.ok());
  EXPECT_LT(seconds.count(), 5.0);
  for (int i = 0; i < 300; ++i) {
    Accel::Found found{};
    ASSERT_TRUE(accel->intersect({{static_cast<float>(i) + 0.1f, 200, 9}, {0, 0, -1}}, found));
    EXPECT_EQ(found.instance, 200u * 316u + static_cast<unsigned>(i));
  }
}

}  // namespace
}  // namespace candela::scene
