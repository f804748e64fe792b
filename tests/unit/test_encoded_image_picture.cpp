// Tests of pictures for people. OpenImageIO is the judge.
#include "common/image/picture.h"

#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>

#include "tests/temporary_folder.h"

namespace candela::image {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

class Picture : public testing::Test {
 protected:
  // The codes of three channels that OpenImageIO reads from the encoded image.
  std::vector<std::uint16_t> codes(const Image& image, PictureFormat format, const Tone& tone,
                                   const char* wanted_format, OIIO::TypeDesc wanted_type) {
    const auto bytes = encode_picture(image, format, tone);
    EXPECT_TRUE(bytes.ok()) << bytes.error().to_string();
    if (!bytes.ok()) return {};
    const std::string path = (folder_.path() / (std::to_string(++files_) + ".file")).string();
    std::ofstream(path, std::ios::binary) << *bytes;
    const auto input = OIIO::ImageInput::open(path);
    EXPECT_NE(input, nullptr) << OIIO::geterror();
    if (!input) return {};
    EXPECT_STREQ(input->format_name(), wanted_format);
    EXPECT_EQ(input->spec().format, wanted_type);
    EXPECT_EQ(input->spec().width, static_cast<int>(image.width));
    EXPECT_EQ(input->spec().height, static_cast<int>(image.height));
    EXPECT_EQ(input->spec().nchannels, 3);
    std::vector<std::uint16_t> out(image.rgb.size());
    if (wanted_type == OIIO::TypeDesc::UINT16) {
      EXPECT_TRUE(input->read_image(0, 0, 0, 3, wanted_type, out.data()));
    } else {
      std::vector<std::uint8_t> narrow(out.size());
      EXPECT_TRUE(input->read_image(0, 0, 0, 3, wanted_type, narrow.data()));
      std::copy(narrow.begin(), narrow.end(), out.begin());
    }
    return out;
  }

 private:
  test::TemporaryFolder folder_;
  int files_ = 0;
};

// Claim: values of a range have codes in proportion, without sRGB's curve, ends included; values outside are
// clipped, infinite ones too; NaN is magenta. A TIFF has 16 bits, a PNG 8, at the same places.
TEST_F(Picture, ShowsARangeInProportion) {
  const Image depth{3,
                    2,
                    {10, 20, 15, 10, 0, 30, -kInfinity, kInfinity, 12.5F,  //
                     kNaN, 15, 15, 17.5F, 17.5F, 17.5F, 11, 12, 13},
                    {}};
  const Tone tone{.range = ValueRange{10, 20}};
  const std::vector<std::uint16_t> wide = {0,     65535, 32768, 0,     0,     65535, 0,    65535, 16384,
                                           65535, 0,     65535, 49151, 49151, 49151, 6554, 13107, 19661};
  EXPECT_EQ(codes(depth, PictureFormat::tiff, tone, "tiff", OIIO::TypeDesc::UINT16), wide);
  const std::vector<std::uint16_t> narrow = {0,   255, 128, 0,   0,   255, 0,  255, 64,
                                             255, 0,   255, 191, 191, 191, 26, 51,  77};
  EXPECT_EQ(codes(depth, PictureFormat::png, tone, "png", OIIO::TypeDesc::UINT8), narrow);
}

// Claim: without a range a TIFF has sRGB's curve and the exposure, as a PNG has.
TEST_F(Picture, ShowsColorsBySrgb) {
  const Image colors{2, 1, {0.5F, 0.25F, 0, 0.107F, 7, 1e-4F}, {}};
  const auto curve = [](double linear) {  // IEC 61966-2-1
    return std::lround(65535 *
                       (linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055));
  };
  const auto got = codes(colors, PictureFormat::tiff, {.exposure_stops = 1}, "tiff", OIIO::TypeDesc::UINT16);
  const std::vector<long> wanted = {curve(1), curve(0.5), 0, curve(0.214), curve(1), curve(2e-4)};
  ASSERT_EQ(got.size(), wanted.size());
  for (std::size_t i = 0; i < got.size(); ++i) EXPECT_NEAR(got[i], wanted[i], 1) << i;
}

// Claim: a JPEG has the PNG's codes to within its quantization, and fewer bytes at a lower quality.
TEST_F(Picture, JpegIsNearThePng) {
  Image ramp{64, 48, std::vector<float>(64 * 48 * 3), {}};
  for (std::size_t i = 0; i < ramp.rgb.size(); ++i)
    ramp.rgb[i] = 0.5F + 0.4F * std::sin(static_cast<float>(i / 3) * 0.05F);  // gray: no loss by chroma
  const auto png = codes(ramp, PictureFormat::png, {}, "png", OIIO::TypeDesc::UINT8);
  const auto jpeg = codes(ramp, PictureFormat::jpeg, {}, "jpeg", OIIO::TypeDesc::UINT8);
  ASSERT_EQ(jpeg.size(), png.size());
  for (std::size_t i = 0; i < png.size(); ++i) ASSERT_NEAR(jpeg[i], png[i], 12) << i;
  EXPECT_LT(encode_picture(ramp, PictureFormat::jpeg, {.jpeg_quality = 30})->size(),
            encode_picture(ramp, PictureFormat::jpeg, {})->size());
}

// Claim: the range of a layer is that of its finite values; that of vectors within -1 to 1 is -1 to 1.
TEST_F(Picture, FindsRanges) {
  const Image depth{2, 1, {3, 3, 3, 8, kNaN, kInfinity}, {}, "Z"};
  EXPECT_EQ(whole_range(depth)->low, 3);
  EXPECT_EQ(whole_range(depth)->high, 8);
  const Image normals{2, 1, {0, 0.5F, 0.25F, 0, 0, 1}, {}, "XYZ"};
  EXPECT_EQ(whole_range(normals)->low, -1);
  EXPECT_EQ(whole_range(normals)->high, 1);
  const Image positions{1, 1, {0, 0.5F, 2}, {}, "XYZ"};
  EXPECT_EQ(whole_range(positions)->high, 2);
  const Image even{1, 1, {0, 0, 0}, {}, "Z"};
  EXPECT_LT(whole_range(even)->low, whole_range(even)->high);
  const Image none{1, 1, {kNaN, kNaN, kInfinity}, {}, "Z"};
  EXPECT_FALSE(whole_range(none).ok());
}

// Claim: the format is that of the name's ending, whatever its case.
TEST(PictureFormats, AreNamedByEndings) {
  EXPECT_EQ(picture_format_of("a/b.png"), PictureFormat::png);
  EXPECT_EQ(picture_format_of("b.JPG"), PictureFormat::jpeg);
  EXPECT_EQ(picture_format_of("b.jpeg"), PictureFormat::jpeg);
  EXPECT_EQ(picture_format_of("b.tif"), PictureFormat::tiff);
  EXPECT_EQ(picture_format_of("b.Tiff"), PictureFormat::tiff);
  EXPECT_EQ(picture_format_of("png"), std::nullopt);
  EXPECT_EQ(picture_format_of("b.exr"), std::nullopt);
}

}  // namespace
}  // namespace candela::image
