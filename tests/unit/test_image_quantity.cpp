// Tests of reading one number a pixel from files, also from damaged ones.
#include "common/image/quantity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "common/image/image.h"
#include "common/rng/stream.h"
#include "tests/temporary_folder.h"

namespace candela::image {
namespace {

constexpr std::uint32_t kWidth = 5, kHeight = 4;

std::vector<float> noise(std::size_t channels, std::uint64_t seed) {
  rng::Stream stream(seed);
  std::vector<float> values(kWidth * kHeight * channels);
  for (float& value : values) value = stream.next_float() + 0.01F;
  return values;
}

class QuantityTest : public testing::Test {
 protected:
  std::string put(const std::string& name, const std::string& bytes) const {
    const auto path = folder_.path() / name;
    std::ofstream(path, std::ios::binary) << bytes;
    return path.string();
  }
  std::string exr(const std::string& name, const std::vector<Layer>& layers) const {
    const auto bytes = encode_exr(kWidth, kHeight, rgb_, {}, layers);
    EXPECT_TRUE(bytes.ok());
    return put(name, *bytes);
  }
  static std::string error_of(const std::string& path, const std::string& layer, const std::string& channel) {
    const auto read = read_quantity(path, layer, channel);
    return read.ok() ? "no error" : read.error().to_string();
  }

  test::TemporaryFolder folder_;
  std::vector<float> rgb_ = noise(3, 1);
};

void expect_values(const Result<Quantity>& read, const std::string& name, std::size_t channels,
                   const std::vector<float>& data, double (*number)(const float*)) {
  ASSERT_TRUE(read.ok()) << read.error().to_string();
  EXPECT_EQ(read->name, name);
  EXPECT_EQ(read->width, kWidth);
  ASSERT_EQ(read->values.size(), data.size() / channels);
  for (std::size_t i = 0; i < read->values.size(); ++i)
    EXPECT_NEAR(read->values[i], number(&data[channels * i]), 1e-6) << name << " " << i;
}

// Claim: the image and layers of one, two and three channels give luminance, length, the only channel, or the
// channel that is asked for, with a name that says so.
TEST_F(QuantityTest, ReadsEveryKindOfLayer) {
  const auto albedo = noise(3, 2), normal = noise(3, 3), uv = noise(2, 4), depth = noise(1, 5);
  const std::string path = exr("a.exr", {{"albedo", albedo, {}},
                                         {"normal", normal, {}, "XYZ"},
                                         {"uv", uv, {}, "UV"},
                                         {"depth", depth, {}, "Z"},
                                         {"coverage", depth, {}, "Y"},
                                         {"shape_index", depth, {}, "I"}});
  const auto luminance = [](const float* v) { return 0.2126 * v[0] + 0.7152 * v[1] + 0.0722 * v[2]; };
  const auto only = [](const float* v) { return double{v[0]}; };
  expect_values(read_quantity(path, "", ""), "luminance", 3, rgb_, luminance);
  expect_values(read_quantity(path, "", "luminance"), "luminance", 3, rgb_, luminance);
  expect_values(read_quantity(path, "", "G"), "radiance, G", 3, rgb_,
                [](const float* v) { return double{v[1]}; });
  expect_values(read_quantity(path, "albedo", ""), "albedo, luminance", 3, albedo, luminance);
  expect_values(read_quantity(path, "albedo", "B"), "albedo, B", 3, albedo,
                [](const float* v) { return double{v[2]}; });
  expect_values(read_quantity(path, "normal", "length"), "normal, length", 3, normal,
                [](const float* v) { return std::sqrt(double{v[0]} * v[0] + v[1] * v[1] + v[2] * v[2]); });
  expect_values(read_quantity(path, "normal", "Y"), "normal, Y", 3, normal,
                [](const float* v) { return double{v[1]}; });
  expect_values(read_quantity(path, "uv", ""), "uv, length", 2, uv,
                [](const float* v) { return std::hypot(double{v[0]}, double{v[1]}); });
  expect_values(read_quantity(path, "uv", "V"), "uv, V", 2, uv, [](const float* v) { return double{v[1]}; });
  for (const char* layer : {"depth", "coverage", "shape_index"})
    expect_values(read_quantity(path, layer, ""), layer, 1, depth, only);
  expect_values(read_quantity(path, "depth", "Z"), "depth", 1, depth, only);
}

// Claim: a file with one of 'error' and 'variance' has both, the one the square of the other, also in
// luminance; a file with both gives each as it is.
TEST_F(QuantityTest, ErrorAndVarianceStandForEachOther) {
  const auto error = noise(3, 6);
  std::vector<float> variance = error;
  for (float& value : variance) value *= value;
  const std::string with_error = exr("e.exr", {{"error", error, {}}});
  const std::string with_variance = exr("v.exr", {{"variance", variance, {}}});
  const std::string with_both = exr("b.exr", {{"error", noise(3, 7), {}}, {"variance", variance, {}}});
  for (const char* channel : {"", "R", "B"}) {
    const auto reference = read_quantity(with_error, "error", channel);
    ASSERT_TRUE(reference.ok());
    const auto root = read_quantity(with_variance, "error", channel);
    const auto square = read_quantity(with_error, "variance", channel);
    const auto stored = read_quantity(with_variance, "variance", channel);
    const auto both = read_quantity(with_both, "variance", channel);
    ASSERT_TRUE(root.ok() && square.ok() && stored.ok() && both.ok());
    for (std::size_t i = 0; i < reference->values.size(); ++i) {
      const double deviation = reference->values[i];
      EXPECT_NEAR(root->values[i], deviation, 1e-6);
      EXPECT_NEAR(square->values[i], deviation * deviation, 1e-6);
      EXPECT_NEAR(stored->values[i], deviation * deviation, 1e-6);
      EXPECT_EQ(both->values[i], stored->values[i]);
    }
    EXPECT_EQ(root->name, reference->name);
  }
}

// Claim: the irradiance of a matt surface, which reflects albedo / pi of it, is pi times the image over the
// layer 'albedo'; pixels without albedo have none; a file without that layer says how to get it; a layer of
// that name is read as it is.
TEST_F(QuantityTest, IrradianceIsThatOfMattSurfaces) {
  auto albedo = noise(3, 9);
  const auto irradiance = noise(3, 10);
  for (std::size_t i = 0; i < rgb_.size(); ++i)
    rgb_[i] = static_cast<float>(double{albedo[i]} * irradiance[i] / 3.14159265358979);
  const std::string path = exr("a.exr", {{"albedo", albedo, {}}});
  const auto luminance = [](const float* v) { return 0.2126 * v[0] + 0.7152 * v[1] + 0.0722 * v[2]; };
  expect_values(read_quantity(path, "irradiance", ""), "irradiance, luminance", 3, irradiance, luminance);
  expect_values(read_quantity(path, "irradiance", "G"), "irradiance, G", 3, irradiance,
                [](const float* v) { return double{v[1]}; });
  for (std::size_t c = 0; c < 3; ++c) albedo[c] = 0;
  EXPECT_FALSE(
      std::isfinite(read_quantity(exr("dark.exr", {{"albedo", albedo, {}}}), "irradiance", "")->values[0]));
  EXPECT_THAT(error_of(exr("plain.exr", {}), "irradiance", ""),
              testing::HasSubstr("(render with --aov albedo)"));
  const std::string own = exr("own.exr", {{"albedo", albedo, {}}, {"irradiance", irradiance, {}}});
  expect_values(read_quantity(own, "irradiance", ""), "irradiance, luminance", 3, irradiance, luminance);
}

// Claim: a layer that is not there names the nearest of those there are; a channel that is not there names
// all; other files than EXR are refused by what they hold, not by their names.
TEST_F(QuantityTest, ErrorsNameTheMend) {
  const auto data = noise(3, 8);
  std::vector<Layer> layers;
  for (int i = 0; i < 20; ++i) layers.push_back({"technique.s" + std::to_string(i), data, {}});
  layers.push_back({"albedo", data, {}});
  const std::string path = exr("a.exr", layers);
  EXPECT_THAT(
      error_of(path, "albdo", ""),
      testing::StartsWith(path + ": the image has no layer 'albdo' (of 21 layers the nearest are albedo, "));
  EXPECT_THAT(error_of(path, "error", ""), testing::HasSubstr("has no layer 'error'"));
  EXPECT_THAT(error_of(path, "technique.s33", ""),
              testing::HasSubstr("nearest are technique.s13, technique.s3, "));
  EXPECT_EQ(error_of(exr("plain.exr", {}), "x", ""),
            (folder_.path() / "plain.exr").string() + ": the image has no layer 'x' (it has none at all)");
  EXPECT_EQ(error_of(path, "albedo", "X"),
            "--channel: there is no 'X' of the layer 'albedo' (there is R, G, B, luminance)");
  EXPECT_EQ(error_of(path, "", "length"),
            "--channel: there is no 'length' of the image (there is R, G, B, luminance)");
  const auto png = encode_png(Image{kWidth, kHeight, rgb_, {}});
  EXPECT_THAT(
      error_of(put("named.exr", *png), "", ""),
      testing::HasSubstr("named.exr: this is a file of the format 'png', whose values are no radiance"));
  EXPECT_THAT(error_of(put("empty.exr", ""), "", ""), testing::HasSubstr("this is no EXR file"));
  EXPECT_THAT(error_of(put("text.exr", "no image at all, but long enough"), "", ""),
              testing::HasSubstr("this is no EXR file"));
  EXPECT_THAT(error_of(folder_.path().string(), "", ""), testing::HasSubstr("this is not a file"));
  EXPECT_THAT(error_of("/nonexistent/a.exr", "", ""), testing::HasSubstr("there is no such image file"));
}

// Claim: files cut anywhere or with any byte changed are read, or refused by an error with the file's name;
// nothing crashes.
TEST_F(QuantityTest, DamagedFilesAreRefused) {
  const auto data = noise(3, 9);
  const auto bytes = encode_exr(kWidth, kHeight, rgb_, {}, std::vector<Layer>{{"albedo", data, {}}});
  ASSERT_TRUE(bytes.ok());
  const auto check = [&](const std::string& damaged, bool must_fail) {
    const std::string path = put("damaged.exr", damaged);
    for (const char* layer : {"", "albedo"}) {
      const auto read = read_quantity(path, layer, "");
      if (read.ok()) {
        EXPECT_FALSE(must_fail);
        EXPECT_EQ(read->values.size(), std::size_t{read->width} * read->height);
      } else {
        EXPECT_EQ(read.error().file, path) << read.error().to_string();
      }
    }
  };
  for (std::size_t size = 0; size < bytes->size(); size += 41) check(bytes->substr(0, size), true);
  rng::Stream stream(10);
  for (int i = 0; i < 150; ++i) {
    std::string damaged = *bytes;
    damaged[stream.next_u32() % damaged.size()] = static_cast<char>(stream.next_u32());
    check(damaged, false);
  }
}

}  // namespace
}  // namespace candela::image
