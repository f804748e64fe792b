// Tests of the denoiser: against a library that says what it was asked (fake_oidn.cpp), and against the real
// one where it is installed.
#include "common/image/denoise.h"

#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <random>

#include "common/image/image.h"
#include "tests/temporary_folder.h"
#include "tests/unit/fake_oidn.h"

namespace candela::image {
namespace {

// The fake library's own function, loaded.
template <class Function>
Function of_fake(const std::string& library, const char* name) {
  void* const loaded = dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL);
  EXPECT_NE(loaded, nullptr) << dlerror();
  return loaded == nullptr ? nullptr : reinterpret_cast<Function>(dlsym(loaded, name));
}

class Denoise : public testing::TestWithParam<int> {
 protected:
  std::shared_ptr<const Denoiser> fake() const {
    const char* const libraries[] = {"libAbsentDenoise.so.7", library_.c_str()};
    const auto loaded = Denoiser::load(libraries);
    EXPECT_TRUE(loaded.ok()) << loaded.error().to_string();
    return loaded.ok() ? *loaded : nullptr;
  }
  std::string exr(const std::map<std::string, std::string>& texts, std::span<const Layer> layers) const {
    const auto bytes = encode_exr(2, 1, color_, texts, layers);
    EXPECT_TRUE(bytes.ok()) << bytes.error().to_string();
    return bytes.ok() ? *bytes : "";
  }
  std::string put(const std::string& bytes) const {
    const std::string path = (folder_.path() / "a.exr").string();
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  }

  const std::string library_ = test::fake_oidn(GetParam());
  const std::vector<float> color_ = {1, 2, 3, 4, 5, 6};
  const std::vector<float> albedo_ = {0.5F, 0.25F, 0, 0.5F, 0.75F, 1};
  const std::vector<float> normal_ = {0, 0, 1, 0, -1, 0};
  const std::vector<float> error_ = {7, 7, 7, 8, 8, 8};
  test::TemporaryFolder folder_;
};

INSTANTIATE_TEST_SUITE_P(Versions, Denoise, testing::Values(1, 2));

// Claim: the color is filtered by guides that were filtered themselves, in the order that the library wants;
// without an albedo the normal is no guide; what is not finite counts as black; all is released.
TEST_P(Denoise, FiltersByFilteredGuides) {
  const auto denoiser = fake();
  ASSERT_NE(denoiser, nullptr);
  EXPECT_EQ(*denoiser->denoise({2, 1, color_, albedo_, normal_}),
            (std::vector<float>{11, 7, 203, 14, -180, 26}));
  EXPECT_EQ(*denoiser->denoise({2, 1, color_, albedo_, {}}), (std::vector<float>{11, 7, 3, 14, 20, 26}));
  EXPECT_EQ(*denoiser->denoise({2, 1, color_, {}, normal_}), color_);
  std::vector<float> hostile = color_;
  hostile[1] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(*denoiser->denoise({2, 1, hostile, {}, {}}), (std::vector<float>{0, 0, 0, 4, 5, 6}));
  EXPECT_EQ(of_fake<int (*)()>(library_, "fake_oidn_alive")(), 0);
}

// Claim: what the library says of a failure is the error, on one line, and nothing stays allocated.
TEST_P(Denoise, SaysWhyItFailed) {
  const auto denoiser = fake();
  const auto breaking = of_fake<void (*)(bool)>(library_, "fake_oidn_break");
  breaking(true);
  const auto out = denoiser->denoise({2, 1, color_, albedo_, {}});
  breaking(false);
  ASSERT_FALSE(out.ok());
  EXPECT_EQ(out.error().to_string(), "Open Image Denoise: out of memory");
  EXPECT_EQ(of_fake<int (*)()>(library_, "fake_oidn_alive")(), 0);
  EXPECT_FALSE(denoiser->denoise({3, 1, color_, {}, {}}).ok());
}

// Claim: the EXR has the result in the layer 'denoised' alone: image, other layers and attributes keep their
// bits. AOVs are found by kind, whatever their layers' names. Doing it again replaces the layer.
TEST_P(Denoise, AddsALayerToTheExr) {
  const std::map<std::string, std::string> texts = {{"candela:build_id", "b"},
                                                    {"candela:aovs", "depth,paint:albedo,n:sh_normal"}};
  const Layer layers[] = {{"paint", albedo_, {}, "RGB"}, {"n", normal_, {}, "XYZ"}, {"error", error_, {}}};
  const std::vector<float> wanted = {11, 7, 203, 14, -180, 26};
  std::string bytes = exr(texts, layers);
  for (int times = 0; times < 2; ++times) {
    const auto out = denoise_exr(bytes, *fake());
    ASSERT_TRUE(out.ok()) << out.error().to_string();
    EXPECT_EQ(out->guides, "albedo, normal");
    EXPECT_EQ(out->rgb, wanted);
    bytes = out->bytes;
  }
  const std::string path = put(bytes);
  EXPECT_EQ(read_layer(path, "denoised")->rgb, wanted);
  EXPECT_EQ(read_layer(path, "paint")->rgb, albedo_);
  EXPECT_EQ(read_layer(path, "n")->rgb, normal_);
  EXPECT_EQ(read_layer(path, "error")->rgb, error_);
  const auto image = read_image(path);
  EXPECT_EQ(image->rgb, color_);
  EXPECT_EQ(image->metadata.at("candela:aovs"), texts.at("candela:aovs"));
  EXPECT_EQ(image->metadata.at("candela:denoiser"), "Open Image Denoise by albedo, normal");
}

// Claim: an EXR of another program has guides by name. One of Candela without such AOVs has none, though a
// layer of another meaning has the name.
TEST_P(Denoise, KnowsGuidesByKindOrName) {
  const Layer layers[] = {{"albedo", albedo_, {}, "RGB"}};
  EXPECT_EQ(denoise_exr(exr({}, layers), *fake())->guides, "albedo");
  EXPECT_EQ(denoise_exr(exr({{"candela:build_id", "b"}}, layers), *fake())->guides, "");
}

// Claim: a user's own layer 'denoised' is not lost: the EXR is refused. So is what is no EXR.
TEST_P(Denoise, RefusesWhatItWouldLose) {
  const Layer layers[] = {{"denoised", error_, {}, "RGB"}};
  const auto own = denoise_exr(exr({}, layers), *fake());
  ASSERT_FALSE(own.ok());
  EXPECT_THAT(own.error().to_string(), testing::HasSubstr("a layer 'denoised' of its own"));
  EXPECT_FALSE(denoise_exr("no EXR", *fake()).ok());
}

// Claim: with halves each is denoised by itself, and the layer is their mean by iterations; the image keeps
// its bits. Halves of other samples, and one half alone, count as absent.
TEST_P(Denoise, PoolsDenoisedHalves) {
  const std::map<std::string, std::string> samples = {{"candela:build_id", "b"},
                                                      {"candela:aovs", "albedo"},
                                                      {"candela:indices_a", "0-2"},
                                                      {"candela:indices_b", "0"}};
  const auto half = [&](const std::vector<float>& rgb, const char* iterations) {
    auto texts = samples;
    texts["candela:iterations"] = iterations;
    return *encode_exr(2, 1, rgb, texts);
  };
  const std::vector<float> a = {1, 2, 3, 8, 8, 8}, b = {5, 2, 3, 0, 4, 8};
  const Layer layers[] = {{"albedo", albedo_, {}, "RGB"}};
  const std::string whole = exr(samples, layers);
  const HalfExrs halves{half(a, "3"), half(b, "1")};
  ASSERT_TRUE(*halves_are_of(whole, halves));
  const auto out = denoise_exr(whole, *fake(), halves);
  ASSERT_TRUE(out.ok()) << out.error().to_string();
  std::vector<float> wanted;
  for (std::size_t i = 0; i < a.size(); ++i) wanted.push_back(0.75F * a[i] + 0.25F * b[i] + 20 * albedo_[i]);
  EXPECT_EQ(out->rgb, wanted);
  const std::string path = put(out->bytes);
  EXPECT_EQ(read_layer(path, "denoised")->rgb, wanted);
  EXPECT_EQ(read_image(path)->rgb, color_);
  EXPECT_EQ(read_image(path)->metadata.at("candela:denoiser"), "Open Image Denoise by albedo, halves");

  auto later = samples;
  later["candela:indices_a"] = "0-3";
  const std::string further = exr(later, layers);
  EXPECT_FALSE(*halves_are_of(further, halves));
  for (const auto& [image, some] : {std::pair(further, halves), std::pair(whole, HalfExrs{halves.a, {}})}) {
    const auto alone = denoise_exr(image, *fake(), some);
    ASSERT_TRUE(alone.ok());
    EXPECT_EQ(alone->rgb[0], color_[0] + 20 * albedo_[0]);
    EXPECT_FALSE(read_image(put(alone->bytes))->metadata.contains("candela:denoised_relmse"));
  }
}

// Blurs by the mean of the pixels within `radius`, and adds `offset`.
class Blur final : public Denoiser {
 public:
  Blur(int radius, float offset) : radius_(radius), offset_(offset) {}
  Result<std::vector<float>> denoise(const DenoiseImages& images) const override {
    const int width = static_cast<int>(images.width), height = static_cast<int>(images.height);
    std::vector<float> out(images.color.size());
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        for (int c = 0; c < 3; ++c) {
          float sum = 0;
          int count = 0;
          for (int v = std::max(0, y - radius_); v <= std::min(height - 1, y + radius_); ++v)
            for (int u = std::max(0, x - radius_); u <= std::min(width - 1, x + radius_); ++u, ++count)
              sum += images.color[static_cast<std::size_t>(3 * (v * width + u) + c)];
          out[static_cast<std::size_t>(3 * (y * width + x) + c)] = sum / static_cast<float>(count) + offset_;
        }
    return out;
  }

 private:
  int radius_;
  float offset_;
};

// Claim: the error that is estimated from the halves is that of the denoised layer, its bias included: of a
// denoiser that does nothing, of a blur over edges, and of one that brightens; also with halves of 3 : 1. The
// ratio has a standard deviation of at most 3.3 % here, and a mean of 0.97 to 1.
TEST(DenoisedError, IsThatOfTheLayer) {
  constexpr std::uint32_t size = 64;
  std::mt19937 random(11);
  std::vector<float> truth(size * size * 3);
  for (std::size_t i = 0; i < truth.size(); ++i) truth[i] = (i / 3 / 8) % 2 == 0 ? 1.0F : 0.6F;
  for (const double share : {0.5, 0.75}) {
    std::vector<float> half[2] = {truth, truth}, whole(truth.size());
    for (std::size_t h = 0; h < 2; ++h) {
      std::normal_distribution<float> noise(
          0, 0.05F / std::sqrt(static_cast<float>(h == 0 ? share : 1 - share)));
      for (float& value : half[h]) value += noise(random);
    }
    for (std::size_t i = 0; i < whole.size(); ++i)
      whole[i] = static_cast<float>(share) * half[0][i] + static_cast<float>(1 - share) * half[1][i];
    const auto bytes = [&](const std::vector<float>& rgb, double iterations) {
      return *encode_exr(size, size, rgb, {{"candela:iterations", std::to_string(std::lround(iterations))}});
    };
    const HalfExrs halves{bytes(half[0], 100 * share), bytes(half[1], 100 * (1 - share))};
    for (const auto& [radius, offset] : {std::pair(0, 0.0F), std::pair(1, 0.0F), std::pair(2, 0.05F)}) {
      const auto out = denoise_exr(bytes(whole, 100), Blur(radius, offset), halves);
      ASSERT_TRUE(out.ok()) << out.error().to_string();
      double error = 0, mean = 0;
      for (const float value : out->rgb)
        mean += static_cast<double>(value) / static_cast<double>(truth.size());
      for (std::size_t i = 0; i < truth.size(); ++i) {
        const double apart = static_cast<double>(out->rgb[i]) - static_cast<double>(truth[i]);
        const double value = static_cast<double>(out->rgb[i]);
        error += apart * apart / (value * value + 0.01 * mean * mean) / static_cast<double>(truth.size());
      }
      EXPECT_NEAR(out->relmse / error, 1, 0.15) << share << " " << radius << " " << offset;
    }
  }
}

// Claim: where there is no library the error says so and what to do; so it does of another library by the
// name.
TEST(DenoiseLibrary, IsMissing) {
  const char* const absent[] = {"libAbsentDenoise.so.7"};
  const auto none = Denoiser::load(absent);
  ASSERT_FALSE(none.ok());
  EXPECT_THAT(none.error().to_string(),
              testing::AllOf(testing::HasSubstr("Open Image Denoise is not installed"),
                             testing::HasSubstr("LD_LIBRARY_PATH")));
  const char* const other[] = {"libm.so.6"};
  const auto wrong = Denoiser::load(other);
  ASSERT_FALSE(wrong.ok());
  EXPECT_THAT(wrong.error().to_string(), testing::HasSubstr("libm.so.6 is no Open Image Denoise"));
}

// Claim: the real library takes most of the noise of an even image, with and without guides, and keeps its
// mean.
TEST(DenoiseLibrary, RealOneDenoises) {
  const auto real = Denoiser::load();
  if (!real.ok()) GTEST_SKIP() << "Open Image Denoise is not installed (Debian 12 has no package of it)";
  constexpr std::uint32_t size = 64;
  std::mt19937 random(7);
  std::normal_distribution<float> noise(1, 0.3F);
  std::vector<float> color(size * size * 3), albedo(color.size(), 0.5F), normal(color.size(), 0);
  for (float& value : color) value = noise(random);
  for (std::size_t i = 2; i < normal.size(); i += 3) normal[i] = 1;
  for (const bool guided : {false, true}) {
    const auto out = guided ? (*real)->denoise({size, size, color, albedo, normal})
                            : (*real)->denoise({size, size, color, {}, {}});
    ASSERT_TRUE(out.ok()) << out.error().to_string();
    double sum = 0, squares = 0;
    for (const float value : *out) {
      sum += value;
      squares += double{value} * value;
    }
    const double mean = sum / static_cast<double>(out->size());
    EXPECT_NEAR(mean, 1, 0.05);
    EXPECT_LT(squares / static_cast<double>(out->size()) - mean * mean, 0.1 * 0.3 * 0.3);
  }
}

}  // namespace
}  // namespace candela::image
