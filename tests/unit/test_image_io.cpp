// Tests of reading and writing images.
#include "common/image/image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <limits>
#include <thread>

#include <unistd.h>

#include "common/base/files.h"
#include "common/job/job.h"
#include "common/rng/stream.h"
#include "tests/temporary_folder.h"

namespace candela::image {
namespace {

class ImageIo : public testing::Test {
 protected:
  std::filesystem::path put(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }
  test::TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path();
};

std::vector<float> noise(std::size_t count, std::uint64_t seed) {
  rng::Stream stream(seed);
  std::vector<float> values(count);
  for (float& value : values)
    value = std::ldexp(stream.next_float(), static_cast<int>(stream.next_u32() % 40) - 20);
  return values;
}

// Claim: an EXR gives back every float bit and every attribute, beside other layers.
TEST_F(ImageIo, ExrIsLossless) {
  std::vector<float> rgb = noise(37 * 21 * 3, 1);
  rgb[5] = std::numeric_limits<float>::infinity();
  rgb[6] = std::numeric_limits<float>::denorm_min();
  const std::vector<float> albedo = noise(37 * 21 * 3, 2), normal = noise(37 * 21 * 3, 3);
  const std::map<std::string, std::string> metadata{{"candela:job", "j-1"},
                                                    {"candela:plan", "line one\nline two"},
                                                    {"candela:a_very_long_attribute_name_indeed", "x"}};
  // Layers whose names sort before and after R, G and B.
  const Layer layers[] = {{"Albedo", albedo, {}}, {"normal", normal, {}}};
  const auto bytes = encode_exr(37, 21, rgb, metadata, layers);
  ASSERT_TRUE(bytes.ok()) << bytes.error().to_string();
  const auto image = read_image(put("a.exr", *bytes));
  ASSERT_TRUE(image.ok()) << image.error().to_string();
  EXPECT_EQ(image->width, 37U);
  EXPECT_EQ(image->height, 21U);
  EXPECT_EQ(image->rgb, rgb);
  for (const auto& [key, value] : metadata) {
    ASSERT_TRUE(image->metadata.count(key)) << key;
    EXPECT_EQ(image->metadata.at(key), value);
  }
  // An image that was read can be written again.
  EXPECT_TRUE(encode_exr(37, 21, image->rgb, image->metadata, layers).value() == *bytes);
}

// Claim: each of 63 layers of techniques comes back bit by bit by its name, in several bands of rows, with
// the image untouched between them; given row by row or as a whole makes no difference to the bytes; a name
// that is not there is an error that lists those that are.
TEST_F(ImageIo, LayersComeBackByName) {
  constexpr std::uint32_t kWidth = 23, kHeight = 150;
  const std::vector<float> rgb = noise(kWidth * kHeight * 3, 1);
  std::vector<std::vector<float>> pixels;
  std::vector<Layer> whole, by_row;
  for (std::uint32_t i = 0; i < 63; ++i) pixels.push_back(noise(kWidth * kHeight * 3, 100 + i));
  for (std::uint32_t i = 0; i < 63; ++i) {
    const std::string name = (i % 2 == 0 ? "weighted.s" : "unweighted.s") + std::to_string(i / 2) + ".t2";
    whole.push_back({name, pixels[i], {}});
    by_row.push_back({name, {}, [&pixels, i](std::uint32_t y, std::span<float> out) {
                        std::copy_n(&pixels[i][std::size_t{y} * kWidth * 3], out.size(), out.begin());
                      }});
  }
  const auto bytes = encode_exr(kWidth, kHeight, rgb, {{"candela:layers", "many"}}, whole);
  ASSERT_TRUE(bytes.ok()) << bytes.error().to_string();
  EXPECT_TRUE(*bytes == *encode_exr(kWidth, kHeight, rgb, {{"candela:layers", "many"}}, by_row));
  const auto path = put("layers.exr", *bytes);
  EXPECT_EQ(read_image(path)->rgb, rgb);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    const auto layer = read_layer(path, whole[i].name);
    ASSERT_TRUE(layer.ok()) << layer.error().to_string();
    EXPECT_EQ(layer->rgb, pixels[i]) << whole[i].name;
    EXPECT_EQ(layer->width, kWidth);
  }
  const auto absent = read_layer(path, "weighted.s77.t2");
  ASSERT_FALSE(absent.ok());
  EXPECT_EQ(absent.error().file, path.string());
  EXPECT_THAT(absent.error().mend, testing::HasSubstr("unweighted.s0.t2"));
  EXPECT_FALSE(read_layer(path, "").ok());
  const auto none = read_layer(put("plain.exr", *encode_exr(kWidth, kHeight, rgb, {})), "x");
  ASSERT_FALSE(none.ok());
  EXPECT_THAT(none.error().mend, testing::HasSubstr("none"));
}

// Claim: the bytes of an EXR and a PNG depend on the content alone, not on the date or on what was written
// before.
TEST_F(ImageIo, BytesAreDeterministic) {
  Image image{64, 48, noise(64 * 48 * 3, 4), {}};
  const Layer layers[] = {{"direct", image.rgb, {}}};
  const auto exr = encode_exr(64, 48, image.rgb, {{"candela:seed", "7"}}, layers);
  const auto png = encode_png(image);
  ASSERT_TRUE(exr.ok());
  ASSERT_TRUE(png.ok());
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // dates in files count seconds
  EXPECT_TRUE(*encode_exr(64, 48, image.rgb, {{"candela:seed", "7"}}, layers) == *exr);
  EXPECT_TRUE(*encode_png(image) == *png);
  for (const char* word : {"DateTime", "Software", "OpenImageIO", "tIME"}) {
    EXPECT_TRUE(exr->find(word) == std::string::npos) << word;
    EXPECT_TRUE(png->find(word) == std::string::npos) << word;
  }
}

// Claim: a PNG shows sRGB with the exposure applied, clips, and shows NaN as magenta; read again it is
// linear.
TEST_F(ImageIo, PngIsSrgb) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  const Image image{
      3, 2, {0, 0.25F, 0.5F, -1, 2, 1e30F, nan, 1, 1, 0.1F, 0.1F, 0.1F, infinity, 0, -infinity, 1, 1, 1}, {}};
  const auto png = encode_png(image, 1);
  ASSERT_TRUE(png.ok()) << png.error().to_string();
  const auto back = read_image(put("a.png", *png));
  ASSERT_TRUE(back.ok()) << back.error().to_string();
  const float expected[] = {0, 0.5F, 1, 0, 1, 1, 1, 0, 1, 0.2F, 0.2F, 0.2F, 1, 0, 0, 1, 1, 1};
  for (std::size_t i = 0; i < 18; ++i) {
    // Half of an 8-bit step of sRGB is at most 0.0045 in linear value.
    EXPECT_NEAR(back->rgb[i], expected[i], 0.0046F) << i;
  }
  EXPECT_FALSE(encode_png(image, nan).ok());
}

// Claim: the sRGB curves are those of IEC 61966-2-1, inverse to each other, and pass what is not a number.
TEST(Srgb, FollowsTheStandard) {
  for (int i = -20; i <= 4000; ++i) {
    const float v = static_cast<float>(i) / 1000.0F;
    const double linear = v <= 0.04045F ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
    EXPECT_NEAR(srgb_to_linear(v), linear, 1e-7 + 2e-7 * std::abs(linear)) << v;
    const double encoded = v <= 0.0031308F ? v * 12.92 : 1.055 * std::pow(double{v}, 1 / 2.4) - 0.055;
    EXPECT_NEAR(linear_to_srgb(v), encoded, 1e-7 + 2e-7 * std::abs(encoded)) << v;
    EXPECT_NEAR(linear_to_srgb(srgb_to_linear(v)), v, 3e-6) << v;
  }
  for (const float v : {1e-3F, 1e3F, 1e20F, 3e38F}) {
    EXPECT_NEAR(linear_to_srgb(v) / (1.055 * std::pow(double{v}, 1 / 2.4) - 0.055),
                v < 1 ? 12.92e-3 / (1.055 * std::pow(1e-3, 1 / 2.4) - 0.055) : 1, 1e-6);
  }
  EXPECT_TRUE(std::isnan(srgb_to_linear(std::nanf(""))));
  EXPECT_TRUE(std::isnan(linear_to_srgb(std::nanf(""))));
  EXPECT_TRUE(std::isinf(srgb_to_linear(std::numeric_limits<float>::infinity())));
}

// Claim: what cannot be read gives an input error that names the file.
TEST_F(ImageIo, BadFilesAreRefused) {
  const std::vector<float> rgb(12, 1.0F);
  const std::string good = encode_exr(2, 2, rgb, {}).value();
  const std::string text_png = "\x89PNG\r\n\x1a\n and no more";
  const std::filesystem::path paths[] = {folder_ / "absent.exr",
                                         folder_,
                                         put("text.exr", "not an image"),
                                         put("empty.exr", ""),
                                         put("cut.exr", good.substr(0, good.size() - 10)),
                                         put("head.exr", good.substr(0, 40)),
                                         put("bad.png", text_png)};
  for (const auto& path : paths) {
    const auto image = read_image(path);
    ASSERT_FALSE(image.ok()) << path;
    EXPECT_EQ(image.error().kind, ErrorKind::input) << path;
    EXPECT_EQ(image.error().file, path.string());
    EXPECT_EQ(image.error().message.find('\n'), std::string::npos);
  }
}

// Claim: damaged EXR headers and pixels give an error or an image, never a crash or a hang, and hostile sizes
// nothing.
TEST_F(ImageIo, DamagedExrNeverCrashes) {
  const std::vector<float> rgb = noise(8 * 8 * 3, 9);
  const std::string good = encode_exr(8, 8, rgb, {}).value();
  for (std::size_t i = 0; i < good.size(); i += 7) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 0x41);
    const auto image = read_image(put("bad.exr", bad));
    if (image.ok()) {
      EXPECT_EQ(image->rgb.size(), std::size_t{image->width} * image->height * 3);
    } else {
      EXPECT_FALSE(image.error().message.empty());
    }
  }
  // The data window says 2^30 pixels a side.
  std::string huge = good;
  for (const char* window : {"dataWindow", "displayWindow"}) {
    const std::size_t at = huge.find(window);
    ASSERT_NE(at, std::string::npos);
    const std::size_t box = huge.find("box2i", at) + 6 + 4;  // the name, its zero, the size
    for (const std::size_t corner : {box + 8, box + 12})
      huge.replace(corner, 4, std::string("\xff\xff\xff\x3f", 4));
  }
  const auto image = read_image(put("huge.exr", huge));
  ASSERT_FALSE(image.ok());
  // And one within the limits that the file cannot hold.
  const auto hollow = read_image(put("hollow.ppm", "P6\n60000 4000\n255\nabc"));
  ASSERT_FALSE(hollow.ok());
  EXPECT_THAT(hollow.error().message, testing::HasSubstr("cannot hold"));
}

// Claim: callers' mistakes are errors: sizes that do not agree, names that cannot be, orders smuggled in as
// metadata.
TEST_F(ImageIo, BadRequestsAreRefused) {
  const std::vector<float> rgb(12, 1.0F);
  EXPECT_FALSE(encode_exr(2, 3, rgb, {}).ok());
  EXPECT_FALSE(encode_exr(0, 0, {}, {}).ok());
  EXPECT_FALSE(encode_exr(Limits::max_extent + 1, 1, rgb, {}).ok());
  EXPECT_FALSE(encode_exr(2, 2, rgb, {{"compression", "none"}}).ok());
  EXPECT_FALSE(encode_exr(2, 2, rgb, {{"", "x"}}).ok());
  EXPECT_FALSE(encode_exr(2, 2, rgb, {{std::string(256, 'a'), "x"}}).ok());
  const std::vector<float> small(3, 1.0F);
  const Layer wrong[] = {{"a", small, {}}};
  EXPECT_FALSE(encode_exr(2, 2, rgb, {}, wrong).ok());
  const Layer twice[] = {{"a", rgb, {}}, {"a", rgb, {}}};
  EXPECT_FALSE(encode_exr(2, 2, rgb, {}, twice).ok());
  EXPECT_FALSE(encode_png({2, 3, rgb, {}}).ok());
}

}  // namespace
}  // namespace candela::image
