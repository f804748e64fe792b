// Volumes, free flights and transmittances. Every statistical comparison is a two-sided test
// at 5 standard errors or a chi-squared test at p = 1e-6; there are fewer than 400 of them, so that the file
// alarms falsely with probability below 4e-4. Seeds are fixed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/long_form.h"
#include "tests/statistical/moments.h"
#include "tests/unit/chi_squared.h"
#include "tests/unit/expected_mean.h"
#include "tests/unit/scene_fixture.h"
#include "tests/unit/volume_file.h"
#include "worker/scene/media/medium.h"

namespace candela::scene {
namespace {

using test::build_scene;
using test::chi_squared_p;
using test::expect_mean;
using test::volume_file;

constexpr double kMinP = 1e-6;

using Mean = statistical::Moments;

double channel(Spectrum s, int c) {
  return static_cast<double>(c == 0 ? s.r : c == 1 ? s.g : s.b);
}

std::unique_ptr<Scene> medium_scene(const std::string& medium,
                                    std::map<std::string, std::string> files = {}) {
  auto scene = build_scene("<shape type=\"cube\">" + medium + "</shape>", std::move(files));
  EXPECT_TRUE(scene.ok()) << scene.error().to_string();
  return scene.ok() ? std::move(scene).value() : nullptr;
}

std::string homogeneous(const std::string& sigma_t, const std::string& albedo = "0.75") {
  return "<medium name=\"interior\" type=\"homogeneous\"><rgb name=\"sigma_t\" value=\"" + sigma_t +
         "\"/><rgb name=\"albedo\" value=\"" + albedo + "\"/></medium>";
}

std::string grid(const std::string& more = "", const std::string& albedo = "0.75", double scale = 1) {
  return "<medium name=\"interior\" type=\"heterogeneous\"><volume name=\"sigma_t\" type=\"gridvolume\">"
         "<string name=\"filename\" value=\"v.vol\"/>" +
         more + "</volume><rgb name=\"albedo\" value=\"" + albedo + "\"/>" +
         fmt::format("<float name=\"scale\" value=\"{}\"/>", scale) + "</medium>";
}

// Claim: without light's colour to tell, flights are exponential; where channels differ they follow the
// mixture of pdf_distance, and the weights are sigma_s T over it. Beyond t_max they pass with prob_pass.
TEST(SceneMedia, HomogeneousFlights) {
  for (const char* sigma : {"2", "0.5, 2, 8", "0, 1, 3"}) {
    const auto scene = medium_scene(homogeneous(sigma, "0.9, 0.5, 0.2"));
    const Medium& medium = scene->medium(0);
    const Spectrum sigma_t = medium.sigma_t({}), albedo(0.9f, 0.5f, 0.2f);
    for (const Spectrum channels : {Spectrum(1.0f), Spectrum(0.2f, 3, 0.01f), Spectrum(1, 0, 0)}) {
      const Ray ray = {{0.1f, 0.2f, 0.3f}, normalize(Vec3{1, 2, -1}), 1.3f};
      constexpr int kBins = 40, kSamples = 40000;
      std::vector<double> observed(kBins + 1, 0.0), expected(kBins + 1, 0.0);
      const auto passes = [&](double t) {
        return static_cast<double>(medium.prob_pass(static_cast<float>(t), channels));
      };
      for (int i = 0; i < kBins; ++i)
        expected[static_cast<std::size_t>(i)] =
            kSamples * (passes(1.3 * i / kBins) - passes(1.3 * (i + 1) / kBins));
      expected[kBins] = kSamples * passes(1.3);
      rng::Stream stream(11);
      for (int i = 0; i < kSamples; ++i) {
        const float u = stream.next_float();
        const DistanceSample s = medium.sample_distance(ray, channels, {u, stream.next_float()});
        const float t = s.scattered ? s.distance : ray.t_max;
        ++observed[s.scattered ? static_cast<std::size_t>(std::min(t / 1.3f, 0.9999f) * kBins) : kBins];
        for (int c = 0; c < 3; ++c) {
          const double transmitted = std::exp(-channel(sigma_t, c) * static_cast<double>(t));
          const double value = s.scattered ? channel(albedo, c) * channel(sigma_t, c) * transmitted /
                                                 static_cast<double>(medium.pdf_distance(t, channels))
                                           : transmitted / passes(static_cast<double>(t));
          ASSERT_NEAR(channel(s.weight, c), value, 1e-4 * value + 1e-7);
        }
        ASSERT_LE(luminance(s.weight * channels), 3 * 1.0001f * (channels.r + channels.g + channels.b));
        const Spectrum left = s.weight * channels;
        ASSERT_LE(left.r + left.g + left.b, 1.0001f * (channels.r + channels.g + channels.b));
      }
      EXPECT_GT(chi_squared_p(observed, expected), kMinP) << sigma;
      // pdf_distance is the derivative of prob_pass.
      for (const double t : {0.01, 0.4, 1.2})
        EXPECT_NEAR((passes(t - 1e-3) - passes(t + 1e-3)) / 2e-3,
                    static_cast<double>(medium.pdf_distance(static_cast<float>(t), channels)), 2e-3);
      const Spectrum exact = medium.transmittance(ray, stream);
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(channel(exact, c), std::exp(-channel(sigma_t, c) * static_cast<double>(ray.t_max)), 1e-6);
    }
  }
}

// Claim: a flight of 20 and 30 mean free paths happens as often as it should: 24 bits are not the end.
TEST(SceneMedia, LongFlightsHappen) {
  const auto scene = medium_scene(homogeneous("1"));
  for (const float d : {17.0f, 25.0f}) {
    const DistanceSample s =
        scene->medium(0).sample_distance({{}, {0, 0, 1}, d}, Spectrum(1), {0.9999999f, 0x1.fffffep-1f});
    EXPECT_FALSE(s.scattered);
  }
}

// ---- grids ----

struct Field {
  std::string file;
  std::string more;
  double scale = 1;
};

std::vector<float> checker(int n, float low, float high, int channels = 1) {
  std::vector<float> values;
  for (int z = 0; z < n; ++z)
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x)
        for (int c = 0; c < channels; ++c)
          values.push_back(((x + y + z + c) & 1) != 0 ? high : low * static_cast<float>(c + 1));
  return values;
}

std::vector<Field> fields() {
  rng::Stream stream(3);
  std::vector<float> noise, colours;
  for (int i = 0; i < 7 * 5 * 9; ++i) noise.push_back(8 * stream.next_float());
  for (int i = 0; i < 3 * 6 * 6 * 6; ++i) colours.push_back(std::pow(stream.next_float(), 4.0f) * 20);
  const std::string centred = test::matrix({2, 0, 0, -1, 0, 2, 0, -1, 0, 0, 2, -1, 0, 0, 0, 1});
  const std::string turned =
      test::matrix({1.2, -1.6, 0, 0.1, 1.6, 1.2, 0, -1.3, 0, 0.4, 2, -1.1, 0, 0, 0, 1});
  const std::string nearest = "<string name=\"filter_type\" value=\"nearest\"/>";
  return {{volume_file({7, 5, 9}, 1, noise), centred},
          {volume_file({7, 5, 9}, 1, noise), turned + nearest, 0.5},
          {volume_file({8, 8, 8}, 1, checker(8, 0, 6)), centred + nearest},
          {volume_file({8, 8, 8}, 1, checker(8, 0, 6)),
           centred + "<string name=\"wrap_mode\" value=\"repeat\"/>"},
          {volume_file({6, 6, 6}, 3, colours), centred},
          {volume_file({4, 4, 4}, 3, checker(4, 1, 5, 3)),
           turned + "<string name=\"wrap_mode\" value=\"mirror\"/>"},
          {volume_file({1, 1, 1}, 1, {3}), centred},
          {volume_file({2, 2, 2}, 1, std::vector<float>(8, 0.0f)), centred}};
}

// sigma_t along a ray by the literal formula: zero outside the grid.
Spectrum sigma_t_at(const Medium& medium, const GridVolume& grid, const Ray& ray, double t) {
  const Vec3d p = Vec3d(ray.origin) + Vec3d(ray.direction) * t;
  const Vec3d l = grid.to_local(p);
  for (int i = 0; i < 3; ++i)
    if (!(l[i] >= 0 && l[i] <= 1)) return {};
  return medium.sigma_t(Vec3(p));
}

constexpr int kSteps = 8000;
// Optical thickness up to each of kSteps + 1 even distances, per channel, by the trapezoid rule.
std::vector<std::array<double, 3>> thickness(const Medium& medium, const GridVolume& grid, const Ray& ray) {
  std::vector<std::array<double, 3>> sums(kSteps + 1);
  const double step = static_cast<double>(ray.t_max) / kSteps;
  for (int i = 0; i < kSteps; ++i) {
    const Spectrum s = sigma_t_at(medium, grid, ray, (i + 0.5) * step);
    for (std::size_t c = 0; c < 3; ++c)
      sums[static_cast<std::size_t>(i) + 1][c] =
          sums[static_cast<std::size_t>(i)][c] + channel(s, static_cast<int>(c)) * step;
  }
  return sums;
}

// The grid of a Field once more, to ask it where it ends.
GridVolume grid_of(const Field& field) {
  const test::TextFiles files({{"v.vol", field.file},
                               {"scene.xml", "<scene version=\"3.0.0\"><shape type=\"cube\">" +
                                                 grid(field.more) + "</shape></scene>"}});
  const auto description = description::parse_scene(files, "scene.xml", {});
  EXPECT_TRUE(description.ok());
  const auto& medium = *description->scene->children[0].object->children[0].object;
  auto built = GridVolume::build(*medium.find_child("sigma_t")->object, files);
  EXPECT_TRUE(built.ok());
  return std::move(built).value();
}

// Claim: a tiny and dense grid, half of it empty, seen from very far away ends every walk: distances between
// collisions are far below the float spacing of the ray's own.
TEST(SceneMedia, FarGridsEndEveryWalk) {
  const Field field = {volume_file({8, 8, 8}, 1, checker(8, 0, 1)),
                       test::matrix({1e-6, 0, 0, 0, 0, 1e-6, 0, 0, 0, 0, 1e-6, 0, 0, 0, 0, 1}) +
                           "<string name=\"filter_type\" value=\"nearest\"/>",
                       3e12};
  const auto scene = medium_scene(grid(field.more, "0.9, 0.6, 0.3", field.scale), {{"v.vol", field.file}});
  const Medium& medium = scene->medium(0);
  rng::Stream stream(rng::key(22));
  // A walk makes 375,000 collisions in the empty half before one that ends it.
  const int walks = test::long_form() ? 200 : 20;
  int met = 0;
  for (int i = 0; i < walks; ++i) {
    const Ray ray = {{5e-7f, 5e-7f, -1e6f}, {0, 0, 1}, 3e6f};
    const float u = stream.next_float();
    const DistanceSample s = medium.sample_distance(ray, Spectrum(1), {u, stream.next_float()});
    met += s.scattered ? 1 : 0;
    if (s.scattered) {
      EXPECT_NEAR(s.distance, 1e6f, 1);
    }
    EXPECT_LT(medium.transmittance(ray, stream).max_component(), 1e-3f);
  }
  EXPECT_EQ(met, walks);
}

// Claim: the weights of free flights estimate sigma_t T (times the albedo) in every part of a ray, and T at
// its end, in every channel, whatever the channels' shares; their sum never grows.
TEST(SceneMedia, GridFlightsAgainstQuadrature) {
  int index = 0;
  for (const Field& field : fields()) {
    const auto scene = medium_scene(grid(field.more, "0.9, 0.6, 0.3", field.scale), {{"v.vol", field.file}});
    const Medium& medium = scene->medium(0);
    ASSERT_FALSE(medium.homogeneous());
    const GridVolume where = grid_of(field);
    const Spectrum albedo(0.9f, 0.6f, 0.3f);
    const Ray ray = {{-1.4f, 0.3f, -0.9f}, normalize(Vec3{1, -0.25f, 0.7f}), 2.6f};
    const auto depth = thickness(medium, where, ray);
    for (const Spectrum channels : {Spectrum(1.0f), Spectrum(4, 1, 0.05f)}) {
      constexpr int kParts = 5, kSamples = 20000;
      std::vector<std::array<Mean, 3>> means(kParts + 1);
      rng::Stream stream(rng::key(21, index++));
      for (int i = 0; i < kSamples; ++i) {
        const float u = stream.next_float();
        const DistanceSample s = medium.sample_distance(ray, channels, {u, stream.next_float()});
        const Spectrum left = s.weight * channels;
        ASSERT_LE(left.r + left.g + left.b, 1.0001f * (channels.r + channels.g + channels.b));
        const int part = s.scattered ? static_cast<int>(s.distance / ray.t_max * kParts) : kParts;
        for (int p = 0; p <= kParts; ++p)
          for (int c = 0; c < 3; ++c)
            means[static_cast<std::size_t>(p)][static_cast<std::size_t>(c)].add(
                p == part ? channel(s.weight, c) : 0);
      }
      const float all = channels.r + channels.g + channels.b;
      const std::array<double, 3> most = {channel(Spectrum(all) / channels, 0),
                                          channel(Spectrum(all) / channels, 1),
                                          channel(Spectrum(all) / channels, 2)};
      for (int c = 0; c < 3; ++c) {
        const auto passed = [&](int part) {
          return std::exp(
              -depth[static_cast<std::size_t>(part * kSteps / kParts)][static_cast<std::size_t>(c)]);
        };
        for (int p = 0; p < kParts; ++p)
          expect_mean(means[static_cast<std::size_t>(p)][static_cast<std::size_t>(c)],
                      channel(albedo, c) * (passed(p) - passed(p + 1)),
                      fmt::format("field {} part {} channel {}", index, p, c), 2e-3,
                      most[static_cast<std::size_t>(c)]);
        expect_mean(means[kParts][static_cast<std::size_t>(c)], passed(kParts),
                    fmt::format("field {} passing, channel {}", index, c), 2e-3,
                    most[static_cast<std::size_t>(c)]);
      }
    }
  }
}

// Claim: the weights of a flight at its steps estimate T at every distance over the flights that pass it, in
// every channel, whatever the channels' shares; the last one is the flight's own. In a gray grid a flight has
// no steps.
TEST(SceneMedia, StepsOfGridFlightsAgainstQuadrature) {
  int index = 0;
  for (const Field& field : fields()) {
    const auto scene = medium_scene(grid(field.more, "0.9, 0.6, 0.3", field.scale), {{"v.vol", field.file}});
    const Medium& medium = scene->medium(0);
    const GridVolume where = grid_of(field);
    const Ray ray = {{-1.4f, 0.3f, -0.9f}, normalize(Vec3{1, -0.25f, 0.7f}), 2.6f};
    const auto depth = thickness(medium, where, ray);
    for (const Spectrum channels : {Spectrum(1.0f), Spectrum(4, 1, 0.05f)}) {
      constexpr int kPlaces = 5, kSamples = 20000;
      std::vector<std::array<Mean, 3>> means(kPlaces);
      rng::Stream stream(rng::key(23, index++));
      std::vector<FlightStep> steps;
      for (int i = 0; i < kSamples; ++i) {
        const Vec2 u{stream.next_float(), stream.next_float()};
        steps.clear();
        const DistanceSample s = medium.sample_distance(ray, channels, u, &steps);
        const DistanceSample plain = medium.sample_distance(ray, channels, u);
        ASSERT_EQ(s.weight, plain.weight);
        ASSERT_TRUE(!where.gray() || steps.empty());
        if (!s.scattered) {
          ASSERT_EQ(weight_at(steps, ray.t_max), steps.empty() ? Spectrum(1) : s.weight);
        }
        for (int p = 0; p < kPlaces; ++p) {
          const float at = ray.t_max * static_cast<float>(p + 1) / kPlaces;
          const bool passes = !s.scattered || s.distance > at;
          for (int c = 0; c < 3; ++c)
            means[static_cast<std::size_t>(p)][static_cast<std::size_t>(c)].add(
                passes ? channel(weight_at(steps, at), c) : 0);
        }
      }
      const float all = channels.r + channels.g + channels.b;
      for (int p = 0; p < kPlaces; ++p)
        for (int c = 0; c < 3; ++c) {
          const auto k = static_cast<std::size_t>(c);
          expect_mean(means[static_cast<std::size_t>(p)][k],
                      std::exp(-depth[static_cast<std::size_t>((p + 1) * kSteps / kPlaces)][k]),
                      fmt::format("field {} place {} channel {}", index, p, c), 2e-3,
                      channel(Spectrum(all) / channels, c));
        }
    }
  }
}

// Claim: beyond a grid's box sigma_t_inside is 0, within it sigma_t; rays end where they leave the box, or
// one wider by a share of its size on each side.
TEST(SceneMedia, GridsEndAtTheirBox) {
  const std::string placed = test::matrix({2, 0, 0, -1, 0, 2, 0, -1, 0, 0, 2, -1, 0, 0, 0, 1});
  const auto scene =
      medium_scene(grid(placed), {{"v.vol", volume_file({2, 2, 2}, 1, std::vector<float>(8, 3.0f))}});
  const Medium& medium = scene->medium(0);
  EXPECT_EQ(medium.sigma_t_inside({0.9f, -0.9f, 0}), Spectrum(3));
  EXPECT_EQ(medium.sigma_t_inside({1.1f, 0, 0}), Spectrum(0.0f));
  EXPECT_EQ(medium.sigma_t({1.1f, 0, 0}), Spectrum(3));
  const Ray ray{{-3, 0.5f, 0}, {1, 0, 0}};
  EXPECT_FLOAT_EQ(medium.distance_to_end(ray, 0), 4);
  EXPECT_FLOAT_EQ(medium.distance_to_end(ray, 0.5), 5);
  EXPECT_EQ(medium.distance_to_end({ray.origin, ray.direction, 2.5f}, 0), 2.5f);
  EXPECT_EQ(medium.distance_to_end({ray.origin, {0, 1, 0}}, 0), 0);
  EXPECT_EQ(medium.distance_to_end({ray.origin, {-1, 0, 0}}, 0), 0);
  const auto fog = medium_scene(homogeneous("2"));
  EXPECT_EQ(fog->medium(0).sigma_t_inside({9, 9, 9}), Spectrum(2));
  EXPECT_EQ(fog->medium(0).distance_to_end({ray.origin, ray.direction, 7}, 0), 7);
}

// Claim: transmittances are unbiased, in [0, 1], and without noise where the grid is uniform.
TEST(SceneMedia, GridTransmittanceAgainstQuadrature) {
  int index = 0;
  for (const Field& field : fields()) {
    const auto scene = medium_scene(grid(field.more, "0.9", field.scale), {{"v.vol", field.file}});
    const Medium& medium = scene->medium(0);
    const GridVolume where = grid_of(field);
    ++index;
    for (const Ray ray : {Ray{{-1.4f, 0.3f, -0.9f}, normalize(Vec3{1, -0.25f, 0.7f}), 2.6f},
                          Ray{{0, 0, -5}, {0, 0, 1}, 4.7f}, Ray{{0.2f, 0.9f, 0.1f}, {0, -1, 0}, 1.0f}}) {
      const auto depth = thickness(medium, where, ray);
      std::array<Mean, 3> means;
      rng::Stream stream(rng::key(22, index));
      for (int i = 0; i < 20000; ++i) {
        const Spectrum t = medium.transmittance(ray, stream);
        ASSERT_TRUE(t.r >= 0 && t.r <= 1 && t.g >= 0 && t.g <= 1 && t.b >= 0 && t.b <= 1);
        for (int c = 0; c < 3; ++c) means[static_cast<std::size_t>(c)].add(channel(t, c));
      }
      for (std::size_t c = 0; c < 3; ++c)
        expect_mean(means[c], std::exp(-depth[kSteps][c]), fmt::format("field {} channel {}", index, c), 2e-3,
                    1);
      if (index >= 7) {
        EXPECT_LT(means[0].error(), 1e-6) << "a uniform grid needs no chance";
      }
    }
  }
}

// Claim: media 1e5 mean free paths thick, empty ones and rays that miss the grid take few steps and give the
// plain answer.
TEST(SceneMedia, ThickAndEmpty) {
  const std::string placed = test::matrix({2, 0, 0, -1, 0, 2, 0, -1, 0, 0, 2, -1, 0, 0, 0, 1});
  rng::Stream stream(5);
  for (const auto& values : {checker(16, 0, 1), std::vector<float>(16 * 16 * 16, 1.0f)}) {
    const auto scene =
        medium_scene(grid(placed, "1", 1e5), {{"v.vol", volume_file({16, 16, 16}, 1, values)}});
    const Medium& medium = scene->medium(0);
    for (int i = 0; i < 20000; ++i) {
      const Vec3 d = test::uniform_direction(stream);
      const Ray ray = {d * -3.0f, d, 6};
      ASSERT_TRUE(medium.transmittance(ray, stream).is_black());
      const DistanceSample s =
          medium.sample_distance(ray, Spectrum(1), {stream.next_float(), stream.next_float()});
      ASSERT_TRUE(s.scattered);
      ASSERT_NEAR(s.weight.g, 1, 1e-3);
      ASSERT_LE(s.distance, 2.1f);
    }
    const Ray beside = {{-5, 1.1f, 0}, {1, 0, 0}, 10};
    EXPECT_EQ(medium.transmittance(beside, stream), Spectrum(1));
    EXPECT_FALSE(medium.sample_distance(beside, Spectrum(1), {0.5f, 0.5f}).scattered);
  }
  const auto nothing = medium_scene(homogeneous("0"));
  EXPECT_EQ(nothing->medium(0).transmittance({{}, {0, 0, 1}}, stream), Spectrum(1));
  EXPECT_FALSE(nothing->medium(0).sample_distance({{}, {0, 0, 1}}, Spectrum(1), {0.5f, 0.99f}).scattered);
  EXPECT_FALSE(nothing->features().any_scattering_medium);
}

// Claim: grids are looked up as Mitsuba documents them: values at the centres of cells of [0, 1]^3, wrap
// modes beyond, the file's box where asked for.
TEST(SceneMedia, GridLookups) {
  const std::string file = volume_file({4, 1, 1}, 1, {1, 2, 4, 8}, 1, {-1, 0, 0, 3, 1, 1});
  const auto at = [&](const std::string& more, float x) {
    const auto scene = medium_scene(grid(more), {{"v.vol", file}});
    return scene->medium(0).sigma_t({x, 0.5f, 0.5f}).g;
  };
  const auto wrap = [](const char* mode) {
    return fmt::format("<string name=\"wrap_mode\" value=\"{}\"/>", mode);
  };
  EXPECT_FLOAT_EQ(at("", 0.125f), 1);
  EXPECT_FLOAT_EQ(at("", 0.25f), 1.5f);
  EXPECT_FLOAT_EQ(at("", 0.875f), 8);
  EXPECT_FLOAT_EQ(at("", 0.99f), 8);
  EXPECT_FLOAT_EQ(at(wrap("repeat"), 1.0f), 4.5f);
  EXPECT_FLOAT_EQ(at(wrap("mirror"), 1.0f), 8);
  EXPECT_FLOAT_EQ(at(wrap("repeat"), 1.375f), 2);
  EXPECT_FLOAT_EQ(at(wrap("mirror"), 1.375f), 4);
  EXPECT_FLOAT_EQ(at("<string name=\"filter_type\" value=\"nearest\"/>", 0.49f), 2);
  const std::string box = "<boolean name=\"use_grid_bbox\" value=\"true\"/>";
  EXPECT_FLOAT_EQ(at(box, 0.0f), 1.5f);
  EXPECT_FLOAT_EQ(at(box + "<transform name=\"to_world\"><translate x=\"1\"/></transform>", 2.0f), 3);
}

// Claim: the albedo may vary where the extinction does not, and the other way round: a flight's weight has
// that of the place where it ends.
TEST(SceneMedia, AlbedoMayVary) {
  const std::string file = volume_file({2, 1, 1}, 3, {1, 0.5f, 0, 0, 0.5f, 1});
  const std::string albedo =
      "<volume name=\"albedo\" type=\"gridvolume\"><string name=\"filename\" value=\"v.vol\"/>"
      "<string name=\"filter_type\" value=\"nearest\"/></volume>";
  const std::string tail = albedo + "<float name=\"sigma_t\" value=\"3\"/></medium>";
  for (const char* kind : {"homogeneous", "heterogeneous"}) {
    const auto scene =
        medium_scene(fmt::format("<medium name=\"interior\" type=\"{}\">{}", kind, tail), {{"v.vol", file}});
    const Medium& medium = scene->medium(0);
    EXPECT_TRUE(medium.homogeneous()) << "constant extinction has closed forms";
    EXPECT_EQ(medium.max_albedo(), Spectrum(1, 0.5f, 1));
    int ends = 0;
    for (const float u : {0.1f, 0.5f, 0.7f, 0.9f}) {
      const DistanceSample s =
          medium.sample_distance({{0, 0.5f, 0.5f}, {1, 0, 0}, 1}, Spectrum(1), {0.3f, u});
      if (!s.scattered) continue;
      ++ends;
      EXPECT_EQ(s.weight, s.distance < 0.5f ? Spectrum(1, 0.5f, 0) : Spectrum(0, 0.5f, 1)) << s.distance;
    }
    EXPECT_GE(ends, 3);
  }
}

// Claim: a ray that leaves a surface knows the medium it enters; a shape that only bounds a medium is not
// seen.
TEST(SceneMedia, InterfacesNameTheMediumBeyond) {
  const auto scene = build_scene(
      "<medium id=\"fog\" type=\"homogeneous\"/><medium id=\"milk\" type=\"homogeneous\"/>"
      "<shape type=\"cube\"><ref name=\"interior\" id=\"milk\"/><ref name=\"exterior\" id=\"fog\"/>"
      "<transform name=\"to_world\"><translate z=\"5\"/></transform></shape>"
      "<shape type=\"sphere\"><point name=\"center\" x=\"0\" y=\"0\" z=\"9\"/></shape>"
      "<emitter type=\"point\"><ref id=\"fog\"/></emitter><emitter type=\"constant\"/>"
      "<emitter type=\"spot\"><ref id=\"milk\"/></emitter>"
      "<shape type=\"rectangle\"><emitter type=\"area\"/><ref name=\"exterior\" id=\"milk\"/>"
      "<transform name=\"to_world\"><translate z=\"-9\"/></transform></shape>",
      {}, "<sensor type=\"perspective\"><ref id=\"fog\"/></sensor>");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  const Scene& s = **scene;
  EXPECT_EQ(s.features().media, 2u);
  const std::uint32_t fog = s.camera_medium({{0, 0, 0}, {0, 0, 1}});
  ASSERT_NE(fog, kNone);
  const auto emitter_medium = [&](std::uint32_t emitter, bool infinite) {
    EmissionSample light;
    light.vertex.emitter = emitter;
    light.infinite = infinite;
    light.ray = {{0, 0, -20}, {0, 0, -1}};
    return s.emitter_medium(light);
  };
  // Area lights come first. The camera's fog ends nowhere: the sky is in it too.
  EXPECT_EQ(emitter_medium(1, false), fog);
  EXPECT_EQ(emitter_medium(2, true), fog);
  SurfaceHit hit;
  const Ray ray = {{0.1f, 0.2f, 0}, {0, 0, 1}};
  ASSERT_TRUE(s.intersect(ray, hit));
  EXPECT_EQ(emitter_medium(0, false), s.medium_beyond(hit, ray.direction, fog));
  const std::uint32_t milk = s.medium_beyond(hit, ray.direction, fog);
  EXPECT_EQ(emitter_medium(3, false), milk);
  EXPECT_NE(milk, kNone);
  EXPECT_NE(milk, fog);
  EXPECT_EQ(s.medium_beyond(hit, -ray.direction, kNone), fog);
  EXPECT_EQ(s.passthrough(hit, -ray.direction), Spectrum(1));
  ASSERT_TRUE(s.intersect({{0.1f, 0.2f, 7}, {0, 0, 1}}, hit));
  EXPECT_EQ(s.medium_beyond(hit, {0, 0, 1}, milk), milk);
  EXPECT_TRUE(s.passthrough(hit, {0, 0, -1}).is_black());
}

// Claim: an instance carries the media of its group's shapes along.
TEST(SceneMedia, InstancesHaveMedia) {
  const auto scene = build_scene(
      "<shape type=\"shapegroup\" id=\"g\"><shape type=\"cube\"><medium name=\"interior\" "
      "type=\"homogeneous\"/>"
      "</shape></shape><shape type=\"instance\"><ref id=\"g\"/><transform name=\"to_world\">"
      "<scale x=\"-1\" y=\"2\"/><translate z=\"5\"/></transform></shape>");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  SurfaceHit hit;
  ASSERT_TRUE((*scene)->intersect({{0.1f, 0.2f, 0}, {0, 0, 1}}, hit));
  EXPECT_EQ((*scene)->medium_beyond(hit, {0, 0, 1}, kNone), 0u);
  EXPECT_EQ((*scene)->medium_beyond(hit, {0, 0, -1}, 0), kNone);
}

// Claim: what cannot be rendered is refused by name.
TEST(SceneMedia, NamesWhatCannotBeBuilt) {
  const auto message = [](const std::string& medium, const std::string& file = "") {
    const auto scene =
        build_scene("<shape type=\"cube\">" + medium + "</shape>", {{"v.vol", file}, {"smoke.vdb", ""}});
    return scene.ok() ? std::string("no error") : scene.error().to_string();
  };
  const std::string dense = volume_file({1, 1, 1}, 1, {2});
  EXPECT_EQ(
      message(grid("", "1", 1e8), dense),
      "scene.xml:3: scale: the grid is more than 1e7 mean free paths thick: nothing inside would be seen "
      "(lower the scale, or bound a homogeneous medium by its surface)");
  EXPECT_EQ(
      message("<medium name=\"interior\" type=\"homogeneous\"><volume name=\"albedo\" type=\"gridvolume\">"
              "<string name=\"filename\" value=\"v.vol\"/></volume></medium>",
              dense),
      "scene.xml:3: albedo: the albedo is above 1 somewhere: the medium would make light");
  EXPECT_EQ(
      message("<medium name=\"interior\" type=\"heterogeneous\"><volume name=\"sigma_t\" type=\"gridvolume\">"
              "<string name=\"filename\" value=\"smoke.vdb\"/></volume></medium>"),
      "scene.xml:3: filename: 'smoke.vdb' is not an OpenVDB file: it does not start as one");
  EXPECT_EQ(message(grid("<string name=\"grid\" value=\"density\"/>"), dense),
            "scene.xml:3: grid: only OpenVDB and NanoVDB files have grids with names, and 'v.vol' is none");
  // A file that starts as OpenVDB's do and has no more: its error depends on the build, its name does not.
  EXPECT_THAT(
      message(grid(""), std::string(" BDV\0\0\0\0", 8)),
      testing::AnyOf("v.vol: the OpenVDB file is cut short or damaged",
                     "scene.xml:3: filename: this build of Candela does not read OpenVDB files: 'v.vol' "
                     "(install libopenvdb-dev and build again, or convert the file to Mitsuba's .vol "
                     "format)"));
  EXPECT_EQ(message(grid("<boolean name=\"use_grid_bbox\" value=\"true\"/>"),
                    volume_file({1, 1, 1}, 1, {2}, 1, {0, 0, 0, 0, 1, 1})),
            "scene.xml:3: use_grid_bbox: the bounding box in 'v.vol' has no volume");
}

}  // namespace
}  // namespace candela::scene
