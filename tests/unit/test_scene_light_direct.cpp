// Claims: for every kind of emitter with an extent, the directions sample_direct draws follow the density
// that pdf_direct_* states (chi-squared over directions, from references near, far, aside and behind, with
// and without a front), densities integrate to one or to the fraction that can be reached, and the radiance
// of a sample is what a ray in its direction finds. False-alarm rate: about 75 chi-squared tests at 1e-7:
// below 1e-5. Seeds are fixed, so that a test that passes keeps passing.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "tests/unit/chi_squared.h"
#include "tests/unit/light_cases.h"
#include "tests/unit/scene_fixture.h"
#include "worker/scene/emitters/lights.h"

namespace candela::scene {
namespace {

using test::build_scene;
using test::Draws;
using test::LightCase;
using test::point_reference;

constexpr double kPi = std::numbers::pi;
constexpr std::size_t kBins = 12, kFine = 24;

struct View {
  Vec3 p, front;
};

// Density of the sampler along d, where its light is what a ray finds there.
double density_along(const Scene& scene, PointSampler point, const SurfaceHit& reference, Vec3 front,
                     Vec3 d) {
  if (length_squared(front) > 0 && !(dot(front, d) > 0)) return 0;
  SurfaceHit hit;
  if (!scene.intersect({reference.p, d}, hit))
    return static_cast<double>(scene.pdf_direct_environment_solid_angle(reference, front, d));
  if (hit.emitter == kNone || !(dot(hit.ng, d) < 0)) return 0;
  if (point != PointSampler::own)
    return static_cast<double>(scene.lights().pdf_point_solid_angle(reference, front, d, hit, point));
  return static_cast<double>(scene.pdf_direct_solid_angle(reference, front, d, hit));
}

void check(const LightCase& light, const View& view, std::uint64_t seed,
           PointSampler point = PointSampler::own) {
  auto built = build_scene(light.body, test::light_files());
  ASSERT_TRUE(built.ok()) << built.error().to_string();
  const Scene& scene = **built;
  const SurfaceHit reference = point_reference(view.p);
  Draws draws(23, seed);
  // Bins in a cone that holds the emitter, around its middle; all directions where it surrounds us or is
  // infinite.
  const Vec3 to_light = Vec3{0, 0, 2} - view.p;
  const bool everywhere = light.area == 0 || length(to_light) < 1.2f;
  const Frame frame = make_frame(normalize(to_light));
  const double sine = std::min(1.0, 1.1 / static_cast<double>(length(to_light)));
  const double cap = everywhere ? 2 : 1 - std::sqrt(1 - sine * sine);

  std::vector<double> observed(kBins * kBins + 1), expected(kBins * kBins + 1);
  constexpr int kSamples = 40000;
  for (int i = 0; i < kSamples; ++i) {
    DirectSample out;
    const float u = draws.next();
    std::size_t where = kBins * kBins;
    if (scene.lights().sample(reference, view.front, u, draws.next_2d(), out, LightTechnique::adapted,
                              point) == DirectOutcome::sampled) {
      ASSERT_NEAR(length(out.wi), 1, 1e-5f);
      ASSERT_GT(out.pdf_solid_angle, 0);
      SurfaceHit hit;
      const bool met = scene.intersect({reference.p, out.wi}, hit);
      // Parts behind another part of the lamp are not found by rays: it stays with the rest.
      if (met ? length(hit.p - out.p) < 2e-3f && !out.infinite && dot(hit.ng, out.wi) < 0 : out.infinite) {
        const Vec3 l = frame.to_local(out.wi);
        const double a = (1 - static_cast<double>(l.z)) / cap;
        const double b = std::atan2(static_cast<double>(l.y), static_cast<double>(l.x)) / (2 * kPi) + 0.5;
        const auto cell = [](double x) {
          return std::min(static_cast<std::size_t>(std::max(0.0, x) * kBins), kBins - 1);
        };
        where = cell(a) * kBins + cell(b);
        if (met && dot(hit.ng, out.wi) < -0.05f) {
          ASSERT_NEAR(density_along(scene, point, reference, view.front, out.wi) /
                          static_cast<double>(out.pdf_solid_angle),
                      1, 1e-2)
              << light.name;
          if (!light.name.starts_with("textured")) {
            ASSERT_NEAR(scene.emitted(hit, -out.wi).g, out.radiance.g, 1e-4f * out.radiance.g);
          }
        }
        if (out.infinite) {
          ASSERT_NEAR(scene.environment(out.wi).g / out.radiance.g, 1, 1e-3f);
        }
      }
    }
    observed[where] += 1;
  }
  double total = 0;
  for (std::size_t i = 0; i < kBins * kFine; ++i) {
    for (std::size_t j = 0; j < kBins * kFine; ++j) {
      const double z =
          1 - cap * (static_cast<double>(i) + static_cast<double>(draws.next())) / (kBins * kFine);
      const double phi =
          2 * kPi * ((static_cast<double>(j) + static_cast<double>(draws.next())) / (kBins * kFine) - 0.5);
      const double r = std::sqrt(std::max(0.0, 1 - z * z));
      const Vec3 d = normalize(frame.to_world(Vec3(Vec3d{r * std::cos(phi), r * std::sin(phi), z})));
      const double p = density_along(scene, point, reference, view.front, d) * 2 * kPi * cap /
                       (kBins * kFine * kBins * kFine);
      expected[i / kFine * kBins + j / kFine] += p * kSamples;
      total += p;
    }
  }
  EXPECT_LT(total, 1.01) << light.name;
  const bool whole = light.name == "rectangle" || light.name == "disk" || light.name == "sphere" ||
                     light.name == "constant" || light.name == "envmap";
  if (whole && length_squared(view.front) == 0) {
    EXPECT_NEAR(total, view.p.z > 2 && light.area > 0 && light.name != "sphere" ? 0 : 1, 0.01) << light.name;
  }
  expected.back() = kSamples * std::max(0.0, 1 - total);
  // The quadrature's own error, some percent of thin bins, is not the question: bins below 25 are joined.
  std::vector<double> joined_observed(1), joined_expected(1);
  for (std::size_t i = 0; i + 1 < expected.size(); ++i) {
    joined_observed.back() += observed[i];
    joined_expected.back() += expected[i];
    if (joined_expected.back() > 25 && i + 2 < expected.size()) {
      joined_observed.push_back(0);
      joined_expected.push_back(0);
    }
  }
  joined_observed.push_back(observed.back());
  joined_expected.push_back(std::max(expected.back(), 1e-9));
  EXPECT_NEAR(observed.back() / kSamples, expected.back() / kSamples, 0.015) << light.name;
  joined_observed.pop_back();
  joined_expected.pop_back();
  EXPECT_GT(test::chi_squared_p(joined_observed, joined_expected), 1e-7)
      << light.name << " from " << view.p.x << " " << view.p.y << " " << view.p.z << " total " << total;
}

const std::vector<View> views = {
    {{0, 0, 0}, {}},
    {{0.1f, 0.2f, 1.2f}, {}},                              // near
    {{1.5f, -1, 1.7f}, {}},                                // aside
    {{0.3f, -0.2f, -6}, {}},                               // far
    {{0.2f, 0, 3.5f}, {}},                                 // behind
    {{0.4f, 0.2f, 1.3f}, normalize(Vec3{1, 0.3f, 0.4f})},  // a front that cuts it
};

TEST(DirectSampling, FollowsItsDensity) {
  std::uint64_t seed = 0;
  for (const LightCase& light : test::light_cases()) {
    if (light.area == 0 && light.name != "constant" && light.name != "envmap") continue;  // delta
    for (const View& view : views) check(light, view, ++seed);
  }
  // Inside.
  for (const LightCase& light : test::light_cases())
    if (light.name.starts_with("inner")) check(light, {{0, 0.05f, 2.1f}, {}}, ++seed);
}

// The same of points in the solid angle of triangles.
TEST(DirectSampling, FollowsItsDensityInTheSolidAngleOfTriangles) {
  std::uint64_t seed = 1000;
  for (const LightCase& light : test::light_cases())
    if (light.name == "cube")
      for (const View& view : views) check(light, view, ++seed, PointSampler::spherical);
}

}  // namespace
}  // namespace candela::scene
