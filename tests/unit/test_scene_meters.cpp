// Claims about sensors that have no view, `irradiancemeter` on every kind of shape and `distant` with every
// kind of target:
// - pdf_camera finds the film position that a ray came from, and the density that its sensor states; what
//   sample_camera finds is the same ray;
// - a patch of radiance 1 measures the same from rays of the sensor, from points on the patch (sample_camera)
//   and from light that meets the sensor by itself (meets_camera), quarter by quarter of the film;
// - the weight of a ray of a meter is pi, the irradiance under a sky of radiance 1; under a small lamp the
//   irradiance is E = L A cos cos / r^2.
// 47 comparisons of values that are not 0, at 5 standard errors: a false-alarm rate below 3e-5 over seeds,
// which are fixed.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "tests/statistical/moments.h"
#include "tests/unit/scene_fixture.h"

namespace candela::scene {
namespace {

using test::build_scene;
using test::point_reference;
using Mean = statistical::Moments;

const std::string kMesh =
    "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 3\nproperty list uchar int vertex_indices\nend_header\n"
    "-1 -1 0\n1 -1 0\n1 1 0.3\n-1 1 0\n-2 0 0.5\n3 0 1 2\n3 0 2 3\n3 0 3 4\n";

struct Setup {
  std::string name, body;
  std::uint32_t width = 4, height = 6;
  bool meter = true;
};

// All look up, towards +z.
std::vector<Setup> setups() {
  const auto meter = [](const std::string& shape, const std::string& inside) {
    return "<shape type='" + shape + "'>" + inside + "<sensor type='irradiancemeter'/></shape>";
  };
  const auto distant = [](const std::string& inside) {
    return "<sensor type='distant'>" + inside + "</sensor>";
  };
  const std::string down = "<vector name='direction' value='0.1 0.2 -1'/>";
  return {
      {"rectangle", meter("rectangle",
                          "<transform name='to_world'><scale x='2' y='0.5'/><rotate x='1' "
                          "angle='20'/></transform>")},
      {"rectangle_of_one_pixel", meter("rectangle", ""), 1, 1},
      {"disk", meter("disk", "<transform name='to_world'><rotate y='1' angle='10'/></transform>")},
      {"sphere", meter("sphere", "<transform name='to_world'><rotate y='1' angle='70'/></transform>")},
      {"cylinder", meter("cylinder", "<transform name='to_world'><rotate y='1' angle='80'/></transform>")},
      {"mesh", meter("ply", "<string name='filename' value='a.ply'/>")},
      {"mesh_of_one_pixel", meter("ply", "<string name='filename' value='a.ply'/>"), 1, 1},
      {"distant", distant(down), 1, 1, false},
      {"distant_rectangle",
       distant(down + "<shape type='rectangle' name='target'><transform name='to_world'><rotate x='1' "
                      "angle='30'/><translate z='2.5'/></transform></shape>"),
       1, 1, false},
      {"distant_disk",
       distant(down + "<shape type='disk' name='target'><transform name='to_world'><scale value='0.7'/>"
                      "</transform></shape>"),
       1, 1, false},
  };
}

// A sphere away from the patch, so that the scene's bounds are large.
constexpr const char* kFar =
    "<shape type='sphere'><point name='center' x='4' y='3' z='5'/><float name='radius' value='0.2'/></shape>";

class Meter : public testing::TestWithParam<Setup> {
 protected:
  std::unique_ptr<Scene> with(const std::string& body) {
    Scene::Options options;
    options.film_width = GetParam().width;
    options.film_height = GetParam().height;
    auto built = build_scene(body + GetParam().body, {{"a.ply", kMesh}}, " ", options);
    EXPECT_TRUE(built.ok()) << built.error().to_string();
    return built.ok() ? std::move(*built) : nullptr;
  }
  Vec2 next_2d() {
    const float x = stream_.next_float();
    return {x, stream_.next_float()};
  }
  float width() const { return static_cast<float>(GetParam().width); }
  float height() const { return static_cast<float>(GetParam().height); }

  rng::Stream stream_{rng::key(12, 5)};
};

TEST_P(Meter, PdfFindsTheRayAgain) {
  const auto scene = with(kFar);
  ASSERT_NE(scene, nullptr);
  EXPECT_EQ(scene->reads_lens(), GetParam().meter);
  int met_count = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec2 film = next_2d(), lens = next_2d();
    float weight = 0;
    const Ray ray = scene->camera_ray(film.x * width(), film.y * height(), lens, weight);
    ASSERT_NEAR(length(ray.direction), 1, 1e-5f);
    EXPECT_NEAR(weight, GetParam().meter ? math::kPi : 1.0f, 1e-6f);
    CameraDensity density;
    ASSERT_TRUE(scene->pdf_camera(ray.origin, ray.direction, density)) << i;
    EXPECT_FALSE(density.delta_position);
    EXPECT_EQ(density.delta_direction, !GetParam().meter);
    if (GetParam().width > 1) {
      ASSERT_NEAR(density.film_x, film.x * width(), 5e-3f);
      ASSERT_NEAR(density.film_y, film.y * height(), 5e-3f);
    }
    // The weight is importance times cosine over the ray's density, one ray a pixel.
    ASSERT_NEAR(density.importance * density.cosine /
                    (density.pdf_area * density.pdf_solid_angle * width() * height()),
                weight, 1e-3f * weight);
    // The same point of the sensor, seen from the ray.
    CameraSample seen;
    const SurfaceHit reference = point_reference(ray.origin + ray.direction * 2.5f);
    ASSERT_TRUE(scene->sample_camera(reference, film, seen)) << i;
    ASSERT_NEAR(dot(seen.wi, ray.direction), -1, 1e-4f);
    CameraDensity again;
    ASSERT_TRUE(scene->pdf_camera(seen, reference.p, again));
    ASSERT_NEAR(again.pdf_area / density.pdf_area, 1, 1e-4f);
    ASSERT_NEAR(again.pdf_solid_angle, density.pdf_solid_angle, 1e-3f);
    if (!GetParam().meter) continue;
    ASSERT_NEAR(seen.pdf_solid_angle * seen.cosine / length_squared(reference.p - seen.p) / density.pdf_area,
                1, 1e-3f);
    // Light that comes along the ray meets the sensor.
    SurfaceHit hit;
    const Ray back{reference.p, seen.wi};
    if (!scene->intersect(back, hit) || length(hit.p - seen.p) > 1e-3f || dot(hit.ng, seen.wi) >= 0)
      continue;  // another part is before it
    float distance = 0;
    CameraDensity met;
    ASSERT_TRUE(scene->meets_camera(back, &hit, distance, met));
    EXPECT_NEAR(met.importance / seen.importance, 1, 1e-5f);
    EXPECT_EQ(distance, hit.distance);
    if (GetParam().width > 1) {
      EXPECT_NEAR(met.film_x, seen.film_x, 2e-2f);
    }
    EXPECT_FALSE(scene->meets_camera({reference.p, -seen.wi}, nullptr, distance, met));
    ++met_count;
  }
  if (GetParam().meter) {
    EXPECT_GT(met_count, 500);
  }
}

TEST_P(Meter, MeasuresWhatItsRaysMeasure) {
  const Vec3 corner{-0.6f, -1.1f, 2.2f}, edge_u{1.5f, 0.2f, 0.4f}, edge_v{-0.1f, 1.3f, -0.2f};
  const Vec3 n = normalize(cross(edge_u, edge_v)), middle = corner + (edge_u + edge_v) * 0.5f;
  const auto d = [](float x) { return static_cast<double>(x); };
  const std::string patch =
      "<shape type='rectangle'>" +
      test::matrix({d(edge_u.x) / 2, d(edge_v.x) / 2, d(n.x), d(middle.x), d(edge_u.y) / 2, d(edge_v.y) / 2,
                    d(n.y), d(middle.y), d(edge_u.z) / 2, d(edge_v.z) / 2, d(n.z), d(middle.z), 0, 0, 0, 1}) +
      "</shape>";
  const double area = static_cast<double>(length(cross(edge_u, edge_v)));
  const auto scene = with(patch + kFar);
  ASSERT_NE(scene, nullptr);
  std::vector<Mean> by_eye(4), by_light(4), by_chance(4);
  const auto quarter = [&](float x, float y) {
    return static_cast<std::size_t>((x < width() / 2 ? 0 : 1) + (y < height() / 2 ? 0 : 2));
  };
  const auto add = [](std::vector<Mean>& means, std::size_t at, double value) {
    for (std::size_t q = 0; q < means.size(); ++q) means[q].add(q == at ? value : 0.0);
  };
  constexpr int kSamples = 100000;
  for (int i = 0; i < kSamples; ++i) {
    const Vec2 film = next_2d();
    const float x = film.x * width(), y = film.y * height();
    float weight = 0;
    const Ray ray = scene->camera_ray(x, y, next_2d(), weight);
    SurfaceHit hit;
    const bool seen = scene->intersect(ray, hit) && hit.shape == 0;
    const std::size_t q = GetParam().width > 1 ? quarter(x, y) : 0;
    add(by_eye, q, seen ? static_cast<double>(weight * width() * height()) : 0.0);
  }
  for (int i = 0; i < kSamples; ++i) {
    const Vec2 u = next_2d();
    SurfaceHit at = point_reference(corner + edge_u * u.x + edge_v * u.y, n);
    at.error = 1e-5f;
    CameraSample out;
    double value = 0;
    std::size_t q = 0;
    if (scene->sample_camera(at, next_2d(), out) && !scene->occluded(out.shadow_ray)) {
      value = area * std::abs(static_cast<double>(dot(n, out.wi))) *
              static_cast<double>(out.importance / out.pdf_solid_angle);
      q = GetParam().width > 1 ? quarter(out.film_x, out.film_y) : 0;
    }
    add(by_light, q, value);
    if (!GetParam().meter) continue;
    const Vec3 toward = make_frame(-n).to_world(warp::cosine_hemisphere(next_2d()));
    const Ray ray = spawn_ray(at, toward);
    SurfaceHit hit;
    float distance = 0;
    CameraDensity met;
    value = 0;
    q = 0;
    if (scene->intersect(ray, hit) && scene->meets_camera(ray, &hit, distance, met)) {
      value = area * std::numbers::pi * static_cast<double>(met.importance);
      q = GetParam().width > 1 ? quarter(met.film_x, met.film_y) : 0;
    }
    add(by_chance, q, value);
  }
  double total = 0;
  for (std::size_t q = 0; q < 4; ++q) {
    total += by_eye[q].mean();
    EXPECT_NEAR(by_eye[q].mean(), by_light[q].mean(),
                5 * std::hypot(by_eye[q].error(), by_light[q].error()) + 1e-12)
        << q;
    if (GetParam().meter) {
      EXPECT_NEAR(by_eye[q].mean(), by_chance[q].mean(),
                  5 * std::hypot(by_eye[q].error(), by_chance[q].error()) + 1e-12)
          << q;
    }
  }
  EXPECT_GT(total, 0.02);
}

INSTANTIATE_TEST_SUITE_P(All, Meter, testing::ValuesIn(setups()),
                         [](const auto& tested) { return tested.param.name; });

// A small lamp straight above a small rectangle, and one seen at an angle.
TEST(IrradianceMeter, AgreesWithTheFormula) {
  for (const double x : {0.0, 3.0}) {
    const auto scene = build_scene(
        "<shape type='rectangle'><transform name='to_world'><scale value='0.01'/></transform><sensor "
        "type='irradiancemeter'/></shape><shape type='rectangle'><transform name='to_world'><scale "
        "value='0.1'/><rotate x='1' angle='180'/><translate x='" +
            std::to_string(x) + "' z='4'/></transform></shape>",
        {}, " ");
    ASSERT_TRUE(scene.ok()) << scene.error().to_string();
    SurfaceHit at = point_reference({static_cast<float>(x), 0, 4}, {0, 0, -1});
    CameraSample out;
    ASSERT_TRUE((*scene)->sample_camera(at, {0.5f, 0.5f}, out));
    const double r2 = x * x + 16, area = 0.04;
    const double value = area * static_cast<double>(std::abs(out.wi.z)) *
                         static_cast<double>(out.importance / out.pdf_solid_angle);
    EXPECT_NEAR(value / (area * 16 / (r2 * r2)), 1, 1e-3);
  }
}

TEST(DistantSensor, MayBeARay) {
  const auto scene = build_scene(
      "<shape type='sphere'/><sensor type='distant'><point name='target' value='0.5 0 0'/><vector "
      "name='direction' value='0 0 -2'/></sensor>",
      {}, " ");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  float weight = 0;
  for (const float x : {0.1f, 0.9f}) {
    const Ray ray = (*scene)->camera_ray(x, 0.3f, {0.5f, 0.5f}, weight);
    EXPECT_EQ(ray.direction, (Vec3{0, 0, -1}));
    EXPECT_NEAR(ray.origin.x, 0.5f, 1e-6f);
    EXPECT_GT(ray.origin.z, 1.0f);
  }
  CameraSample sample;
  CameraDensity density;
  EXPECT_FALSE((*scene)->sample_camera(point_reference({0.5f, 0, 0.9f}), {0.5f, 0.5f}, sample));
  EXPECT_FALSE((*scene)->pdf_camera({0.5f, 0, 2}, {0, 0, -1}, density));
}

TEST(DistantSensor, ErrorsNameTheTarget) {
  const auto error = [](const std::string& inside, std::uint32_t width) {
    Scene::Options options;
    options.film_width = width;
    const auto scene =
        build_scene("<shape type='sphere'/><sensor type='distant'>" + inside + "</sensor>", {}, " ", options);
    return scene.ok() ? "no error" : scene.error().to_string();
  };
  EXPECT_NE(error("", 2).find("has one pixel"), std::string::npos);
  EXPECT_NE(error("<shape type='cube'/>", 1).find("not a 'cube'"), std::string::npos);
  EXPECT_NE(error("<shape type='disk'/><vector name='direction' value='1 0 0'/>", 1).find("from its edge"),
            std::string::npos);
}

}  // namespace
}  // namespace candela::scene
