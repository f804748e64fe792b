// Tests of the denoiser: against a library that says what it was asked (fake_oidn.cpp), and against the real
// one where it is installed.
#include "common/image/denoise.h"

#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <random>

#include "common/image/image.h"
#include "tests/temporary_folder.h"

namespace candela::image {
namespace {

// The fake library's own function, loaded.
template <class Function>
Function of_fake(const char* library, const char* name) {
  void* const loaded = dlopen(library, RTLD_NOW | RTLD_LOCAL);
  EXPECT_NE(loaded, nullptr) << dlerror();
  return loaded == nullptr ? nullptr : reinterpret_cast<Function>(dlsym(loaded, name));
}

class Denoise : public testing::TestWithParam<const char*> {
 protected:
  std::shared_ptr<const Denoiser> fake() const {
    const char* const libraries[] = {"libAbsentDenoise.so.7", GetParam()};
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

  const std::vector<float> color_ = {1, 2, 3, 4, 5, 6};
  const std::vector<float> albedo_ = {0.5F, 0.25F, 0, 0.5F, 0.75F, 1};
  const std::vector<float> normal_ = {0, 0, 1, 0, -1, 0};
  const std::vector<float> error_ = {7, 7, 7, 8, 8, 8};
  test::TemporaryFolder folder_;
};

INSTANTIATE_TEST_SUITE_P(Versions, Denoise, testing::Values(FAKE_OIDN_1, FAKE_OIDN_2));

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
  EXPECT_EQ(of_fake<int (*)()>(GetParam(), "fake_oidn_alive")(), 0);
}

// Claim: what the library says of a failure is the error, on one line, and nothing stays allocated.
TEST_P(Denoise, SaysWhyItFailed) {
  const auto denoiser = fake();
  const auto breaking = of_fake<void (*)(bool)>(GetParam(), "fake_oidn_break");
  breaking(true);
  const auto out = denoiser->denoise({2, 1, color_, albedo_, {}});
  breaking(false);
  ASSERT_FALSE(out.ok());
  EXPECT_EQ(out.error().to_string(), "Open Image Denoise: out of memory");
  EXPECT_EQ(of_fake<int (*)()>(GetParam(), "fake_oidn_alive")(), 0);
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
