// Tests of the readers of OpenEXR, PNG and JPEG, and of the writers of the first two. OpenImageIO, which
// reads all of them too, is the judge.
#include "common/image/formats.h"

#include <ImfChromaticitiesAttribute.h>
#include <ImfDeepFrameBuffer.h>
#include <ImfDeepScanLineOutputFile.h>
#include <ImfIntAttribute.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfRgbaFile.h>
#include <ImfStandardAttributes.h>
#include <ImfTiledOutputPart.h>
#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "common/image/image.h"
#include "tests/temporary_folder.h"
#include "tests/unit/image_files.h"
#include "tests/unit/jpeg_files.h"

namespace candela::image {
namespace {

using test::big_endian;
using test::jpeg_file;
using test::png_chunk;
using test::png_file;
using test::write_exr_file;

class ImageFormats : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return (temporary_.path() / name).string(); }
  std::string put(const std::string& name, const std::string& bytes) const {
    std::ofstream(path(name), std::ios::binary) << bytes;
    return path(name);
  }

 private:
  test::TemporaryFolder temporary_;
};

std::string bytes_of(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

std::string error_of(const std::string& path) {
  const auto reader = open_file(path);
  return reader.ok() ? "" : reader.error().to_string();
}

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

// Compares all that our reader says and gives of the first part of a file with OpenImageIO's.
void expect_read_as_by_oiio(const std::string& path, bool straight_colors) {
  OIIO::ImageSpec config;
  if (straight_colors) config.attribute("oiio:UnassociatedAlpha", 1);
  const auto judge = OIIO::ImageInput::open(path, &config);
  ASSERT_NE(judge, nullptr) << OIIO::geterror();
  const std::string bytes = bytes_of(path);
  auto opened = open_bytes(bytes, format_of(bytes, path), path, straight_colors);
  ASSERT_TRUE(opened.ok()) << opened.error().to_string();
  ImageReader& reader = **opened;
  const OIIO::ImageSpec& theirs = judge->spec();
  const ImageSpec ours = reader.spec();
  ASSERT_EQ(ours.channels, theirs.channelnames);
  ASSERT_EQ(ours.width, theirs.width);
  ASSERT_EQ(ours.height, theirs.height);
  EXPECT_EQ(ours.x, theirs.x);
  EXPECT_EQ(ours.y, theirs.y);
  EXPECT_EQ(ours.tile_width, theirs.tile_width);
  EXPECT_EQ(ours.tile_height, theirs.tile_height);
  EXPECT_EQ(ours.alpha_channel, theirs.alpha_channel);
  EXPECT_EQ(ours.z_channel, theirs.z_channel);
  EXPECT_EQ(ours.floating, theirs.format.is_floating_point());
  EXPECT_EQ(ours.is_uint8, theirs.format == OIIO::TypeDesc::UINT8);
  EXPECT_EQ(ours.sample_bytes, theirs.format.basesize());
  EXPECT_EQ(ours.image_bytes, theirs.image_bytes(true));

  const int channels = theirs.nchannels;
  const std::size_t samples = theirs.image_pixels() * static_cast<std::size_t>(channels);
  std::vector<float> expected(samples, -1), whole(samples, -2), bands(samples, -3),
      last(theirs.image_pixels());
  ASSERT_TRUE(judge->read_image(0, 0, 0, channels, OIIO::TypeDesc::FLOAT, expected.data()))
      << judge->geterror();
  ASSERT_TRUE(reader.read_part(0, 0, channels, SampleType::float32, whole.data())) << reader.error();
  EXPECT_TRUE(same_bits(whole, expected));
  constexpr int kBand = 5;
  for (int y = 0; y < ours.height; y += kBand) {
    ASSERT_TRUE(reader.read_rows(y, std::min(y + kBand, ours.height), 0, channels, SampleType::float32,
                                 bands.data() + static_cast<std::size_t>(y * ours.width * channels)))
        << reader.error();
  }
  EXPECT_TRUE(same_bits(bands, expected));
  ASSERT_TRUE(reader.read_rows(0, ours.height, channels - 1, channels, SampleType::float32, last.data()));
  for (std::size_t i = 0; i < last.size(); ++i)
    ASSERT_EQ(last[i], expected[(i + 1) * static_cast<std::size_t>(channels) - 1]) << i;
  if (theirs.format == OIIO::TypeDesc::UINT8) {
    std::vector<std::uint8_t> a(samples, 1), b(samples, 2);
    ASSERT_TRUE(reader.read_rows(0, ours.height, 0, channels, SampleType::uint8, a.data()));
    ASSERT_TRUE(judge->read_image(0, 0, 0, channels, OIIO::TypeDesc::UINT8, b.data()));
    EXPECT_TRUE(same_bits(a, b));
  }
}

Imf::Header header_of(const std::vector<std::pair<const char*, Imf::PixelType>>& channels,
                      const Imath::Box2i& data, const Imath::Box2i& display) {
  Imf::Header header(display, data);
  for (const auto& [name, type] : channels) header.channels().insert(name, Imf::Channel(type));
  return header;
}

// Claim: an OpenEXR file of every compression, pixel type, order, of scanlines, tiles, mipmaps and ripmaps,
// with any data window, gives the floats, the names of channels and the head that OpenImageIO gives, to the
// bit.
TEST_F(ImageFormats, ExrReadsAsByOpenImageIo) {
  using Imf::FLOAT, Imf::HALF, Imf::UINT;
  const std::vector<std::vector<std::pair<const char*, Imf::PixelType>>> sets = {
      {{"R", HALF}, {"G", HALF}, {"B", HALF}},
      {{"R", FLOAT}, {"G", FLOAT}, {"B", FLOAT}, {"A", FLOAT}},
      {{"R", HALF},
       {"G", FLOAT},
       {"B", HALF},
       {"Z", FLOAT},
       {"id", UINT},
       {"albedo.B", HALF},
       {"albedo.R", HALF},
       {"albedo.G", HALF},
       {"N.X", FLOAT},
       {"N.Y", FLOAT},
       {"N.Z", FLOAT},
       {"a.b.A", HALF},
       {"a.b.R", HALF}},
      {{"Y", HALF}},
      {{"r", HALF}, {"g", HALF}, {"b", HALF}, {"a", HALF}, {"Z", HALF}, {"Y", HALF}},
      {{"R", UINT}, {"G", UINT}, {"B", UINT}}};
  const Imath::Box2i at_zero({0, 0}, {32, 19}), apart({-5, 7}, {40, 60}), display({0, 0}, {63, 47});
  constexpr int kNoTiles = 3;
  for (int compression = 0; compression < Imf::NUM_COMPRESSION_METHODS; ++compression) {
    for (std::size_t set = 0; set < sets.size(); ++set) {
      for (const bool shifted : {false, true}) {
        for (int level = 0; level <= kNoTiles; ++level) {
          for (const Imf::LineOrder order : {Imf::INCREASING_Y, Imf::DECREASING_Y}) {
            if (set != 2 && (order == Imf::DECREASING_Y || !shifted)) continue;
            SCOPED_TRACE(testing::Message()
                         << "compression " << compression << ", channels " << set << ", level mode " << level
                         << ", order " << order << (shifted ? ", shifted" : ""));
            Imf::Header header = header_of(sets[set], shifted ? apart : at_zero, shifted ? display : at_zero);
            header.compression() = static_cast<Imf::Compression>(compression);
            header.lineOrder() = order;
            if (level < kNoTiles)
              header.setTileDescription(Imf::TileDescription(8, 12, static_cast<Imf::LevelMode>(level)));
            write_exr_file(path("a.exr"), header);
            expect_read_as_by_oiio(path("a.exr"), false);
          }
        }
      }
    }
  }
}

// Claim: a PNG of every color type and depth, interlaced or not, with a transparent color, and with each way
// to say how values become linear, gives the numbers that OpenImageIO gives, to the bit, multiplied by alpha
// or not.
TEST_F(ImageFormats, PngReadsAsByOpenImageIo) {
  const std::string colors[] = {"", png_chunk("sRGB", std::string(1, '\0')),
                                png_chunk("gAMA", big_endian(45455)), png_chunk("gAMA", big_endian(100000))};
  constexpr std::pair<int, int> kinds[] = {{0, 1}, {0, 2}, {0, 4}, {0, 8}, {0, 16}, {2, 8}, {2, 16}, {3, 1},
                                           {3, 2}, {3, 4}, {3, 8}, {4, 8}, {4, 16}, {6, 8}, {6, 16}};
  std::uint64_t seed = 0;
  for (const auto& [kind, bits] : kinds) {
    for (const bool interlaced : {false, true}) {
      for (const bool transparent : {false, true}) {
        if (transparent && kind >= 4) continue;
        for (const std::string& color : colors) {
          for (const bool straight : {false, true}) {
            SCOPED_TRACE(testing::Message()
                         << "kind " << kind << ", " << bits << " bits" << (interlaced ? ", interlaced" : "")
                         << (transparent ? ", transparent" : "") << (straight ? ", straight" : ""));
            std::string chunks = color;
            if (kind == 3)
              chunks += png_chunk("PLTE",
                                  png_file(9, 9, 8, 2, false, "", ++seed).substr(50, std::size_t{3} << bits));
            if (transparent)
              chunks += png_chunk(
                  "tRNS", kind == 3 ? std::string("\x10\x80", 2) : std::string(kind == 2 ? 6 : 2, '\1'));
            put("a.png", png_file(13, 9, bits, kind, interlaced, chunks, ++seed));
            expect_read_as_by_oiio(path("a.png"), straight);
          }
        }
      }
    }
  }
}

// Claim: a JPEG, gray or in colors, baseline or progressive, with chroma of any sampling and with marks to
// start again at, larger than a buffer or smaller than a block, gives the bytes and floats that OpenImageIO
// gives.
TEST_F(ImageFormats, JpegReadsAsByOpenImageIo) {
  std::uint64_t seed = 0;
  for (const int components : {1, 3}) {
    for (const bool progressive : {false, true}) {
      for (const auto& [across, down] :
           {std::pair(1, 1), std::pair(2, 1), std::pair(1, 2), std::pair(2, 2)}) {
        if (components == 1 && across * down > 1) continue;
        for (const unsigned restart_rows : {0U, 1U}) {
          for (const auto& [width, height] : {std::pair(3, 2), std::pair(67, 45), std::pair(400, 300)}) {
            SCOPED_TRACE(testing::Message()
                         << components << " components, " << across << " x " << down
                         << (progressive ? ", progressive" : "") << ", " << width << " x " << height);
            put("a.jpg",
                jpeg_file({width, height, components, progressive, across, down, restart_rows}, ++seed));
            expect_read_as_by_oiio(path("a.jpg"), false);
          }
        }
      }
    }
  }
}

// Claim: a JPEG tells its orientation; without the mark of its end it is whole; with part of its pixels, with
// inks and with ever more scans it is refused.
TEST_F(ImageFormats, JpegsSayWhatIsWrong) {
  using namespace std::string_literals;
  const std::string exif = "MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0"s;
  const std::string turned = jpeg_file({.width = 40, .height = 30, .exif = exif}, 1);
  const auto reader = open_file(put("a.jpg", turned));
  ASSERT_TRUE(reader.ok()) << reader.error().to_string();
  EXPECT_EQ((*reader)->spec().orientation, 6);
  const auto whole = read_image(path("a.jpg"));
  ASSERT_TRUE(whole.ok()) << whole.error().to_string();
  const auto without_end = read_image(put("b.jpg", turned.substr(0, turned.size() - 2)));
  ASSERT_TRUE(without_end.ok()) << without_end.error().to_string();
  EXPECT_TRUE(same_bits(without_end->rgb, whole->rgb));
  const auto half = read_image(put("c.jpg", turned.substr(0, turned.size() / 2)));
  ASSERT_FALSE(half.ok());
  EXPECT_THAT(half.error().message, testing::HasSubstr("ends too early"));

  std::string inks = turned;
  const std::size_t frame = inks.find("\xff\xc0");
  inks.replace(frame + 2, 2, "\0\x14"s);
  inks.replace(frame + 9, 1, "\x04"s);
  inks.insert(frame + 19, "\x04\x11\0"s);
  EXPECT_THAT(error_of(put("d.jpg", inks)), testing::HasSubstr("CMYK"));

  // A scan of a progressive file again and again.
  const std::string file = jpeg_file({.width = 40, .height = 30, .progressive = true}, 2);
  const std::size_t last = file.rfind("\xff\xda"), end = file.size() - 2;
  std::string scans = file.substr(0, end);
  for (int i = 0; i < 600; ++i) scans += file.substr(last, end - last);
  const auto many = read_image(put("e.jpg", scans + file.substr(end)));
  ASSERT_FALSE(many.ok());
  EXPECT_THAT(many.error().message, testing::HasSubstr("scans"));
}

// Claim: a reader tells what the head says: windows, the names of parts, primaries, orientation and texts.
TEST_F(ImageFormats, HeadsTellWhatTheySay) {
  const Imath::Box2i display({0, 0}, {9, 6}), data({2, 1}, {12, 9});
  Imf::Header depth = header_of({{"Z", Imf::FLOAT}}, display, display);
  depth.setName("depth");
  depth.setType(Imf::SCANLINEIMAGE);
  Imf::Header beauty = header_of({{"R", Imf::HALF}, {"G", Imf::HALF}, {"B", Imf::HALF}}, data, display);
  beauty.setName("beauty");
  beauty.setType(Imf::TILEDIMAGE);
  beauty.setTileDescription(Imf::TileDescription(4, 4));
  Imf::addComments(beauty, "made by hand");
  beauty.insert("Orientation", Imf::IntAttribute(6));
  for (Imf::Header* header : {&depth, &beauty})
    Imf::addChromaticities(*header, Imf::Chromaticities({.7F, .3F}, {.2F, .7F}, {.1F, .05F}, {.31F, .33F}));
  const Imf::Header headers[] = {depth, beauty};
  {
    Imf::MultiPartOutputFile file(path("parts.exr").c_str(), headers, 2);
    const test::ExrPixels first(depth, display, 1), second(beauty, data, 2);
    Imf::OutputPart scanlines(file, 0);
    scanlines.setFrameBuffer(first.buffer());
    scanlines.writePixels(7);
    Imf::TiledOutputPart tiles(file, 1);
    tiles.setFrameBuffer(second.buffer());
    tiles.writeTiles(0, tiles.numXTiles() - 1, 0, tiles.numYTiles() - 1);
  }
  const auto parts = open_file(path("parts.exr"));
  ASSERT_TRUE(parts.ok()) << parts.error().to_string();
  EXPECT_EQ((*parts)->spec().part, "depth");
  EXPECT_EQ((*parts)->spec().orientation, 1);
  ASSERT_TRUE((*parts)->seek_part(1));
  const ImageSpec& spec = (*parts)->spec();
  EXPECT_EQ(spec.part, "beauty");
  EXPECT_EQ((std::array{spec.x, spec.y, spec.width, spec.height}), (std::array{2, 1, 11, 9}));
  EXPECT_EQ((std::array{spec.display_x, spec.display_y, spec.display_width, spec.display_height}),
            (std::array{0, 0, 10, 7}));
  EXPECT_EQ(spec.orientation, 6);
  EXPECT_EQ(spec.chromaticities, (std::array{.7F, .3F, .2F, .7F, .1F, .05F, .31F, .33F}));
  EXPECT_THAT(spec.texts, testing::Contains(testing::Pair("comments", "made by hand")));
  EXPECT_FALSE((*parts)->seek_part(2));
  EXPECT_EQ((*parts)->error(), "");
  // The picture is that of the first part with colors.
  const auto image = read_image(path("parts.exr"));
  ASSERT_TRUE(image.ok()) << image.error().to_string();
  EXPECT_EQ(image->width, 11U);

  using namespace std::string_literals;
  for (const std::string& exif : {"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0"s,
                                  "II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0"s}) {
    std::string primaries;
    for (const std::uint32_t number : {31000U, 33000U, 70000U, 30000U, 20000U, 70000U, 10000U, 5000U})
      primaries += big_endian(number);
    const auto png = open_file(put("a.png", png_file(3, 2, 8, 2, false,
                                                     png_chunk("cHRM", primaries) + png_chunk("eXIf", exif) +
                                                         png_chunk("tEXt", "Title\0hello"s),
                                                     1)));
    ASSERT_TRUE(png.ok()) << png.error().to_string();
    EXPECT_EQ((*png)->spec().orientation, 6);
    EXPECT_EQ((*png)->spec().chromaticities, (std::array{.7F, .3F, .2F, .7F, .1F, .05F, .31F, .33F}));
    EXPECT_THAT((*png)->spec().texts, testing::Contains(testing::Pair("Title", "hello")));
  }
}

// Claim: channels with fewer pixels than the image, and lists of samples, are errors that say so.
TEST_F(ImageFormats, OtherLayoutsAreRefused) {
  const std::vector<Imf::Rgba> pixels(64, Imf::Rgba(0.5F, 0.25F, 1));
  {
    Imf::RgbaOutputFile file(path("yc.exr").c_str(), 8, 8, Imf::WRITE_YC);
    file.setFrameBuffer(pixels.data(), 1, 8);
    file.writePixels(8);
  }
  EXPECT_THAT(error_of(path("yc.exr")),
              testing::AllOf(testing::HasSubstr("yc.exr"), testing::HasSubstr("'BY'"),
                             testing::HasSubstr("save the image as R, G and B")));
  {
    Imf::Header header = header_of({{"R", Imf::FLOAT}, {"G", Imf::FLOAT}, {"B", Imf::FLOAT}},
                                   {{0, 0}, {7, 7}}, {{0, 0}, {7, 7}});
    header.setType(Imf::DEEPSCANLINE);
    header.compression() = Imf::ZIPS_COMPRESSION;
    Imf::DeepScanLineOutputFile file(path("deep.exr").c_str(), header);
    std::vector<unsigned> counts(64, 1);
    float value = 0.5F;
    std::vector<float*> samples(64, &value);
    Imf::DeepFrameBuffer buffer;
    buffer.insertSampleCountSlice(Imf::Slice(Imf::UINT, reinterpret_cast<char*>(counts.data()), 4, 32));
    for (const char* name : {"R", "G", "B"})
      buffer.insert(name, Imf::DeepSlice(Imf::FLOAT, reinterpret_cast<char*>(samples.data()), 8, 64, 4));
    file.setFrameBuffer(buffer);
    file.writePixels(8);
  }
  const auto deep = read_image(path("deep.exr"));
  ASSERT_FALSE(deep.ok());
  EXPECT_THAT(deep.error().message, testing::HasSubstr("not a flat picture"));
}

// Claim: a header that speaks of more chunks than the file has bytes for is refused before the library makes
// room for their table.
TEST_F(ImageFormats, TablesBeyondTheFileAreRefused) {
  for (const bool tiled : {false, true}) {
    Imf::Header header = header_of({{"R", Imf::HALF}}, {{0, 0}, {3, 3}}, {{0, 0}, {3, 3}});
    if (tiled) header.setTileDescription(Imf::TileDescription(4, 4));
    write_exr_file(path("good.exr"), header);
    std::string bytes = bytes_of(path("good.exr"));
    const std::size_t window =
        bytes.find("dataWindow") + 10 + 1 + 6 + 4;  // after the name, the type and the size
    bytes.replace(window + 8, 8, std::string("\xff\xff\xff\x0f\xff\xff\xff\x0f", 8));
    EXPECT_THAT(error_of(put("bad.exr", bytes)), testing::HasSubstr("too short for the size")) << tiled;
  }
}

// Claim: tiles of a size that only the header has are refused before room is made for a row of them.
TEST_F(ImageFormats, TilesBeyondTheImageAreRefused) {
  Imf::Header header =
      header_of({{"R", Imf::HALF}, {"G", Imf::HALF}, {"B", Imf::HALF}}, {{0, 0}, {3, 3}}, {{0, 0}, {3, 3}});
  header.setTileDescription(Imf::TileDescription(64, 64));
  write_exr_file(path("good.exr"), header);
  EXPECT_TRUE(read_image(path("good.exr")).ok());  // one tile, larger than the image
  std::string bytes = bytes_of(path("good.exr"));
  const std::size_t size = bytes.find("tiledesc") + 8 + 1 + 4;
  for (const std::string& huge :
       {std::string("\x40\0\0\0\0\0\x40\0", 8), std::string("\0\0\x40\0\x40\0\0\0", 8)}) {
    bytes.replace(size, 8, huge);
    const auto image = read_image(put("bad.exr", bytes));
    ASSERT_FALSE(image.ok());
    EXPECT_THAT(image.error().message, testing::HasSubstr("tiles are much larger"));
  }
}

// Claim: a file cut anywhere gives an error of one line that names it, or an image.
TEST_F(ImageFormats, CutFilesAreErrors) {
  Imf::Header header =
      header_of({{"R", Imf::HALF}, {"G", Imf::HALF}, {"B", Imf::HALF}}, {{0, 0}, {7, 7}}, {{0, 0}, {7, 7}});
  write_exr_file(path("lines.exr"), header);
  header.setTileDescription(Imf::TileDescription(4, 4, Imf::MIPMAP_LEVELS));
  write_exr_file(path("tiles.exr"), header);
  const std::string files[] = {bytes_of(path("lines.exr")), bytes_of(path("tiles.exr")),
                               png_file(9, 9, 8, 6, false, "", 1), png_file(9, 9, 16, 2, true, "", 2),
                               jpeg_file({.width = 90, .height = 60}, 3)};
  for (std::size_t i = 0; i < std::size(files); ++i) {
    const std::string name = i < 2 ? "cut.exr" : i < 4 ? "cut.png" : "cut.jpg";
    EXPECT_TRUE(read_image(put(name, files[i])).ok()) << i;
    std::size_t errors = 0;
    for (std::size_t size = 8; size < files[i].size(); size += 3) {
      const auto image = read_image(put(name, files[i].substr(0, size)));
      if (image.ok()) continue;
      ++errors;
      EXPECT_EQ(image.error().file, path(name));
      EXPECT_EQ(image.error().message.find('\n'), std::string::npos);
    }
    EXPECT_GT(errors, files[i].size() / 6) << i;
  }
}

// Attributes of a header, name and type, in order.
std::vector<std::string> attributes_of(const std::string& exr) {
  std::vector<std::string> attributes;
  for (std::size_t at = 8; exr[at] != 0;) {
    const std::string name = exr.c_str() + at, type = exr.c_str() + at + name.size() + 1;
    at += name.size() + 1 + type.size() + 1;
    std::uint32_t size = 0;
    std::memcpy(&size, exr.data() + at, sizeof size);
    at += sizeof size + size;
    attributes.push_back(name + " " + type);
  }
  return attributes;
}

// Claim: what we write holds the picture and its metadata and nothing else: no date, no name of a program. An
// EXR has floats under the channels' names, by zip; a PNG 8 bits of sRGB. OpenImageIO reads both as they were
// meant.
TEST_F(ImageFormats, FilesHoldThePictureAlone) {
  constexpr std::uint32_t kWidth = 21, kHeight = 70;
  std::vector<float> rgb(kWidth * kHeight * 3), depth(kWidth * kHeight);
  rng::Stream stream(7);
  for (float& value : rgb) value = stream.next_float() * 2 - 0.5F;
  for (float& value : depth) value = stream.next_float() * 100;
  const Layer layers[] = {{.name = "depth", .rgb = depth, .letters = "Z"}};
  const auto exr = encode_exr(kWidth, kHeight, rgb, {{"candela:job", "j-1"}, {"candela:plan", ""}}, layers);
  ASSERT_TRUE(exr.ok()) << exr.error().to_string();
  EXPECT_THAT(attributes_of(*exr),
              testing::ElementsAre("candela:job string", "candela:plan string", "channels chlist",
                                   "compression compression", "dataWindow box2i", "displayWindow box2i",
                                   "lineOrder lineOrder", "pixelAspectRatio float", "screenWindowCenter v2f",
                                   "screenWindowWidth float"));
  const auto judge = OIIO::ImageInput::open(put("a.exr", *exr));
  ASSERT_NE(judge, nullptr) << OIIO::geterror();
  EXPECT_EQ(judge->spec().format, OIIO::TypeDesc::FLOAT);
  EXPECT_EQ(judge->spec().get_string_attribute("compression"), "zip");
  EXPECT_THAT(judge->spec().channelnames, testing::ElementsAre("R", "G", "B", "depth.Z"));
  std::vector<float> read(kWidth * kHeight * 4);
  ASSERT_TRUE(judge->read_image(0, 0, 0, 4, OIIO::TypeDesc::FLOAT, read.data()));
  for (std::size_t i = 0; i < depth.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) ASSERT_EQ(read[4 * i + c], rgb[3 * i + c]) << i;
    ASSERT_EQ(read[4 * i + 3], depth[i]) << i;
  }

  const auto png = encode_png({kWidth, kHeight, rgb, {{"candela:job", "j-1"}}});
  ASSERT_TRUE(png.ok()) << png.error().to_string();
  std::vector<std::string> chunks;
  for (std::size_t at = 8; at + 8 <= png->size();) {
    std::uint32_t size = 0;
    for (std::size_t i = 0; i < 4; ++i) size = size << 8 | static_cast<unsigned char>((*png)[at + i]);
    chunks.push_back(png->substr(at + 4, 4));
    at += 12 + size;
  }
  EXPECT_THAT(chunks, testing::ElementsAre("IHDR", "gAMA", "sRGB", "cHRM", "IDAT", "IEND"));
  const auto shown = OIIO::ImageInput::open(put("a.png", *png));
  ASSERT_NE(shown, nullptr) << OIIO::geterror();
  EXPECT_EQ(shown->spec().format, OIIO::TypeDesc::UINT8);
  EXPECT_EQ(shown->spec().get_string_attribute("oiio:ColorSpace"), "sRGB");
}

// Claim: an image that OpenEXR codes with threads has the bytes of one that it codes alone.
TEST_F(ImageFormats, ThreadsDoNotChangeBytes) {
  constexpr std::uint32_t kWidth = 700, kHeight = 600;  // 5 MB
  std::vector<float> rgb(std::size_t{kWidth} * kHeight * 3);
  for (std::size_t i = 0; i < rgb.size(); ++i) rgb[i] = static_cast<float>(i % 1013) * 0.25F;
  const auto large = encode_exr(kWidth, kHeight, rgb, {});
  ASSERT_TRUE(large.ok());
  Imf::Header header = header_of({{"R", Imf::FLOAT}, {"G", Imf::FLOAT}, {"B", Imf::FLOAT}},
                                 {{0, 0}, {kWidth - 1, kHeight - 1}}, {{0, 0}, {kWidth - 1, kHeight - 1}});
  header.compression() = Imf::ZIP_COMPRESSION;
  {
    Imf::OutputFile file(path("alone.exr").c_str(), header, 0);
    Imf::FrameBuffer buffer;
    for (int c = 0; c < 3; ++c)
      buffer.insert(std::string(1, "RGB"[c]),
                    Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(&rgb[static_cast<std::size_t>(c)]), 12,
                               12 * kWidth));
    file.setFrameBuffer(buffer);
    file.writePixels(kHeight);
  }
  EXPECT_TRUE(bytes_of(path("alone.exr")) == *large);
  const auto back = decode_exr(*large);
  ASSERT_TRUE(back.ok());
  EXPECT_TRUE(same_bits(back->rgb, rgb));
}

}  // namespace
}  // namespace candela::image
