// Claims about light leaving emitters, for every kind:
// - positions are uniform in area (two-sample chi-squared against the meetings of random lines with the
//   surface, which are uniform too), directions have the stated density (chi-squared);
// - weight = radiance cos / densities; the mean weight is the power known on paper, and Lights::power says
// so;
// - densities asked for a hit, for what sample_direct found and for a direction are those of the sample;
// - the light that arrives at a floor by following light is that which sample_direct gathers from the floor;
// - several emitters are chosen by power, and each keeps its light.
// False-alarm rate: about 60 chi-squared tests at 1e-6, 90 comparisons at 5 standard errors (6e-7): below
// 1.2e-4 together. Seeds are fixed, so that a test that passes keeps passing.
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
using test::draw_emission;
using test::Draws;
using test::light_cases;
using test::light_files;
using test::LightCase;
using test::Mean;
using test::point_reference;

constexpr double kPi = std::numbers::pi;
const std::string kFloor =
    "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"1.2\"/></transform></shape>";
constexpr double kFloorArea = 2.4 * 2.4;

std::unique_ptr<Scene> built(const std::string& body) {
  auto scene = build_scene(body, light_files());
  EXPECT_TRUE(scene.ok()) << scene.error().to_string();
  return scene.ok() ? std::move(*scene) : nullptr;
}

// p-value of two samples having one distribution.
double two_sample_p(const std::vector<double>& a, const std::vector<double>& b) {
  double na = 0, nb = 0, statistic = 0;
  int bins = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    na += a[i];
    nb += b[i];
  }
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i] + b[i] < 20) continue;
    const double d = a[i] * std::sqrt(nb / na) - b[i] * std::sqrt(na / nb);
    statistic += d * d / (a[i] + b[i]);
    ++bins;
  }
  return bins < 2 ? 1 : statistical::chi_squared_tail(statistic, bins - 1);
}

constexpr std::size_t kBins = 12;
std::size_t bin(double x) {  // x in [0, 1]
  return std::min(static_cast<std::size_t>(std::max(0.0, x) * kBins), kBins - 1);
}
double turn(double y, double x) {
  return std::atan2(y, x) / (2 * kPi) + 0.5;
}

TEST(Emission, WeightsAreRadianceOverDensityAndTheirMeanThePower) {
  std::uint64_t seed = 0;
  for (const LightCase& light : light_cases()) {
    const auto scene = built(light.body + kFloor);
    ASSERT_NE(scene, nullptr);
    Draws draws(20, ++seed);
    Mean mean;
    const double r = static_cast<double>(scene->features().radius);
    for (int i = 0; i < 100000; ++i) {
      EmissionSample out;
      if (!draw_emission(*scene, draws, out)) {
        mean.add(0);
        continue;
      }
      ASSERT_NEAR(length(out.ray.direction), 1, 1e-5f);
      const double expected = static_cast<double>(out.radiance.g) * static_cast<double>(out.cosine) /
                              (static_cast<double>(out.prob) * static_cast<double>(out.pdf_area) *
                               static_cast<double>(out.pdf_solid_angle));
      ASSERT_NEAR(static_cast<double>(out.weight.g) / expected, 1, 1e-5) << light.name;
      ASSERT_EQ(out.vertex.emitter, 0u);
      mean.add(static_cast<double>(out.weight.g));
    }
    const auto power = static_cast<double>(scene->lights().power(0).g);
    const double known = light.power < 0 ? -light.power * kPi * r * r : light.power;
    if (known > 0) {
      EXPECT_NEAR(power / known, 1, std::max(light.power_error, 1e-4)) << light.name;
      EXPECT_NEAR(mean.mean(), known, 5 * mean.error() + 1e-4 * known) << light.name;
    } else {
      EXPECT_NEAR(mean.mean() / power, 1, 5 * mean.error() / power + 2e-2) << light.name;
    }
    EXPECT_EQ(scene->prob_emission(0), 1.0f);
  }
}

TEST(Emission, PositionsAreUniformOnTheSurface) {
  std::uint64_t seed = 100;
  for (const LightCase& light : light_cases()) {
    if (!(light.area > 0)) continue;
    const auto scene = built(light.body);
    ASSERT_NE(scene, nullptr);
    Draws draws(20, ++seed);
    const Vec3 center{0, 0, 2};
    const auto place = [&](Vec3 p) {
      const Vec3 v = p - center;
      const auto cell = [](float x) {
        return static_cast<std::size_t>(std::clamp((x + 1.2f) / 2.4f, 0.0f, 0.9999f) * 10);
      };
      return (cell(v.x) * 10 + cell(v.y)) * 10 + cell(v.z);
    };
    std::vector<double> by_sample(1000), by_line(1000);
    for (int i = 0; i < 60000; ++i) {
      EmissionSample out;
      if (!draw_emission(*scene, draws, out)) continue;
      ASSERT_NEAR(static_cast<double>(out.pdf_area) * light.area, 1, 1e-4) << light.name;
      // It lies on the surface: a ray from just above finds it, with the same normal.
      SurfaceHit hit;
      const Vec3 above = out.vertex.p + out.vertex.ng * 1e-3f;
      if (i < 2000) {
        ASSERT_TRUE(scene->intersect({above, -out.vertex.ng}, hit)) << light.name;
        ASSERT_NEAR(hit.distance, 1e-3f, 1e-5f);
        ASSERT_GT(dot(hit.ng, out.vertex.ng), 0.999f);
        ASSERT_EQ(hit.emitter, out.vertex.emitter);
        ASSERT_EQ(hit.shape, out.vertex.shape);
        EmissionDensity again;
        ASSERT_TRUE(scene->pdf_emission(hit, out.ray.direction, again));
        ASSERT_NEAR(again.pdf_area / out.pdf_area, 1, 1e-4f);
        ASSERT_NEAR(again.pdf_solid_angle, out.pdf_solid_angle, 1e-4f);
        ASSERT_EQ(again.prob, out.prob);
        ASSERT_FALSE(scene->pdf_emission(hit, -out.ray.direction, again));
        ASSERT_NEAR(scene->emitted(hit, out.ray.direction).g, out.radiance.g,
                    light.name.starts_with("textured") ? 0.81f : 1e-5f);
      }
      by_sample[place(out.vertex.p)] += 1;
    }
    for (int i = 0; i < 80000; ++i) {
      // A line through a ball around it: a direction, and a point on the disk across.
      const Vec3 d = test::uniform_direction(draws.stream);
      const Frame frame = make_frame(d);
      const Vec2 disk = warp::concentric_disk(draws.next_2d());
      Ray ray{center + (frame.s * disk.x + frame.t * disk.y) * 1.2f - d * 2.0f, d};
      SurfaceHit hit;
      for (int k = 0; k < 8 && scene->intersect(ray, hit); ++k) {
        by_line[place(hit.p)] += 1;
        ray = spawn_ray(hit, d);
      }
    }
    EXPECT_GT(two_sample_p(by_sample, by_line), 1e-6) << light.name;
  }
}

TEST(Emission, DirectionsFollowTheirDensity) {
  std::uint64_t seed = 200;
  for (const LightCase& light : light_cases()) {
    const auto scene = built(light.body + kFloor);
    ASSERT_NE(scene, nullptr);
    Draws draws(20, ++seed);
    constexpr int kSamples = 60000;
    std::vector<double> observed(kBins * kBins + 1), expected(kBins * kBins + 1), disk(kBins * kBins);
    const Vec3 axis = normalize(Vec3{0.1f, -0.1f, -2});  // of the spots
    const double cap = light.name == "wide spot" ? 1 - std::cos(140 * kPi / 180)
                       : light.name == "spot"    ? 1 - std::cos(40 * kPi / 180)
                                                 : 1 - std::cos(25 * kPi / 180);
    const Frame frame = make_frame(axis);
    int drawn = 0, disk_draws = 0;
    for (int i = 0; i < kSamples; ++i) {
      EmissionSample out;
      if (!draw_emission(*scene, draws, out)) continue;
      ++drawn;
      const Vec3 d = out.ray.direction;
      double a = 0, b = 0;
      if (light.area > 0) {
        const Vec3 l = out.vertex.shading.to_local(d);
        ASSERT_NEAR(l.z, out.cosine, 1e-5f);
        a = 1 - static_cast<double>(l.z * l.z);
        b = turn(static_cast<double>(l.y), static_cast<double>(l.x));
      } else if (light.name.ends_with("spot")) {
        const Vec3 l = frame.to_local(d);
        a = (1 - static_cast<double>(l.z)) / cap;
        b = turn(static_cast<double>(l.y), static_cast<double>(l.x));
        ASSERT_LT(a, 1 + 1e-5);
        ASSERT_NEAR(static_cast<double>(out.pdf_solid_angle) * 2 * kPi * cap, 1, 1e-4);
      } else if (light.name.starts_with("project")) {
        // Uniform over the picture, which reaches tan(30 degrees) to each side at distance 1.
        const double half = std::tan(30 * kPi / 180);
        const Vec3 left = normalize(cross(Vec3{0, 1, 0}, axis)), up = cross(axis, left);
        const double z = static_cast<double>(dot(d, axis));
        a = 0.5 - 0.5 * static_cast<double>(dot(d, left)) / z / half;
        b = 0.5 - 0.5 * static_cast<double>(dot(d, up)) / z / half;
        ASSERT_NEAR(static_cast<double>(out.pdf_solid_angle) * 4 * half * half * z * z * z, 1, 1e-4);
      } else {
        a = 0.5 - 0.5 * static_cast<double>(d.z);
        b = turn(static_cast<double>(d.y), static_cast<double>(d.x));
      }
      observed[bin(a) * kBins + bin(b)] += 1;
      if (out.infinite) {
        const double r = static_cast<double>(scene->features().radius) * (1 + 1e-5);
        const Vec3 v = out.ray.origin + d * static_cast<float>(r);  // in the disk through the scene's centre
        SurfaceHit hit;
        const Vec3 l = make_frame(d).to_local(v);
        const Vec3 middle =
            make_frame(d).to_local({0, 0, light.area > 0 ? 1.0f : 0.0f});  // the floor alone bounds the scene
        const double x = static_cast<double>(l.x - middle.x) / r, y = static_cast<double>(l.y - middle.y) / r;
        ASSERT_LT(x * x + y * y, 1 + 1e-4);
        ASSERT_NEAR(static_cast<double>(out.pdf_area) * kPi * r * r, 1, 1e-4);
        disk[bin(x * x + y * y) * kBins + bin(turn(y, x))] += 1;
        ++disk_draws;
        if (!out.delta_direction) {
          EmissionDensity again;
          ASSERT_TRUE(scene->pdf_emission_environment(-d, again));
          ASSERT_NEAR(again.pdf_solid_angle / out.pdf_solid_angle, 1, 0.5f);  // cells' edges round
        }
      }
    }
    EXPECT_GT(drawn, kSamples * 0.99) << light.name;
    if (disk_draws > 0) {
      EXPECT_GT(test::chi_squared_p(disk, std::vector<double>(kBins * kBins, disk_draws / 144.0)), 1e-6)
          << light.name;
    }
    if (light.name == "directional") {
      continue;  // there is one direction
    }
    if (light.name == "envmap") {
      double total = 0;
      constexpr std::size_t kFine = 40;
      for (std::size_t i = 0; i < kBins * kFine; ++i) {
        for (std::size_t j = 0; j < kBins * kFine; ++j) {
          const double z = 1 - 2 * (static_cast<double>(i) + 0.5) / (kBins * kFine), r = std::sqrt(1 - z * z);
          const double phi = 2 * kPi * ((static_cast<double>(j) + 0.5) / (kBins * kFine) - 0.5);
          EmissionDensity density;
          if (!scene->pdf_emission_environment(-Vec3(Vec3d{r * std::cos(phi), r * std::sin(phi), z}),
                                               density))
            continue;
          const double p =
              static_cast<double>(density.pdf_solid_angle) * 4 * kPi / (kBins * kFine * kBins * kFine);
          expected[i / kFine * kBins + j / kFine] += p;
          total += p;
        }
      }
      EXPECT_NEAR(total, 1, 2e-3);  // the pdf integrates to one, to the quadrature's error
      for (double& e : expected) e *= drawn / total;
    } else {
      for (std::size_t i = 0; i < kBins * kBins; ++i) expected[i] = drawn / 144.0;
    }
    EXPECT_GT(test::chi_squared_p(observed, expected), 1e-6) << light.name;
  }
}

// Light that next event estimation found, asked for as emission.
TEST(Emission, DensitiesOfDirectSamplesAreThoseOfEmission) {
  std::uint64_t seed = 300;
  for (const LightCase& light : light_cases()) {
    const auto scene = built(light.body + kFloor);
    ASSERT_NE(scene, nullptr);
    Draws draws(20, ++seed);
    int found = 0;
    for (int i = 0; i < 1000; ++i) {
      const SurfaceHit reference = point_reference({0.3f * draws.next(), 0.3f * draws.next(), 0.1f});
      DirectSample direct;
      const float u = draws.next();
      if (scene->sample_direct(reference, {}, u, draws.next_2d(), direct) != DirectOutcome::sampled) continue;
      EmissionDensity density;
      ASSERT_TRUE(scene->pdf_emission(direct, density)) << light.name;
      ++found;
      EXPECT_EQ(density.infinite, direct.infinite);
      EXPECT_EQ(direct.delta, density.delta_position || density.delta_direction);
      EmissionSample other;
      if (draw_emission(*scene, draws, other)) {
        EXPECT_NEAR(density.pdf_area / other.pdf_area, 1, 1e-5f);
        EXPECT_EQ(density.delta_position, other.delta_position);
        EXPECT_EQ(density.delta_direction, other.delta_direction);
        if (light.name.starts_with("project")) {
          const double cosine = static_cast<double>(-dot(direct.wi, normalize(Vec3{0.1f, -0.1f, -2})));
          EXPECT_NEAR(static_cast<double>(density.pdf_solid_angle) * 4 / 3 * cosine * cosine * cosine, 1,
                      1e-4);
        } else if (light.area == 0 && light.name != "envmap") {
          EXPECT_NEAR(density.pdf_solid_angle / other.pdf_solid_angle, 1, 1e-5f);
        }
      }
      if (light.area > 0) {
        SurfaceHit hit;
        if (!scene->intersect({reference.p, direct.wi}, hit) || hit.emitter == kNone) continue;
        EmissionDensity again;
        if (!scene->pdf_emission(hit, -direct.wi, again)) continue;
        if (dot(hit.ng, -direct.wi) < 0.05f) continue;  // grazing: another point of the surface is met
        EXPECT_NEAR(length(hit.p - direct.p), 0, 2e-3f) << light.name;
        EXPECT_NEAR(again.pdf_solid_angle / density.pdf_solid_angle, 1, 2e-2f) << light.name;
      } else if (!direct.infinite) {
        EXPECT_NEAR(length(normalize(direct.p - reference.p) - direct.wi), 0, 1e-6f);
      }
    }
    EXPECT_GT(found, light.name.starts_with("inner") ? -1 : 100) << light.name;
  }
}

double floor_by_light(const Scene& scene, Draws& draws, int n, std::uint32_t floor_shape, Mean& mean) {
  for (int i = 0; i < n; ++i) {
    EmissionSample out;
    SurfaceHit hit;
    double value = 0;
    if (draw_emission(scene, draws, out) && scene.intersect(out.ray, hit) && hit.shape == floor_shape &&
        dot(out.ray.direction, hit.ng) < 0)
      value = static_cast<double>(out.weight.g);
    mean.add(value);
  }
  return mean.mean();
}

double floor_by_direct(const Scene& scene, Draws& draws, int n, Mean& mean) {
  for (int i = 0; i < n; ++i) {
    const Vec2 u = draws.next_2d();
    SurfaceHit at = point_reference({2.4f * u.x - 1.2f, 2.4f * u.y - 1.2f, 0});
    at.error = 1e-6f;
    DirectSample light;
    double value = 0;
    const float choice = draws.next();
    if (scene.sample_direct(at, at.ng, choice, draws.next_2d(), light) == DirectOutcome::sampled &&
        !scene.occluded(light.shadow_ray))
      value = kFloorArea * static_cast<double>(light.radiance.g) * static_cast<double>(dot(at.ng, light.wi)) /
              static_cast<double>(light.pdf_solid_angle);
    mean.add(value);
  }
  return mean.mean();
}

TEST(Emission, LightsAFloorAsDirectSamplingSeesIt) {
  std::uint64_t seed = 400;
  for (const LightCase& light : light_cases()) {
    const auto scene = built(light.body + kFloor);
    ASSERT_NE(scene, nullptr);
    Draws draws(20, ++seed);
    Mean by_light, by_direct;
    floor_by_light(*scene, draws, 150000, light.area > 0 ? 1 : 0, by_light);
    floor_by_direct(*scene, draws, 60000, by_direct);
    EXPECT_NEAR(by_light.mean(), by_direct.mean(), 5 * std::hypot(by_light.error(), by_direct.error()))
        << light.name;
    if (light.name != "inner sphere") {
      EXPECT_GT(by_light.mean(), 0.01) << light.name;
    }
  }
}

TEST(Emission, ManyEmittersAreChosenByPowerAndKeepTheirLight) {
  std::string body;
  for (const LightCase& light : light_cases())
    if (light.name != "constant") body += light.body;  // a scene has one environment
  body += kFloor;
  const auto scene = built(body);
  ASSERT_NE(scene, nullptr);
  const std::uint32_t count = scene->features().emitters;
  ASSERT_EQ(count, light_cases().size() - 1);
  double total = 0, power = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    total += static_cast<double>(scene->prob_emission(i));
    power += static_cast<double>(luminance(scene->lights().power(i)));
  }
  EXPECT_NEAR(total, 1, 1e-6);
  Draws draws(20, 500);
  std::vector<double> observed(count), expected(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    expected[i] = 100000 * static_cast<double>(scene->prob_emission(i));
    EXPECT_NEAR(static_cast<double>(scene->prob_emission(i)) * power /
                    static_cast<double>(luminance(scene->lights().power(i))),
                1, 1e-4);
  }
  int drawn = 0;
  for (int i = 0; i < 100000; ++i) {
    EmissionSample out;
    if (!draw_emission(*scene, draws, out)) continue;
    ++drawn;
    observed[out.vertex.emitter] += 1;
  }
  EXPECT_GT(drawn, 99900);
  EXPECT_GT(test::chi_squared_p(observed, expected), 1e-6);
  Mean by_light, by_direct;
  // The floor comes after the shapes that emit.
  std::uint32_t shapes = 0;
  for (const LightCase& light : light_cases()) shapes += light.area > 0 ? 1 : 0;
  floor_by_light(*scene, draws, 300000, shapes, by_light);
  floor_by_direct(*scene, draws, 150000, by_direct);
  EXPECT_NEAR(by_light.mean(), by_direct.mean(), 5 * std::hypot(by_light.error(), by_direct.error()));
}

TEST(Emission, OfNothingIsNothing) {
  const auto scene = built(kFloor);
  ASSERT_NE(scene, nullptr);
  EmissionSample out;
  EXPECT_FALSE(scene->sample_emission(0.5f, {0.5f, 0.5f}, {0.5f, 0.5f}, out));
}

// Claim: a projector's picture is upright and not mirrored for who looks along it, fov spans its width, and
// the irradiance of a plane across the axis is pi E / z^2 wherever on it, dark beside the picture.
TEST(Projectors, ShowTheirPictureOnAPlane) {
  // 2 x 1 texels: red to the left, green to the right.
  std::string picture = "PF\n2 1\n-1.0\n";
  for (const float v : {1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f}) {
    char bytes[4];
    __builtin_memcpy(bytes, &v, 4);
    picture.append(bytes, 4);
  }
  const auto scene = build_scene(
      "<emitter type=\"projector\"><float name=\"fov\" value=\"90\"/><float name=\"scale\" "
      "value=\"2\"/><texture "
      "name=\"irradiance\" type=\"bitmap\"><string name=\"filename\" value=\"p.pfm\"/><string "
      "name=\"filter_type\" value=\"nearest\"/></texture></emitter>" +
          kFloor,
      {{"p.pfm", picture}});
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  const auto irradiance = [&](Vec3 p) {
    DirectSample out;
    const Vec3 back{0, 0, -1};
    const DirectOutcome outcome =
        (*scene)->sample_direct(test::point_reference(p, back), back, 0.5f, {0.5f, 0.5f}, out);
    return outcome == DirectOutcome::sampled ? out.radiance * dot(out.wi, back) : Spectrum();
  };
  // +x is to the left; the picture is twice as wide as high: half its height is 1/2 at distance 1.
  for (const float z : {1.0f, 3.0f}) {
    for (const Vec2 at : {Vec2{0.9f, 0.4f}, Vec2{0.1f, -0.45f}, Vec2{0.5f, 0}}) {
      const Spectrum left = irradiance({at.x * z, at.y * z, z}), right = irradiance({-at.x * z, at.y * z, z});
      EXPECT_NEAR(left.r * z * z, 2 * kPi, 1e-4);
      EXPECT_EQ(left.g, 0);
      EXPECT_NEAR(right.g * z * z, 2 * kPi, 1e-4);
      EXPECT_EQ(right.r, 0);
    }
    EXPECT_TRUE(irradiance({1.1f * z, 0, z}).is_black());
    EXPECT_TRUE(irradiance({0, 0.55f * z, z}).is_black());
    EXPECT_TRUE(irradiance({0.1f, 0.1f, -z}).is_black());
  }
  for (const char* bad : {"<float name=\"fov\" value=\"60\"/><string name=\"focal_length\" value=\"50mm\"/>",
                          "<transform name=\"to_world\"><scale x=\"2\"/></transform>"}) {
    EXPECT_FALSE(build_scene(std::string("<emitter type=\"projector\">") + bad + "</emitter>").ok()) << bad;
  }
}

// Mitsuba's falloff, by hand, and its refusals.
TEST(SpotLights, FallOffLinearlyInTheAngle) {
  const auto scene = built(
      "<emitter type=\"spot\"><transform name=\"to_world\"><rotate y=\"1\" angle=\"90\"/><translate x=\"1\" "
      "y=\"2\" z=\"3\"/></transform><rgb name=\"intensity\" value=\"8\"/><float name=\"cutoff_angle\" "
      "value=\"30\"/></emitter>");
  ASSERT_NE(scene, nullptr);
  const auto at = [&](double degrees, double around) {
    const double a = degrees * kPi / 180;
    const Vec3 d(Vec3d{std::cos(a), std::sin(a) * std::cos(around), std::sin(a) * std::sin(around)});
    DirectSample light;
    if (scene->sample_direct(point_reference(Vec3{1, 2, 3} + d * 2.0f), {}, 0.5f, {0.5f, 0.5f}, light) !=
        DirectOutcome::sampled)
      return 0.0;
    EXPECT_TRUE(light.delta);
    EXPECT_EQ(light.pdf_solid_angle, 1.0f);
    EXPECT_NEAR(dot(light.wi, d), -1, 1e-6f);
    return static_cast<double>(light.radiance.g);
  };
  EXPECT_NEAR(at(0, 0), 2, 1e-5);
  EXPECT_NEAR(at(22.4, 1), 2, 1e-5);  // beam_width is 3/4 of the cutoff
  EXPECT_NEAR(at(26.25, 2), 1, 1e-4);
  EXPECT_NEAR(at(28.5, 4), 0.4, 1e-4);
  EXPECT_EQ(at(30.01, 5), 0);
  EXPECT_EQ(at(150, 5), 0);
  for (const char* bad :
       {"<float name=\"cutoff_angle\" value=\"0\"/>", "<float name=\"cutoff_angle\" value=\"181\"/>",
        "<float name=\"beam_width\" value=\"21\"/>",
        "<transform name=\"to_world\"><scale x=\"2\"/></transform>",
        "<float name=\"cutoff_angle\" value=\"95\"/><texture name=\"texture\" type=\"checkerboard\"/>"}) {
    EXPECT_FALSE(build_scene(std::string("<emitter type=\"spot\">") + bad + "</emitter>").ok()) << bad;
  }
}

}  // namespace
}  // namespace candela::scene
