// The kinds of files that each image format has: gray, alpha, palettes, few bits, compressed rows, windows,
// inks. Files that OpenImageIO does not write are put together here.
#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>

#include "tests/unit/decoded_image.h"
#include "tests/unit/image_bytes.h"
#include "worker/core/math.h"
#include "worker/scene/textures/image_decode.h"

namespace candela::scene {
namespace {

using test::decode;
using test::encode_image;
using test::error_of;
using test::from_srgb;

ImageReading channel(const std::string& name) {
  ImageReading reading;
  reading.channel = name;
  return reading;
}

std::string big_endian(std::uint32_t v) {
  std::string out;
  for (int shift = 24; shift >= 0; shift -= 8) out += static_cast<char>(v >> shift & 255);
  return out;
}

// ---- PNG ----

std::string png_chunk(const std::string& name, const std::string& data) {
  const std::string body = name + data;
  const auto crc = static_cast<std::uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size())));
  return big_endian(static_cast<std::uint32_t>(data.size())) + body + big_endian(crc);
}

// rows: each begins with the byte of its filter, 0.
std::string png(std::uint32_t width, std::uint32_t height, char bits, char color_type,
                const std::string& chunks, const std::string& rows) {
  std::string packed(compressBound(static_cast<uLong>(rows.size())), '\0');
  uLongf size = packed.size();
  EXPECT_EQ(compress(reinterpret_cast<Bytef*>(packed.data()), &size,
                     reinterpret_cast<const Bytef*>(rows.data()), static_cast<uLong>(rows.size())),
            Z_OK);
  packed.resize(size);
  return std::string("\x89PNG\r\n\x1a\n") +
         png_chunk("IHDR",
                   big_endian(width) + big_endian(height) + bits + color_type + std::string(3, '\0')) +
         chunks + png_chunk("IDAT", packed) + png_chunk("IEND", "");
}

// Claim: palettes, gray of 1, 2 and 4 bits, gray with alpha, and transparent colors are the sRGB colors they
// stand for; 16 bits are sRGB as in Mitsuba.
TEST(TextureKinds, Png) {
  const std::string palette = png_chunk("PLTE", std::string("\x00\x33\xff\x66\x99\xcc\xff\xff\xff", 9));
  const TexelImage indexed = decode(png(3, 1, 8, 3, palette, std::string("\0\1\2\0", 4)), "a.png");
  EXPECT_EQ(indexed.at(0, 0), (Spectrum{from_srgb(0.4), from_srgb(0.6), from_srgb(0.8)}));
  EXPECT_EQ(indexed.at(1, 0), Spectrum(1));
  EXPECT_EQ(indexed.at(2, 0), (Spectrum{0, from_srgb(0.2), 1}));
  // Four pixels of 2 bits in a byte: 1, 0, 2, 1.
  const TexelImage few = decode(png(4, 1, 2, 3, palette, std::string("\0\x49", 2)), "a.png");
  EXPECT_EQ(few.at(0, 0), indexed.at(0, 0));
  EXPECT_EQ(few.at(2, 0), indexed.at(1, 0));
  const std::string see_through = palette + png_chunk("tRNS", std::string("\xff\x80", 2));
  const std::string with_alpha = png(3, 1, 8, 3, see_through, std::string("\0\1\2\0", 4));
  EXPECT_EQ(decode(with_alpha, "a.png").at(0, 0), indexed.at(0, 0));  // colors as they are stored
  EXPECT_EQ(decode(with_alpha, "a.png", channel("a")).at(0, 0), Spectrum(from_srgb(128 / 255.0)));
  // 1 bit: 1 0 1 1; 4 bits: 3, 15.
  const TexelImage bits = decode(png(4, 1, 1, 0, "", std::string("\0\xb0", 2)), "a.png");
  EXPECT_EQ(bits.format, TexelFormat::gray8);
  EXPECT_EQ(bits.at(0, 0), Spectrum(1));
  EXPECT_EQ(bits.at(1, 0), Spectrum(0));
  EXPECT_EQ(bits.at(3, 0), Spectrum(1));
  EXPECT_EQ(decode(png(2, 1, 4, 0, "", std::string("\0\x3f", 2)), "a.png").at(0, 0),
            Spectrum(from_srgb(0.2)));
  // Gray and alpha: 51, transparent; of 16 bits: 0x3333, half transparent.
  const std::string gray_alpha = png(2, 1, 8, 4, "", std::string("\0\x33\0\xff\xff", 5));
  EXPECT_EQ(decode(gray_alpha, "a.png").at(0, 0), Spectrum(from_srgb(0.2)));
  EXPECT_EQ(decode(gray_alpha, "a.png", channel("a")).at(0, 0), Spectrum(0));
  const std::string words = png(1, 1, 16, 4, "", std::string("\0\x33\x33\x80\0", 5));
  EXPECT_EQ(decode(words, "a.png").at(0, 0), Spectrum(from_srgb(0.2)));
  EXPECT_EQ(decode(words, "a.png").format, TexelFormat::gray32);
  ImageReading raw;
  raw.encoding = ImageReading::Encoding::linear;
  EXPECT_EQ(decode(words, "a.png", raw).at(0, 0), Spectrum(0.2f));
}

// ---- JPEG ----

// A baseline JPEG of 8 x 8 pixels, the same everywhere, of one to four components.
std::string flat_jpeg(const std::vector<int>& values) {
  const auto n = static_cast<char>(values.size());
  const auto segment = [](char marker, const std::string& body) {
    const auto size = static_cast<std::uint32_t>(body.size() + 2);
    return std::string("\xff") + marker + static_cast<char>(size >> 8) + static_cast<char>(size & 255) + body;
  };
  std::string out = "\xff\xd8";
  out += segment('\xdb', std::string(1, '\0') + std::string(64, '\1'));  // no quantization
  std::string frame = std::string("\x08\0\x08\0\x08", 5) + n, scan(1, n);
  for (char c = 1; c <= n; ++c) {
    frame += c + std::string("\x11\0", 2);
    scan += c + std::string(1, '\0');
  }
  out += segment('\xc0', frame);
  std::string sizes(16, '\0'), categories;
  sizes[3] = 12;  // twelve codes of four bits: the code of a category is its number
  for (char c = 0; c < 12; ++c) categories += c;
  out += segment('\xc4', std::string(1, '\0') + sizes + categories);
  out += segment('\xc4',
                 std::string("\x10\1", 2) + std::string(15, '\0') + std::string(1, '\0'));  // 0: end of block
  out += segment('\xda', scan + std::string("\0\x3f\0", 3));
  std::string bits;
  for (const int value : values) {
    const int dc = 8 * (value - 128);
    int category = 0;
    while (std::abs(dc) >> category != 0) ++category;
    for (int i = 3; i >= 0; --i) bits += (category >> i & 1) != 0 ? '1' : '0';
    const int coded = dc < 0 ? dc + (1 << category) - 1 : dc;
    for (int i = category - 1; i >= 0; --i) bits += (coded >> i & 1) != 0 ? '1' : '0';
    bits += '0';
  }
  while (bits.size() % 8 != 0) bits += '1';
  for (std::size_t i = 0; i < bits.size(); i += 8) {
    out += static_cast<char>(std::stoi(bits.substr(i, 8), nullptr, 2));
    if (out.back() == '\xff') out += '\0';
  }
  return out + "\xff\xd9";
}

// Claim: gray and color JPEGs are sRGB, whatever the file's name; one of inks is refused, for its colors are
// unknown.
TEST(TextureKinds, Jpeg) {
  const TexelImage gray = decode(flat_jpeg({51}), "a.png");
  EXPECT_EQ(gray.format, TexelFormat::gray8);
  EXPECT_EQ(gray.at(3, 7), Spectrum(from_srgb(0.2)));
  const TexelImage neutral = decode(flat_jpeg({204, 128, 128}), "a.jpg");  // luma and no chroma
  EXPECT_EQ(neutral.format, TexelFormat::rgb8);
  EXPECT_EQ(neutral.at(7, 0), Spectrum(from_srgb(0.8)));
  EXPECT_NE(error_of(flat_jpeg({10, 20, 30, 40}), "a.jpg").find("CMYK"), std::string::npos);
  EXPECT_NE(error_of(flat_jpeg({51}).substr(0, 60), "a.jpg"), "");
}

// ---- OpenEXR and floats ----

// Claim: one channel of any name is gray, beside an alpha too; small letters are colors; a data window that
// begins elsewhere is the image; half keeps its values; two channels without alpha are no color.
TEST(TextureKinds, OpenExr) {
  const std::vector<float> values = {0.25f, 0.5f, 0.75f, 1.5f};
  const auto exr = [&](int width, const std::vector<std::string>& names,
                       OIIO::TypeDesc type = OIIO::TypeDesc::HALF) {
    OIIO::ImageSpec spec(width, 1, static_cast<int>(names.size()), type);
    spec.channelnames = names;
    return encode_image("openexr", spec, OIIO::TypeDesc::FLOAT, values.data());
  };
  for (const char* const name : {"Y", "Z", "height", "A"}) {
    const TexelImage image = decode(exr(2, {name}), "a.exr");
    EXPECT_EQ(image.format, TexelFormat::gray32) << name;
    EXPECT_EQ(image.at(1, 0), Spectrum(0.5f)) << name;
  }
  EXPECT_EQ(decode(exr(2, {"Y", "A"}), "a.exr").at(1, 0), Spectrum(0.75f));
  EXPECT_EQ(decode(exr(2, {"A", "Y"}), "a.exr").at(1, 0), Spectrum(1.5f));
  EXPECT_EQ(decode(exr(2, {"A", "Y"}), "a.exr", channel("a")).at(1, 0), Spectrum(0.75f));
  EXPECT_EQ(decode(exr(1, {"r", "g", "b"}), "a.exr").at(0, 0), (Spectrum{0.25f, 0.5f, 0.75f}));
  EXPECT_EQ(decode(exr(1, {"B", "G", "R", "A"}), "a.exr").at(0, 0), (Spectrum{0.75f, 0.5f, 0.25f}));
  EXPECT_EQ(decode(exr(1, {"R", "G", "B", "depth.Z"}, OIIO::TypeDesc::FLOAT), "a.exr").at(0, 0),
            (Spectrum{0.25f, 0.5f, 0.75f}));
  EXPECT_NE(error_of(exr(2, {"U", "V"}), "a.exr").find("U, V"), std::string::npos);
  EXPECT_NE(error_of(exr(1, {"layer.R", "layer.G", "layer.B"}), "a.exr").find("R, G and B"),
            std::string::npos);
  OIIO::ImageSpec window(2, 1, 1, OIIO::TypeDesc::FLOAT);
  window.x = -5;
  window.y = 7;
  window.full_width = window.full_height = 100;
  const TexelImage moved =
      decode(encode_image("openexr", window, OIIO::TypeDesc::FLOAT, values.data()), "a.exr");
  EXPECT_EQ(moved.width, 2U);
  EXPECT_EQ(moved.at(1, 0), Spectrum(0.5f));
}

// Claim: the shared exponent of Radiance files reaches from tiny to huge values, in rows that are packed
// (from 8 pixels on) and in those that are not.
TEST(TextureKinds, RadianceHdr) {
  for (const int width : {3, 40}) {
    std::vector<float> values;
    for (int i = 0; i < width; ++i)
      for (const float v : {1.0f, 0.5f, 0.25f}) values.push_back(v * std::ldexp(1.0f, i % 20 * 3 - 30));
    const OIIO::ImageSpec spec(width, 1, 3, OIIO::TypeDesc::FLOAT);
    const TexelImage image = decode(encode_image("hdr", spec, OIIO::TypeDesc::FLOAT, values.data()), "a.hdr");
    for (int i = 0; i < width; ++i) {
      const auto k = static_cast<std::size_t>(3 * i);
      EXPECT_EQ(image.at(static_cast<std::uint32_t>(i), 0),
                (Spectrum{values[k], values[k + 1], values[k + 2]}));
    }
  }
}

// ---- TGA and BMP ----

// Claim: packed rows, rows from the top or the bottom, gray, palettes and 16 bits of TGA; palettes of BMP.
TEST(TextureKinds, TgaAndBmp) {
  const auto tga = [](char type, char bits, char descriptor, const std::string& map, char map_length,
                      const std::string& pixels) {
    std::string head(18, '\0');
    head[1] = map.empty() ? 0 : 1;
    head[2] = type;
    head[5] = map_length;
    head[7] = map.empty() ? 0 : 24;
    head[12] = 2;
    head[14] = 2;
    head[16] = bits;
    head[17] = descriptor;
    return head + map + pixels;
  };
  const Spectrum color = {from_srgb(0.6), from_srgb(0.4), from_srgb(0.2)};
  const std::string bgr = "\x33\x66\x99", white = "\xff\xff\xff";
  // Rows from the bottom: the color twice, then white twice.
  for (const bool packed : {false, true}) {
    const std::string pixels = packed ? "\x81" + bgr + "\x81" + white : bgr + bgr + white + white;
    const TexelImage image = decode(tga(packed ? 10 : 2, 24, 0, "", 0, pixels), "a.tga");
    EXPECT_EQ(image.at(0, 1), color) << packed;
    EXPECT_EQ(image.at(1, 0), Spectrum(1)) << packed;
  }
  EXPECT_EQ(decode(tga(2, 24, 0x20, "", 0, bgr + bgr + white + white), "a.tga").at(0, 0),
            color);  // from the top
  EXPECT_EQ(decode(tga(3, 8, 0, "", 0, std::string("\x33\xff\0\0", 4)), "a.tga").at(0, 1),
            Spectrum(from_srgb(0.2)));
  EXPECT_EQ(decode(tga(1, 8, 0, bgr + white, 2, std::string("\0\1\1\1", 4)), "a.tga").at(0, 1), color);
  std::string bmp = "BM" + std::string(52, '\0');
  const auto put = [&](std::size_t at, std::uint32_t value) {
    for (std::size_t i = 0; i < 4; ++i) bmp[at + i] = static_cast<char>(value >> (8 * i) & 255);
  };
  put(2, 54 + 8 + 8);  // the file's bytes
  put(10, 54 + 8);     // before the pixels: headers and two colors
  put(14, 40);
  put(18, 2);
  put(22, 2);
  bmp[26] = 1;
  bmp[28] = 8;
  put(46, 2);
  bmp += bgr + std::string(1, '\0') + white + std::string(1, '\0') + std::string("\0\1\0\0\1\1\0\0", 8);
  const TexelImage indexed = decode(bmp, "a.bmp");
  EXPECT_EQ(indexed.at(0, 1), color);
  EXPECT_EQ(indexed.at(1, 1), Spectrum(1));
  EXPECT_EQ(indexed.at(0, 0), Spectrum(1));
}

}  // namespace
}  // namespace candela::scene
