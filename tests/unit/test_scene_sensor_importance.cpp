// Claims about cameras as light paths see them, for every sensor:
// - camera rays have the densities pdf_camera says (chi-squared over bins of lens and direction), and
//   pdf_camera finds the film position they came from;
// - what sample_camera finds is a camera ray: same film position, and importance and densities that agree;
// - the importance of a patch summed from its side (sample_camera at points uniform on it) is what camera
// rays
//   measure of it: pixel by pixel, the normalisation that light tracing needs;
// - the lens of a thin lens camera is sampled with the stated density, and light that meets it by itself
//   measures the same;
// - clip planes and the film's border bound all of it.
// False-alarm rate: at most 10 chi-squared tests at 1e-6 and 40 comparisons at 5 standard errors (6e-7 each):
// below 4e-5 together. Seeds are fixed, so that a test that passes keeps passing.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "tests/statistical/moments.h"
#include "tests/unit/chi_squared.h"
#include "tests/unit/scene_fixture.h"

namespace candela::scene {
namespace {

using test::build_scene;
using test::point_reference;

constexpr std::uint32_t kWidth = 8, kHeight = 6;

const std::string kPose =
    "<transform name=\"to_world\"><lookat origin=\"1,2,3\" target=\"2,1.5,-1\" up=\"0.1,1,0\"/></transform>";
const std::string kPinhole = "<sensor type=\"perspective\">" + kPose +
                             "<float name=\"fov\" value=\"70\"/>"
                             "<float name=\"principal_point_offset_x\" value=\"0.1\"/>"
                             "<float name=\"near_clip\" value=\"0.5\"/></sensor>";
const std::string kLens = "<sensor type=\"thinlens\">" + kPose +
                          "<float name=\"fov\" value=\"70\"/><float name=\"aperture_radius\" value=\"0.4\"/>"
                          "<float name=\"focus_distance\" value=\"3\"/>"
                          "<float name=\"near_clip\" value=\"0.5\"/></sensor>";
const std::string kParallel =
    "<sensor type=\"orthographic\"><transform name=\"to_world\"><scale x=\"2\" y=\"3\"/><lookat "
    "origin=\"1,2,3\" target=\"2,1.5,-1\" up=\"0.1,1,0\"/></transform><float name=\"near_clip\" "
    "value=\"0.5\"/></sensor>";
const std::vector<std::string> kSensors = {kPinhole, kLens, kParallel};

std::unique_ptr<Scene> with_sensor(const std::string& sensor, const std::string& body = "") {
  Scene::Options options;
  options.film_width = kWidth;
  options.film_height = kHeight;
  auto built = build_scene(body, {}, sensor, options);
  EXPECT_TRUE(built.ok()) << built.error().to_string();
  return built.ok() ? std::move(*built) : nullptr;
}

struct Draws {
  rng::Stream stream;
  explicit Draws(std::uint64_t seed) : stream(rng::key(6, seed)) {}
  Vec2 next_2d() {
    const float x = stream.next_float();
    return {x, stream.next_float()};
  }
  Ray camera_ray(const Scene& scene) {
    float weight = 0;
    const Vec2 film = next_2d();
    return scene.camera_ray(film.x * kWidth, film.y * kHeight, next_2d(), weight);
  }
};

const Vec3 kEye{1, 2, 3}, kView = normalize(Vec3{1, -0.5f, -4});

TEST(CameraImportance, PdfFindsTheRayAgain) {
  std::uint64_t seed = 0;
  for (const std::string& sensor : kSensors) {
    const auto scene = with_sensor(sensor);
    ASSERT_NE(scene, nullptr);
    Draws draws(++seed);
    for (int i = 0; i < 2000; ++i) {
      const Vec2 film = draws.next_2d(), lens = draws.next_2d();
      float weight = 0;
      const Ray ray = scene->camera_ray(film.x * kWidth, film.y * kHeight, lens, weight);
      CameraDensity density;
      const Vec3 somewhere = ray.origin + ray.direction * (20 * draws.stream.next_float());
      // The rim of the film may round to its outside.
      ASSERT_TRUE(scene->pdf_camera(somewhere, ray.direction, density, 1e-3f)) << i;
      ASSERT_NEAR(density.film_x, film.x * kWidth, 2e-4f);
      ASSERT_NEAR(density.film_y, film.y * kHeight, 2e-4f);
      EXPECT_EQ(density.delta_position, sensor == kPinhole);
      EXPECT_EQ(density.delta_direction, sensor == kParallel);
      // Seen from a point on the ray, the same lens point gives the same film position and importance.
      CameraSample seen;
      const SurfaceHit reference = point_reference(ray.origin + ray.direction * 2.5f);
      if (!scene->sample_camera(reference, lens, seen, 1e-3f)) {
        ADD_FAILURE() << sensor;
        break;
      }
      ASSERT_NEAR(seen.film_x, density.film_x, 1e-3f);
      ASSERT_NEAR(seen.film_y, density.film_y, 1e-3f);
      ASSERT_NEAR(dot(seen.wi, ray.direction), -1, 1e-6f);
      ASSERT_NEAR(seen.cosine / density.cosine, 1, 1e-4f);
      const float r2 = length_squared(reference.p - seen.p);
      ASSERT_NEAR(seen.importance * (density.delta_position ? r2 : 1) / density.importance, 1, 1e-4f);
      if (sensor == kLens) {
        ASSERT_NEAR(seen.pdf_solid_angle * seen.cosine / r2 / density.pdf_area, 1, 1e-4f);
        // W_e cos = pdf of the film times its pixels: the camera ray's weight is 1.
        ASSERT_NEAR(density.importance * density.cosine /
                        (density.pdf_area * density.pdf_solid_angle * kWidth * kHeight),
                    1, 1e-4f);
        float distance = 0;
        CameraDensity met;
        ASSERT_TRUE(scene->meets_camera({reference.p, seen.wi}, nullptr, distance, met, 1e-3f));
        EXPECT_NEAR(met.film_x, seen.film_x, 1e-3f);
        EXPECT_NEAR(met.importance / seen.importance, 1, 1e-3f);
        EXPECT_NEAR(length(reference.p + seen.wi * distance - ray.origin), 0, 1e-4f);
      }
      EXPECT_NEAR(
          length(seen.shadow_ray.origin + seen.shadow_ray.direction * seen.shadow_ray.t_max - ray.origin), 0,
          1e-4f);
    }
  }
}

// Directions of camera rays (positions, for parallel ones) against the density, in bins of the sphere (of the
// plane) whose expectation is integrated numerically on a finer grid.
TEST(CameraImportance, RaysFollowTheirDensity) {
  constexpr int kBins = 24, kFine = 12, kRays = 100000;
  std::uint64_t seed = 10;
  for (const std::string& sensor : kSensors) {
    const auto scene = with_sensor(sensor);
    ASSERT_NE(scene, nullptr);
    Draws draws(++seed);
    const Frame frame = make_frame(kView);
    const bool parallel = sensor == kParallel;
    // For a cylinder's coordinates (angle, height) on the sphere, the cap around the view; of the plane, a
    // square.
    const double extent = parallel ? 5 : 0.6;
    const auto bin_of = [&](double a, double b) {
      const int i = static_cast<int>(a * kBins), j = static_cast<int>(b * kBins);
      return a >= 0 && b >= 0 && i < kBins && j < kBins ? i * kBins + j : -1;
    };
    std::vector<double> observed(kBins * kBins + 1), expected(kBins * kBins + 1);
    // A thin lens: the direction's density depends on the lens point; both are integrated over.
    for (int i = 0; i < kRays; ++i) {
      const Ray ray = draws.camera_ray(*scene);
      double a = 0, b = 0;
      if (parallel) {
        const Vec3 l = frame.to_local(ray.origin - kEye);
        a = static_cast<double>(l.x) / (2 * extent) + 0.5;
        b = static_cast<double>(l.y) / (2 * extent) + 0.5;
      } else {
        const Vec3 l = frame.to_local(ray.direction);
        a = std::atan2(static_cast<double>(l.y), static_cast<double>(l.x)) / (2 * std::numbers::pi) + 0.5;
        b = (1 - static_cast<double>(l.z)) / extent;
      }
      const int bin = bin_of(a, b);
      observed[bin < 0 ? kBins * kBins : static_cast<std::size_t>(bin)] += 1;
    }
    double inside = 0;
    const int points = sensor == kLens ? 64 : 1;
    for (int i = 0; i < kBins * kFine; ++i) {
      for (int j = 0; j < kBins * kFine; ++j) {
        const double a = (i + 0.5) / (kBins * kFine), b = (j + 0.5) / (kBins * kFine);
        double density = 0;
        for (int k = 0; k < points; ++k) {
          CameraDensity out;
          Vec3 point = kEye, direction = kView;
          if (parallel) {
            point += frame.s * static_cast<float>((2 * a - 1) * extent) +
                     frame.t * static_cast<float>((2 * b - 1) * extent);
          } else {
            const double z = 1 - b * extent, r = std::sqrt(std::max(0.0, 1 - z * z)),
                         phi = 2 * std::numbers::pi * (a - 0.5);
            direction = normalize(frame.to_world(Vec3(Vec3d{r * std::cos(phi), r * std::sin(phi), z})));
            // Lens points by a fixed rule of the cell: the mean over them is the marginal density.
            if (sensor == kLens) {
              const float u = (static_cast<float>(k % 8) + 0.5f) / 8,
                          v = (static_cast<float>(k / 8) + 0.5f) / 8;
              const Vec2 d = warp::concentric_disk({u, v});
              point += frame.s * (0.4f * d.x) + frame.t * (0.4f * d.y);
            }
          }
          if (scene->pdf_camera(point, direction, out))
            density += static_cast<double>(parallel ? out.pdf_area : out.pdf_solid_angle) / points;
        }
        const double cell = parallel ? 4 * extent * extent : 2 * std::numbers::pi * extent;
        const double p = density * cell / (kBins * kFine) / (kBins * kFine);
        expected[static_cast<std::size_t>(bin_of(a, b))] += p * kRays;
        inside += p;
      }
    }
    EXPECT_NEAR(inside, 1, 3e-3) << sensor;  // the pdf integrates to one, to the quadrature's error
    // The quadrature's error is put where it belongs; its edge cells carry noise of their
    // own.
    for (double& e : expected) e /= inside;
    std::vector<double> rough_observed, rough_expected;
    for (std::size_t i = 0; i < observed.size(); ++i) {
      // Bins cut by the film's edge are integrated to some percent only: left to their sums, in rows.
      if (i % 3 == 0 || i + 1 == observed.size()) {
        rough_observed.push_back(0);
        rough_expected.push_back(0);
      }
      rough_observed.back() += observed[i];
      rough_expected.back() += expected[i];
    }
    EXPECT_GT(test::chi_squared_p(rough_observed, rough_expected), 1e-6) << sensor;
  }
}

TEST(CameraImportance, LensPointsAreUniform) {
  const auto scene = with_sensor(kLens);
  ASSERT_NE(scene, nullptr);
  Draws draws(20);
  const Frame frame = make_frame(kView);
  const SurfaceHit reference = point_reference(kEye + kView * 4.0f);
  constexpr int kRings = 8, kSectors = 12, kSamples = 100000;
  std::vector<double> observed(kRings * kSectors), expected(kRings * kSectors, kSamples / 96.0);
  for (int i = 0; i < kSamples; ++i) {
    CameraSample out;
    ASSERT_TRUE(scene->sample_camera(reference, draws.next_2d(), out));
    ASSERT_NEAR(out.pdf_solid_angle, length_squared(out.p - reference.p) / (out.cosine * math::kPi * 0.16f),
                1e-3f * out.pdf_solid_angle);
    const Vec3 l = frame.to_local(out.p - kEye);
    ASSERT_NEAR(l.z, 0, 1e-5f);
    const double r2 = static_cast<double>(l.x * l.x + l.y * l.y) / 0.16;
    const double phi =
        std::atan2(static_cast<double>(l.y), static_cast<double>(l.x)) / (2 * std::numbers::pi);
    const int ring = std::min(static_cast<int>(r2 * kRings), kRings - 1);
    const int sector = std::min(static_cast<int>((phi + 0.5) * kSectors), kSectors - 1);
    observed[static_cast<std::size_t>(ring * kSectors + sector)] += 1;
  }
  EXPECT_GT(test::chi_squared_p(observed, expected), 1e-6);
}

using Mean = statistical::Moments;

// A tilted patch of radiance 1, partly beyond the film's edge, cut by the near plane and partly hidden: pixel
// values from camera rays, from points on it, and (thin lens) from rays of light that meet the lens.
TEST(CameraImportance, MeasuresWhatCameraRaysMeasure) {
  // Corner and edges of the patch, and a screen before it.
  const Vec3 corner = kEye + kView * 3.0f + Vec3{-1.2f, -0.8f, 0.2f}, edge_u{2.2f, 0.3f, 0.1f},
             edge_v{0.2f, 1.9f, 0.8f};
  const auto rectangle = [](Vec3 c, Vec3 u, Vec3 v) {
    const Vec3 n = normalize(cross(u, v)), m = c + (u + v) * 0.5f;
    const auto d = [](float x) { return static_cast<double>(x); };
    return "<shape type=\"rectangle\">" +
           test::matrix({d(u.x) / 2, d(v.x) / 2, d(n.x), d(m.x), d(u.y) / 2, d(v.y) / 2, d(n.y), d(m.y),
                         d(u.z) / 2, d(v.z) / 2, d(n.z), d(m.z), 0, 0, 0, 1}) +
           "</shape>";
  };
  const std::string body =
      rectangle(corner, edge_u, edge_v) +
      rectangle(kEye + kView * 1.5f + Vec3{0.1f, -0.1f, 0}, {0.3f, 0, 0.1f}, {0, 0.4f, 0});
  const double area = static_cast<double>(length(cross(edge_u, edge_v)));
  std::uint64_t seed = 30;
  for (const std::string& sensor : kSensors) {
    const auto scene = with_sensor(sensor, body);
    ASSERT_NE(scene, nullptr);
    Draws draws(++seed);
    std::vector<Mean> by_eye(4), by_light(4), by_chance(4);  // quarters of the film
    const auto quarter = [](float x, float y) {
      return static_cast<std::size_t>((x < kWidth / 2 ? 0 : 1) + (y < kHeight / 2 ? 0 : 2));
    };
    const auto add = [](std::vector<Mean>& means, std::size_t at, double value) {
      for (std::size_t q = 0; q < means.size(); ++q) means[q].add(q == at ? value : 0.0);
    };
    constexpr int kSamples = 100000;
    for (int i = 0; i < kSamples; ++i) {
      const Vec2 film = draws.next_2d();
      float weight = 0;
      const Ray ray = scene->camera_ray(film.x * kWidth, film.y * kHeight, draws.next_2d(), weight);
      SurfaceHit hit;
      const bool seen = scene->intersect(ray, hit) && hit.shape == 0;
      add(by_eye, quarter(film.x * kWidth, film.y * kHeight), seen ? kWidth * kHeight : 0.0);
    }
    for (int i = 0; i < kSamples; ++i) {
      const Vec2 u = draws.next_2d();
      SurfaceHit at = point_reference(corner + edge_u * u.x + edge_v * u.y, normalize(cross(edge_u, edge_v)));
      at.error = 1e-5f;
      CameraSample out;
      double value = 0;
      std::size_t where = 0;
      if (scene->sample_camera(at, draws.next_2d(), out) && !scene->occluded(out.shadow_ray)) {
        value = area * std::abs(static_cast<double>(dot(at.ng, out.wi))) *
                static_cast<double>(out.importance / out.pdf_solid_angle);
        where = quarter(out.film_x, out.film_y);
      }
      add(by_light, where, value);
      if (sensor != kLens) continue;
      const Vec3 local = warp::cosine_hemisphere(draws.next_2d());
      const float side = dot(at.ng, kEye - at.p) > 0 ? 1.0f : -1.0f;
      const Vec3 d = make_frame(at.ng * side).to_world(local);
      float distance = 0;
      CameraDensity met;
      value = 0;
      if (scene->meets_camera(spawn_ray(at, d), nullptr, distance, met)) {
        Ray to_lens = spawn_ray(at, d);
        to_lens.t_max = distance;
        if (!scene->occluded(to_lens)) {
          value = area * std::numbers::pi * static_cast<double>(met.importance);
          where = quarter(met.film_x, met.film_y);
        }
      }
      add(by_chance, where, value);
    }
    for (std::size_t q = 0; q < 4; ++q) {
      EXPECT_GT(by_eye[q].mean(), 0.05) << sensor;
      EXPECT_NEAR(by_eye[q].mean(), by_light[q].mean(),
                  5 * std::hypot(by_eye[q].error(), by_light[q].error()))
          << sensor << q;
      if (sensor == kLens) {
        EXPECT_GT(by_chance[q].mean(), 0);
        EXPECT_NEAR(by_eye[q].mean(), by_chance[q].mean(),
                    5 * std::hypot(by_eye[q].error(), by_chance[q].error()))
            << q;
      }
    }
  }
}

TEST(CameraImportance, EndsAtClipPlanesAndBorders) {
  for (const std::string& sensor : kSensors) {
    std::string clipped = sensor;
    clipped.insert(clipped.find("</sensor>"), "<float name=\"far_clip\" value=\"6\"/>");
    const auto scene = with_sensor(clipped);
    ASSERT_NE(scene, nullptr);
    float weight = 0;
    CameraSample out;
    const Ray ray = scene->camera_ray(4, 3, {0.5f, 0.5f}, weight);
    const auto sees = [&](Vec3 p, float border) {
      return scene->sample_camera(point_reference(p), {0.5f, 0.5f}, out, border);
    };
    EXPECT_TRUE(sees(ray.origin + ray.direction * 0.01f, 0));
    EXPECT_FALSE(sees(ray.origin - ray.direction * 0.01f, 0));
    EXPECT_TRUE(sees(ray.origin + ray.direction * (ray.t_max - 0.01f), 0));
    EXPECT_FALSE(sees(ray.origin + ray.direction * (ray.t_max + 0.01f), 0));
    EXPECT_FALSE(sees(ray.origin - ray.direction * 9, 0));
    const Ray beyond = scene->camera_ray(-1.5f, 3, {0.5f, 0.5f}, weight);
    const Vec3 p = beyond.origin + beyond.direction * 2;
    EXPECT_FALSE(sees(p, 0));
    EXPECT_FALSE(sees(p, 1));
    EXPECT_TRUE(sees(p, 2));
    EXPECT_NEAR(out.film_x, -1.5f, 1e-4f);
  }
}

}  // namespace
}  // namespace candela::scene
