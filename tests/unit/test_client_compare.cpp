// Tests of `candela compare`: its figures with their noise, its picture, its JSON.
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "client/embedded/app.h"
#include "common/base/files.h"
#include "common/image/image.h"
#include "tests/unit/client_outcome.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;

class Compare : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  std::string in_folder(const std::string& name) const { return (folder_ / name).string(); }

  // A 32 x 16 image of one value, brighter by `step` in its right block, each value with `variance`.
  std::string write(const std::string& name, float value, float step, const std::string& layer,
                    float variance, std::optional<float> right_variance = std::nullopt) const {
    std::vector<float> rgb(32 * 16 * 3, value), noise(rgb.size(), variance);
    for (std::size_t i = 0; i < rgb.size(); ++i)
      if (i / 3 % 32 >= 16) {
        rgb[i] += step;
        noise[i] = right_variance.value_or(variance);
      }
    std::vector<image::Layer> layers;
    if (!layer.empty()) layers.push_back({layer, noise, {}});
    const auto bytes = image::encode_exr(32, 16, rgb, {}, layers);
    EXPECT_TRUE(bytes.ok() && write_file_atomically(in_folder(name), *bytes).ok());
    return in_folder(name);
  }
  static Outcome run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "compare");
    return run_candela(arguments);
  }

  const fs::path folder_ = fs::path(testing::TempDir()) / ("compare-" + std::to_string(::getpid()));
};

// Claim: by the variance of its values a comparison tells standard errors, the noise's share of relMSE, and
// the one block that differs; a layer 'error' serves as well as one of variance.
TEST_F(Compare, TellsNoiseFromDifference) {
  const std::string b = write("b.exr", 1, 0, "", 0);
  for (const auto& [layer, amount] : {std::pair("variance", 1e-2F), std::pair("error", 1e-1F)}) {
    const std::string a = write("a.exr", 1, 0.5F, layer, amount);
    const Outcome json = run({a, b, "--json"});
    ASSERT_EQ(json.code, 0) << json.err;
    const auto noise = nlohmann::json::parse(json.out).at("noise");
    EXPECT_TRUE(noise.at("variance_known").get<bool>());
    EXPECT_FALSE(noise.at("reference_variance_known").get<bool>());
    EXPECT_NEAR(noise.at("mean").at("standard_error").get<double>(), 0.1 / std::sqrt(512), 1e-6);
    EXPECT_NEAR(noise.at("expected_relmse").get<double>(), 1e-2 / 1.01, 1e-6);
    EXPECT_EQ(noise.at("blocks"), 2);
    ASSERT_EQ(noise.at("differing_blocks").size(), 1U);
    EXPECT_EQ(noise.at("differing_blocks")[0].at("x"), 16);
    EXPECT_LT(noise.at("differing_blocks")[0].at("p").get<double>(), 1e-10);
    const Outcome text = run({a, b});
    EXPECT_NE(text.out.find("1 of 2 differ"), std::string::npos) << text.out;
    EXPECT_NE(text.out.find("mean        1.25 +- "), std::string::npos) << text.out;
  }
  const Outcome without = run({b, b, "--json"});
  EXPECT_TRUE(nlohmann::json::parse(without.out).at("noise").is_null());
  EXPECT_NE(run({b, b}).out.find("--variance-layer"), std::string::npos);
}

// Claim: a layer of variance without a number, as of one iteration, is none: no block differs for want of it.
// If some of its values are none, a line tells how many count as exact.
TEST_F(Compare, VarianceThatIsNoneIsTold) {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  const std::string a = write("a.exr", 1, 0.5F, "variance", kNone), b = write("b.exr", 1, 0, "", 0),
                    c = write("c.exr", 1, 0, "variance", 1);
  EXPECT_TRUE(nlohmann::json::parse(run({a, b, "--json"}).out).at("noise").is_null());
  EXPECT_NE(run({a, b}).out.find("noise       not known"), std::string::npos);
  const auto noise = nlohmann::json::parse(run({a, c, "--json"}).out).at("noise");
  EXPECT_FALSE(noise.at("variance_known").get<bool>());
  EXPECT_TRUE(noise.at("reference_variance_known").get<bool>());
  const Outcome text = run({a, c});
  EXPECT_NE(text.out.find("a.exr tells no variance: it is taken as exact"), std::string::npos) << text.out;

  const std::string some = write("some.exr", 1, 0, "variance", 1, kNone);
  EXPECT_NE(
      run({c, some}).out.find("some.exr: 768 values of the variance are negative or no number: they are "
                              "taken as exact"),
      std::string::npos)
      << run({c, some}).out;
  EXPECT_EQ(nlohmann::json::parse(run({c, some, "--json"}).out).at("noise").at("invalid_reference_variances"),
            768);
  EXPECT_EQ(run({c, c}).out.find("no number"), std::string::npos);
}

// Claim: the picture is black where images are equal, red where the image is brighter, blue where darker.
TEST_F(Compare, ThePictureShowsWhichIsBrighter) {
  const std::string a = write("a.exr", 1, 0.5F, "", 0), b = write("b.exr", 1, 0, "", 0);
  const auto pixel = [&](const std::string& file, std::size_t x) {
    const auto picture = image::read_image(file);
    EXPECT_TRUE(picture.ok());
    return std::array<float, 3>{picture->rgb[3 * x], picture->rgb[3 * x + 1], picture->rgb[3 * x + 2]};
  };
  ASSERT_EQ(run({a, b, "--image", in_folder("d.png")}).code, 0);
  EXPECT_EQ(pixel(in_folder("d.png"), 0), (std::array<float, 3>{0, 0, 0}));
  EXPECT_GT(pixel(in_folder("d.png"), 31)[0], 0.3F);
  EXPECT_EQ(pixel(in_folder("d.png"), 31)[2], 0.0F);
  ASSERT_EQ(run({b, a, "--image", in_folder("d.png")}).code, 0);
  EXPECT_EQ(pixel(in_folder("d.png"), 31)[0], 0.0F);
  EXPECT_GT(pixel(in_folder("d.png"), 31)[2], 0.2F);
  const Outcome wrong = run({a, b, "--image", in_folder("d.jpg")});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_NE(wrong.err.find("--image"), std::string::npos) << wrong.err;
}

}  // namespace
}  // namespace candela::client
