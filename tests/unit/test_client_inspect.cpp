// Tests of `candela inspect falsecolor`: its picture, its figures, its errors.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "client/embedded/app.h"
#include "common/base/files.h"
#include "common/image/false_color.h"
#include "common/image/image.h"
#include "tests/unit/client_outcome.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kWidth = 256, kHeight = 4;

class Inspect : public CommandTest {
 protected:
  std::string in_folder(const std::string& name) const { return (folder_.path() / name).string(); }

  // Gray pixels of column + `offset`, with a layer 'depth' that is 1000 times as large.
  std::string write(const std::string& name, float offset) const {
    std::vector<float> rgb(kWidth * kHeight * 3), depth(kWidth * kHeight);
    for (std::size_t i = 0; i < depth.size(); ++i) {
      const float value = static_cast<float>(i % kWidth) + offset;
      rgb[3 * i] = rgb[3 * i + 1] = rgb[3 * i + 2] = value;
      depth[i] = 1000 * value;
    }
    rgb[0] = std::numeric_limits<float>::quiet_NaN();
    const auto bytes =
        image::encode_exr(kWidth, kHeight, rgb, {}, std::vector<image::Layer>{{"depth", depth, {}, "Z"}});
    EXPECT_TRUE(bytes.ok() && write_file_atomically(in_folder(name), *bytes).ok());
    return in_folder(name);
  }
  static Outcome run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"inspect", "falsecolor"});
    return run_candela(arguments);
  }
  // The color in a PNG; the picture is centered above its scale.
  static image::Color8 pixel(const std::string& file, std::uint32_t x, std::uint32_t y) {
    const auto picture = image::read_image(file);
    EXPECT_TRUE(picture.ok());
    if (!picture.ok()) return {};
    image::Color8 color;
    const std::size_t at = 3 * (std::size_t{y} * picture->width + x + (picture->width - kWidth) / 2);
    for (std::size_t c = 0; c < 3; ++c)
      color[c] = static_cast<std::uint8_t>(std::lround(255 * image::linear_to_srgb(picture->rgb[at + c])));
    return color;
  }

  const std::string png_ = in_folder("out.png");
};

// Claim: pixels of known values have the colors of the map at their places in the range, linear and
// logarithmic; the JSON says range, figures and counts of these pixels.
TEST_F(Inspect, ShowsKnownValues) {
  const std::string exr = write("a.exr", 0);
  const Outcome linear = run({exr, "-o", png_, "--range", "0,200", "--map", "turbo", "--json"});
  ASSERT_EQ(linear.code, 0) << linear.err;
  for (const std::uint32_t x : {1U, 50U, 199U, 240U})
    EXPECT_EQ(pixel(png_, x, 2), image::color_at(image::ColorMap::turbo, x / 200.0)) << x;
  EXPECT_EQ(pixel(png_, 0, 0), image::kNotFiniteColor);
  const auto json = nlohmann::json::parse(linear.out);
  EXPECT_EQ(json.at("quantity"), "luminance");
  EXPECT_EQ(json.at("range"), (std::vector<double>{0, 200}));
  EXPECT_EQ(json.at("pixels"), 1024);
  EXPECT_EQ(json.at("not_finite"), 1);
  EXPECT_EQ(json.at("below"), 0);
  EXPECT_EQ(json.at("above"), 55 * 4);
  EXPECT_TRUE(json.at("zero_or_less").is_null());
  EXPECT_EQ(json.at("minimum"), 0);
  EXPECT_NEAR(json.at("maximum").get<double>(), 255, 1e-4);
  EXPECT_NEAR(json.at("mean").get<double>(), 255 * 256 * 4 / 2.0 / 1023, 1e-4);

  const Outcome log = run({exr, "-o", png_, "--log", "--range", "0.1,1000", "--json"});
  ASSERT_EQ(log.code, 0) << log.err;
  EXPECT_EQ(pixel(png_, 30, 1), image::color_at(image::ColorMap::viridis, std::log10(300.0) / 4));
  EXPECT_EQ(pixel(png_, 100, 1), image::color_at(image::ColorMap::viridis, 0.75));
  EXPECT_EQ(pixel(png_, 0, 1), image::not_positive_color(image::ColorMap::viridis));
  EXPECT_EQ(nlohmann::json::parse(log.out).at("zero_or_less"), 3);
}

// Claim: the printed line names the quantity and counts what the picture cannot show; without --range the
// range is that of percentiles.
TEST_F(Inspect, PrintsOneLine) {
  const std::string exr = write("a.exr", 0);
  const Outcome r = run({exr, "-o", png_, "--layer", "depth", "--percentiles", "25,75"});
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(
      r.out,
      "depth: range 6.375e+04 to 1.912e+05; minimum 0, maximum 2.55e+05, mean 1.275e+05; of 1024 pixels "
      "256 below and 256 above the range, 0 not finite\n");
  const Outcome log = run({exr, "-o", png_, "--log"});
  EXPECT_NE(log.out.find(", logarithmic; "), std::string::npos) << log.out;
  EXPECT_NE(log.out.find(", 1 not finite, 3 zero or less\n"), std::string::npos) << log.out;
}

// Claim: --signed is symmetric about 0 and gray-white there; --minus subtracts the same quantity of another
// file.
TEST_F(Inspect, ShowsDifferences) {
  const std::string a = write("a.exr", 3), b = write("b.exr", 0);
  const Outcome more = run({a, "--minus", b, "-o", png_, "--signed", "--range", "-4,4", "--json"});
  ASSERT_EQ(more.code, 0) << more.err;
  EXPECT_EQ(pixel(png_, 9, 1), image::color_at(image::ColorMap::cool_warm, 7.0 / 8));
  const auto json = nlohmann::json::parse(more.out);
  EXPECT_EQ(json.at("quantity"), "luminance, difference");
  EXPECT_EQ(json.at("map"), "signed");
  EXPECT_NEAR(json.at("mean").get<double>(), 3, 1e-4);
  const Outcome equal = run({a, "--minus", a, "-o", png_, "--signed", "--layer", "depth"});
  ASSERT_EQ(equal.code, 0) << equal.err;
  EXPECT_EQ(pixel(png_, 9, 1), (image::Color8{0xdd, 0xdd, 0xdd}));
  const Outcome automatic = run({b, "--minus", a, "-o", png_, "--signed", "--json"});
  const auto range = nlohmann::json::parse(automatic.out).at("range");
  EXPECT_NEAR(range[0].get<double>(), -3, 1e-4);
  EXPECT_EQ(range[0].get<double>(), -range[1].get<double>());
}

// Claim: what cannot be shown is one error with the option or the file, exit code 2, and no PNG.
TEST_F(Inspect, RefusesWhatCannotBeShown) {
  const std::string exr = write("a.exr", 0), zeros = in_folder("zero.exr"), small = in_folder("small.exr");
  ASSERT_TRUE(write_file_atomically(zeros, *image::encode_exr(2, 2, std::vector<float>(12, 0.0F), {})).ok());
  ASSERT_TRUE(write_file_atomically(small, *image::encode_exr(2, 1, std::vector<float>(6, 1.0F), {})).ok());
  const std::string picture = in_folder("a.png");
  ASSERT_TRUE(write_file_atomically(picture, *image::encode_png(image::Image{1, 1, {1, 1, 1}, {}})).ok());
  const struct {
    std::vector<std::string> arguments;
    std::string part;
  } cases[] = {
      {{exr, "--range", "2,2"}, "--range: the range '2,2' is empty (give the lower number first"},
      {{exr, "--range", "3,1"}, "--range: the range '3,1' is empty"},
      {{exr, "--range", "3"}, "--range: '3' is not LOW,HIGH"},
      {{exr, "--range", "1,nan"}, "--range: 'nan' is not a number"},
      {{exr, "--range", "1,2,3"}, "--range: '2,3' is not a number"},
      {{exr, "--range", "0,1", "--log"}, "--range: a logarithmic range begins above 0"},
      {{exr, "--range", "-1,2", "--signed"},
       "--range: the range of --signed is not symmetric about 0 (such as --range -2,2)"},
      {{exr, "--range", "0,1", "--percentiles", "1,99"}, "--range and --percentiles exclude each other"},
      {{exr, "--percentiles", "50,50"}, "--percentiles: the range '50,50' is empty"},
      {{exr, "--percentiles", "0,101"}, "--percentiles: '101' is not a number from 0 to 100"},
      {{exr, "--map", "turbot"}, "--map: unknown value 'turbot' (did you mean 'turbo'?)"},
      {{exr, "--map", "grey", "--signed"}, "--map: --signed has a map of its own"},
      {{exr, "--log", "--signed"}, "--log and --signed exclude each other"},
      {{exr, "--layer", "dept"}, "a.exr: the image has no layer 'dept' (there is depth)"},
      {{exr, "--layer", ""}, "--layer: no layer is named"},
      {{exr, "--layer", "depth", "--channel", "R"},
       "--channel: there is no 'R' of the layer 'depth' (there is Z)"},
      {{exr, "--minus", small}, "a.exr is 256x4 but "},
      {{exr, "--minus", picture}, "a.png: this is a file of the format 'png'"},
      {{picture}, "a.png: this is a file of the format 'png', whose values are no radiance (give the EXR"},
      {{zeros, "--log"}, "zero.exr: no pixel has a finite value above 0 (give --range LOW,HIGH)"},
      {{in_folder("none.exr")}, "none.exr: there is no such image file"},
  };
  for (const auto& c : cases) {
    std::vector<std::string> arguments = c.arguments;
    arguments.insert(arguments.end(), {"-o", png_});
    const Outcome r = run(arguments);
    const std::string shown = testing::PrintToString(c.arguments) + "\n" + r.err;
    EXPECT_EQ(r.code, 2) << shown;
    EXPECT_EQ(r.out, "") << shown;
    EXPECT_NE(r.err.find(c.part), std::string::npos) << shown;
    EXPECT_EQ(r.err.find('\n'), r.err.size() - 1) << shown;
    EXPECT_FALSE(fs::exists(png_)) << shown;
  }
  EXPECT_NE(run({exr, "-o", in_folder("a.exr")}).err.find("--output: "), std::string::npos);
  EXPECT_EQ(run({zeros, "--log", "--range", "1,2", "-o", png_}).code, 0);
}

}  // namespace
}  // namespace candela::client
