// Claims: what a header says of an image is heeded: which way up it is stored, in all eight ways, by each
// format that has them; which part of an OpenEXR file has the colors; and what its primaries are.
#include <gtest/gtest.h>
#include <zlib.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "tests/temporary_folder.h"
#include "tests/unit/decoded_image.h"
#include "tests/unit/image_bytes.h"
#include "tests/unit/shared_cases.h"
#include "worker/scene/textures/image_decode.h"

namespace candela::scene {
namespace {

using test::decode;
using test::encode_image;

// A picture of 6 x 4 blocks of a color each: red grows to the right, green downwards.
constexpr int kAcross = 6, kDown = 4;
std::array<double, 3> block(int x, int y) {
  return {x / 8.0, y / 4.0, 0.5};
}

// The stored place of column x, row y of an upright picture of w x h, as TIFF 6.0 words it: the first row and
// the first column of what is stored are which sides of the picture.
struct Place {
  int column, row;
};
Place stored_at(int code, int x, int y, int w, int h) {
  const int left = x, right = w - 1 - x, top = y, bottom = h - 1 - y;
  switch (code) {
    case 1:
      return {left, top};
    case 2:
      return {right, top};
    case 3:
      return {right, bottom};
    case 4:
      return {left, bottom};
    case 5:
      return {top, left};
    case 6:
      return {top, right};
    case 7:
      return {bottom, right};
    default:
      return {bottom, left};
  }
}

// The picture stored in one of the eight ways, a block of `size` pixels, interleaved colors.
std::vector<float> stored(int code, int size, OIIO::ImageSpec& spec, OIIO::TypeDesc type) {
  const int w = kAcross * size, h = kDown * size;
  spec = code >= 5 ? OIIO::ImageSpec(h, w, 3, type) : OIIO::ImageSpec(w, h, 3, type);
  std::vector<float> pixels(static_cast<std::size_t>(3 * w * h));
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      const Place at = stored_at(code, x, y, w, h);
      const auto color = block(x / size, y / size);
      for (int c = 0; c < 3; ++c)
        pixels[static_cast<std::size_t>(3 * (at.row * spec.width + at.column) + c)] =
            static_cast<float>(color[static_cast<std::size_t>(c)]);
    }
  return pixels;
}

void expect_upright(const std::string& bytes, const std::string& name, int size, double tolerance) {
  const TexelImage image = decode(bytes, name, {ImageReading::Encoding::linear, 1, {}});
  ASSERT_EQ(image.width, static_cast<std::uint32_t>(kAcross * size)) << name;
  ASSERT_EQ(image.height, static_cast<std::uint32_t>(kDown * size)) << name;
  for (int y = 0; y < kDown; ++y)
    for (int x = 0; x < kAcross; ++x) {
      const Spectrum seen = image.at(static_cast<std::uint32_t>(x * size + size / 2),
                                     static_cast<std::uint32_t>(y * size + size / 2));
      const auto color = block(x, y);
      EXPECT_NEAR(seen.r, color[0], tolerance) << name << " " << x << " " << y;
      EXPECT_NEAR(seen.g, color[1], tolerance) << name << " " << x << " " << y;
    }
}

TEST(ImageHeaders, TagsOfOrientationTurnTheImage) {
  for (int code = 1; code <= 8; ++code) {
    SCOPED_TRACE(code);
    OIIO::ImageSpec spec;
    for (const auto& [format, type, size, tolerance] :
         {std::tuple("tiff", OIIO::TypeDesc(OIIO::TypeDesc::UINT8), 1, 0.003),
          std::tuple("openexr", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT), 1, 1e-6),
          std::tuple("jpeg", OIIO::TypeDesc(OIIO::TypeDesc::UINT8), 16, 0.04)}) {
      const std::vector<float> pixels = stored(code, size, spec, type);
      spec.attribute("Orientation", code);
      spec.attribute("Compression", std::string(format) == "jpeg" ? "jpeg:100" : "none");
      const std::string name = std::string("a.") + (std::string(format) == "openexr" ? "exr" : format);
      expect_upright(encode_image(format, spec, OIIO::TypeDesc::FLOAT, pixels.data()), name, size, tolerance);
    }
  }
}

std::string big_endian(std::uint32_t v) {
  return {static_cast<char>(v >> 24), static_cast<char>(v >> 16), static_cast<char>(v >> 8),
          static_cast<char>(v)};
}

TEST(ImageHeaders, ExifOfPngTurnsTheImage) {
  for (int code = 1; code <= 8; ++code) {
    SCOPED_TRACE(code);
    OIIO::ImageSpec spec;
    const std::vector<float> pixels = stored(code, 1, spec, OIIO::TypeDesc::UINT8);
    std::string png = encode_image("png", spec, OIIO::TypeDesc::FLOAT, pixels.data());
    std::string chunk("eXIfMM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0", 23);
    chunk += static_cast<char>(code);
    chunk += std::string("\0\0\0\0\0\0", 6);
    const auto crc = static_cast<std::uint32_t>(
        crc32(0, reinterpret_cast<const Bytef*>(chunk.data()), static_cast<uInt>(chunk.size())));
    png.insert(33, big_endian(static_cast<std::uint32_t>(chunk.size() - 4)) + chunk + big_endian(crc));
    expect_upright(png, "a.png", 1, 0.003);
  }
}

// Radiance says it in words: "-Y 4 +X 6" are 4 rows from the top, each of 6 pixels from the left; y grows
// upwards.
TEST(ImageHeaders, ResolutionsOfRadianceTurnTheImage) {
  for (const std::string words : {"-Y+X", "-Y-X", "+Y-X", "+Y+X", "+X-Y", "+X+Y", "-X+Y", "-X-Y"}) {
    SCOPED_TRACE(words);
    const auto extent = [](char axis) { return axis == 'X' ? kAcross : kDown; };
    // Steps along an axis to the column from the left or the row from the top.
    const auto from_edge = [&](char sign, char axis, int step) {
      const bool forward = axis == 'X' ? sign == '+' : sign == '-';
      return forward ? step : extent(axis) - 1 - step;
    };
    std::string file = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + words.substr(0, 2) + " " +
                       std::to_string(extent(words[1])) + " " + words.substr(2) + " " +
                       std::to_string(extent(words[3])) + "\n";
    for (int i = 0; i < extent(words[1]); ++i)
      for (int j = 0; j < extent(words[3]); ++j) {
        const int a = from_edge(words[0], words[1], i), b = from_edge(words[2], words[3], j);
        const auto color = words[1] == 'X' ? block(a, b) : block(b, a);
        for (const double v : color) file += static_cast<char>(static_cast<int>(v * 256 * 0.5));
        file += static_cast<char>(129);  // times 2 / 256
      }
    expect_upright(file, "a.hdr", 1, 0.008);
  }
}

// Parts of one OpenEXR file: names of channels, and the value of each.
struct Part {
  std::vector<std::string> channels;
  std::vector<float> values;
};
std::string parts_of_exr(const std::vector<Part>& parts) {
  std::vector<OIIO::ImageSpec> specs;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    OIIO::ImageSpec spec(4, 2, static_cast<int>(parts[i].channels.size()), OIIO::TypeDesc::FLOAT);
    spec.channelnames = parts[i].channels;
    spec.attribute("oiio:subimagename", "part" + std::to_string(i));
    specs.push_back(spec);
  }
  // OpenImageIO writes several parts to files alone.
  const test::TemporaryFolder folder;
  const std::string file = (folder.path() / "x.exr").string();
  auto output = OIIO::ImageOutput::create("openexr");
  bool ok = output && output->open(file, static_cast<int>(specs.size()), specs.data());
  for (std::size_t i = 0; ok && i < parts.size(); ++i) {
    if (i > 0) ok = output->open(file, specs[i], OIIO::ImageOutput::AppendSubimage);
    std::vector<float> pixels;
    for (int p = 0; p < 8; ++p) pixels.insert(pixels.end(), parts[i].values.begin(), parts[i].values.end());
    ok = ok && output->write_image(OIIO::TypeDesc::FLOAT, pixels.data());
  }
  EXPECT_TRUE(ok && output->close()) << (output ? output->geterror() : "no OpenEXR");
  return test::file_text(file);
}

TEST(ImageHeaders, ThePartWithColorsIsRead) {
  const Part depth{{"Z"}, {7}}, color{{"R", "G", "B"}, {0.25f, 0.5f, 1}},
      other{{"R", "G", "B", "A"}, {2, 2, 2, 3}};
  for (const std::vector<Part>& parts : {std::vector<Part>{depth, color, other},
                                         {color, other, depth},
                                         {depth, {{"U", "V"}, {1, 2}}, color}}) {
    const TexelImage image = decode(parts_of_exr(parts), "a.exr");
    ASSERT_EQ(image.width, 4u);
    const Spectrum seen = image.at(1, 1);
    EXPECT_EQ(seen.r, 0.25f);
    EXPECT_EQ(seen.g, 0.5f);
    EXPECT_EQ(seen.b, 1.0f);
  }
  // Without colors it is the first part of luminance, and one channel is that of the first part that has it.
  EXPECT_EQ(decode(parts_of_exr({depth, {{"Y"}, {3}}}), "a.exr").at(0, 0).g, 3.0f);
  EXPECT_EQ(
      decode(parts_of_exr({depth, color, other}), "a.exr", {ImageReading::Encoding::file, 1, "a"}).at(0, 0).g,
      3.0f);
}

// Claim: a file of several parts, none of which is a picture, is no gray texture of its depth: the error
// names the channels of each part.
TEST(ImageHeaders, PartsWithoutAPictureAreRefused) {
  const std::string file = parts_of_exr({{{"Z"}, {7}}, {{"U", "V"}, {1, 2}}});
  Scratch scratch({});
  const auto image = decode_image(file, "a.exr", {}, scratch);
  ASSERT_FALSE(image.ok());
  EXPECT_NE(image.error().to_string().find("none of the file's 2 parts has R, G and B: they have Z; U, V"),
            std::string::npos)
      << image.error().to_string();
  // A file of one part is what its only channel says.
  EXPECT_EQ(decode(parts_of_exr({{{"Z"}, {7}}}), "a.exr").at(0, 0).g, 7.0f);
}

TEST(ImageHeaders, PrimariesOfOpenExrBecomeRec709) {
  const auto seen = [](const std::array<float, 8>& chromaticities, const std::array<float, 3>& color) {
    OIIO::ImageSpec spec(1, 1, 3, OIIO::TypeDesc::FLOAT);
    spec.attribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8), chromaticities.data());
    return decode(encode_image("openexr", spec, OIIO::TypeDesc::FLOAT, color.data()), "a.exr").at(0, 0);
  };
  const auto expect = [](Spectrum s, double r, double g, double b) {
    EXPECT_NEAR(s.r, r, 2e-4);
    EXPECT_NEAR(s.g, g, 2e-4);
    EXPECT_NEAR(s.b, b, 2e-4);
  };
  // ITU-R BT.2087: from Rec.2020 to Rec.709 without what is out of gamut.
  const std::array<float, 8> rec2020 = {0.708F, 0.292F, 0.17F, 0.797F, 0.131F, 0.046F, 0.3127F, 0.329F};
  expect(seen(rec2020, {1, 1, 1}), 1, 1, 1);
  expect(seen(rec2020, {1, 0, 0}), 1.6605, 0, 0);
  expect(seen(rec2020, {0.5F, 0.5F, 0.25F}), 0.5 + 0.25 * 0.0728, 0.5 + 0.25 * 0.0083, 0.5 - 0.25 * 1.1187);
  // CIE XYZ: the white D65.
  const std::array<float, 8> xyz = {1, 0, 0, 1, 0, 0, 1 / 3.0F, 1 / 3.0F};
  expect(seen(xyz, {0.950456F, 1, 1.089058F}), 1, 1, 1);
  // Rec.709's own change no bit.
  const Spectrum same = seen({0.64F, 0.33F, 0.3F, 0.6F, 0.15F, 0.06F, 0.3127F, 0.329F}, {0.1F, 0.2F, 0.3F});
  EXPECT_EQ(same.r, 0.1F);
  EXPECT_EQ(same.g, 0.2F);
  EXPECT_EQ(same.b, 0.3F);
  // Primaries that make no colors are passed over.
  expect(seen({0, 0, 0, 0, 0, 0, 0, 0}, {0.1F, 0.2F, 0.3F}), 0.1, 0.2, 0.3);
}

TEST(ImageHeaders, SharedCase) {
  const auto folder = test::shared_case("hdr_orientation");
  if (folder.empty()) GTEST_SKIP() << "../shared/cases/hdr_orientation is not here";
  const TexelImage top = decode(test::file_text(folder / "sky_top_first.hdr"), "a.hdr");
  const TexelImage bottom = decode(test::file_text(folder / "sky_bottom_first.hdr"), "a.hdr");
  ASSERT_EQ(top.width, bottom.width);
  ASSERT_EQ(top.height, bottom.height);
  for (std::uint32_t y = 0; y < top.height; ++y)
    for (std::uint32_t x = 0; x < top.width; ++x) {
      EXPECT_EQ(top.at(x, y).r, bottom.at(x, y).r) << x << " " << y;
      EXPECT_EQ(top.at(x, y).b, bottom.at(x, y).b) << x << " " << y;
    }
  EXPECT_GT(top.at(0, 0).b, top.at(0, top.height - 1).b);  // blue above brown
}

}  // namespace
}  // namespace candela::scene
