// Environment maps: Mitsuba's orientation, and samples against their density.
#include <gtest/gtest.h>

#include <cmath>

#include "common/rng/stream.h"
#include "tests/unit/chi_squared.h"
#include "tests/unit/scene_objects.h"
#include "worker/core/math.h"
#include "worker/scene/emitters/environment.h"

namespace candela::scene {
namespace {

using description::Object;
using description::Property;
using test::matrix;
using test::MemoryFiles;
using test::number;
using test::object;
using test::pfm;
using test::text;

std::shared_ptr<Object> envmap(std::vector<Property> more = {}) {
  more.push_back(text("filename", "sky.pfm"));
  return object("emitter", "envmap", std::move(more));
}

// 6 x 5 texels, one much brighter, some black.
std::vector<Spectrum> sky() {
  std::vector<Spectrum> texels;
  rng::Stream stream(rng::key(21));
  for (int i = 0; i < 30; ++i) {
    texels.push_back(i % 7 == 0 ? Spectrum(0)
                                : Spectrum{stream.next_float(), stream.next_float(), stream.next_float()});
  }
  texels[14] = {50, 40, 30};
  texels[0] = texels[1] = texels[6] = texels[7] = Spectrum(0);  // one cell wholly black
  return texels;
}

// Claim: Mitsuba 3's orientation: +y the top row; the middle of the image looks along +z, u grows from -z
// over +x.
TEST(Environment, Orientation) {
  MemoryFiles files;
  std::vector<Spectrum> texels(8 * 5, Spectrum(0.1f));
  for (std::size_t x = 0; x < 8; ++x) {
    texels[x] = Spectrum(5);                               // the pole +y
    texels[16 + x] = Spectrum(static_cast<float>(x) + 1);  // the horizon
  }
  files.files["sky.pfm"] = pfm(8, 5, texels);
  TextureStore store(files);
  const auto e = Environment::build(*envmap({number("scale", 2)}), store);
  ASSERT_TRUE(e.ok()) << e.error().to_string();
  EXPECT_NEAR(e->radiance({0, 1, 0}).r, 10, 1e-5f);
  EXPECT_NEAR(e->radiance({0, -1, 0}).r, 0.2f, 1e-5f);
  const auto at = [](float u) { return Vec3{std::sin(2 * math::kPi * u), 0, -std::cos(2 * math::kPi * u)}; };
  for (int x = 0; x < 8; ++x) {
    EXPECT_NEAR(e->radiance(at((static_cast<float>(x) + 0.5f) / 8)).g, 2.0f * static_cast<float>(x + 1),
                1e-4f)
        << x;
  }
  EXPECT_NEAR(e->radiance({1, 0, 0}).g, 2 * 2.5f, 1e-4f);   // u = 1/4
  EXPECT_NEAR(e->radiance({0, 0, -1}).g, 2 * 4.5f, 1e-4f);  // the seam: between texels 8 and 1
  EXPECT_NEAR(e->radiance({0, 0, 1}).g, 2 * 4.5f, 1e-4f);   // the middle: between 4 and 5
  // to_world turning +y to +z, and one that mirrors x.
  const auto turned = Environment::build(
      *envmap({matrix("to_world", {1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1})}), store);
  ASSERT_TRUE(turned.ok());
  EXPECT_NEAR(turned->radiance({0, 0, 1}).r, 5, 1e-5f);
  const auto mirrored = Environment::build(
      *envmap({matrix("to_world", {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1})}), store);
  ASSERT_TRUE(mirrored.ok());
  EXPECT_NEAR(mirrored->radiance({-1, 0, 0}).g, 2.5f, 1e-4f);
  const auto sheared = Environment::build(
      *envmap({matrix("to_world", {1, 1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1})}), store);
  ASSERT_FALSE(sheared.ok());
  EXPECT_NE(sheared.error().to_string().find("to_world"), std::string::npos);
}

// Claim: sample() has the density pdf_solid_angle() states (chi-squared over 16 x 24 patches of the sphere,
// false alarm 1 % over both tests), which is above zero wherever there is light and integrates to 1; sampled
// radiance is radiance(d); the mean is right.
TEST(Environment, SamplingMatchesDensity) {
  MemoryFiles files;
  files.files["sky.pfm"] = pfm(6, 5, sky());
  TextureStore store(files);
  const auto turned = Environment::build(
      *envmap({matrix("to_world", {0, 0, 3, 0, 3, 0, 0, 0, 0, 3, 0, 0, 0, 0, 0, 1})}), store);
  ASSERT_TRUE(turned.ok()) << turned.error().to_string();
  for (const Environment& e : {*turned, Environment::constant({1, 2, 3})}) {
    constexpr int kRows = 16;
    constexpr int kColumns = 24;
    constexpr int kFine = 60;  // a cell's edges cross patches: the midpoint rule errs by 1 / 60 of the patch
    constexpr int kSamples = 20000;
    std::vector<double> expected(kRows * kColumns);
    double total = 0;
    double mean = 0;
    for (int r = 0; r < kRows * kFine; ++r) {
      for (int c = 0; c < kColumns * kFine; ++c) {
        const double z = 1 - 2 * (r + 0.5) / (kRows * kFine);
        const double phi = (2 * (c + 0.5) / (kColumns * kFine) - 1) * std::numbers::pi;
        const double s = std::sqrt(1 - z * z);
        const Vec3 d = {static_cast<float>(s * std::cos(phi)), static_cast<float>(s * std::sin(phi)),
                        static_cast<float>(z)};
        const double pdf = static_cast<double>(e.pdf_solid_angle(d));
        const double weight = 4 * std::numbers::pi / (kRows * kFine * kColumns * kFine);
        expected[static_cast<std::size_t>(r / kFine * kColumns + c / kFine)] += pdf * weight * kSamples;
        total += pdf * weight;
        mean += static_cast<double>(e.radiance(d).g) * weight / (4 * std::numbers::pi);
        if (!e.radiance(d).is_black()) {
          ASSERT_GT(pdf, 0);
        }
      }
    }
    EXPECT_NEAR(total, 1, 0.005);
    std::vector<double> observed(expected.size());
    rng::Stream stream(rng::key(22));
    double estimate = 0;
    double squares = 0;
    for (int i = 0; i < kSamples; ++i) {
      const float ux = stream.next_float();
      const float uy = stream.next_float();
      Vec3 d;
      float pdf = 0;
      ASSERT_TRUE(e.sample({ux, uy}, d, pdf));
      ASSERT_NEAR(length(d), 1, 1e-5f);
      const double x = static_cast<double>(e.radiance(d).g) / static_cast<double>(pdf);
      estimate += x / kSamples;
      squares += x * x / kSamples;
      const int r = std::clamp(static_cast<int>((1 - d.z) / 2 * kRows), 0, kRows - 1);
      const int c = std::clamp(static_cast<int>((std::atan2(d.y, d.x) / math::kPi + 1) / 2 * kColumns), 0,
                               kColumns - 1);
      ++observed[static_cast<std::size_t>(r * kColumns + c)];
    }
    EXPECT_GT(test::chi_squared_p(observed, expected), 0.005);
    // The estimate of the integral within 4 of its standard errors of the quadrature's.
    const double error = std::sqrt(std::max(0.0, squares - estimate * estimate) / kSamples);
    EXPECT_NEAR(estimate, mean * 4 * std::numbers::pi, 4 * error + 0.01 * mean);
    EXPECT_GT(static_cast<double>(e.mean_radiance().g), 0.5 * mean);
    EXPECT_LT(static_cast<double>(e.mean_radiance().g), 2 * mean);
  }
}

// Claim: what sample() says of its density, pdf_solid_angle() says of the direction, save for directions on a
// cell's border.
TEST(Environment, SampleAndDensityAgree) {
  MemoryFiles files;
  std::vector<Spectrum> texels;
  rng::Stream stream(rng::key(23));
  for (int i = 0; i < 512 * 256; ++i)
    texels.push_back(Spectrum(std::pow(10.0f, 6 * stream.next_float() - 3)));
  files.files["sky.pfm"] = pfm(512, 256, texels);
  TextureStore store(files);
  const auto e = Environment::build(*envmap(), store);
  ASSERT_TRUE(e.ok());
  int differ = 0;
  for (int i = 0; i < 20000; ++i) {
    const float ux = stream.next_float();
    const float uy = stream.next_float();
    Vec3 d;
    float pdf = 0;
    ASSERT_TRUE(e->sample({ux, uy}, d, pdf));
    if (std::abs(e->pdf_solid_angle(d) / pdf - 1) > 1e-4f) ++differ;
  }
  EXPECT_LE(differ, 40);  // float directions resolve 2^-24 of the circle, a cell is 2^-9
}

TEST(Environment, BlackAndTinyMaps) {
  MemoryFiles files;
  files.files["sky.pfm"] = pfm(4, 3, std::vector<Spectrum>(12, Spectrum(0)));
  files.files["small.pfm"] = pfm(1, 1, {Spectrum(1)});
  TextureStore store(files);
  const auto black = Environment::build(*envmap(), store);
  ASSERT_TRUE(black.ok());
  Vec3 d;
  float pdf = 1;
  EXPECT_TRUE(black->black());
  EXPECT_FALSE(black->sample({0.5f, 0.5f}, d, pdf));
  EXPECT_EQ(black->pdf_solid_angle({0, 0, 1}), 0);
  EXPECT_TRUE(black->radiance({0, 0, 1}).is_black());
  EXPECT_FALSE(Environment::build(*object("emitter", "envmap", {text("filename", "small.pfm")}), store).ok());
  EXPECT_FALSE(Environment::build(*envmap({number("scale", -1)}), store).ok());
}

}  // namespace
}  // namespace candela::scene
