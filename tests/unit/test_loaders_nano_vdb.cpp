// Claims: NanoVDB's grids of floats become dense with the values, the size and the box that the file has;
// whatever is damaged is an error.
#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>
#include <string>
#include <vector>

#include "common/rng/stream.h"
#include "worker/loaders/nano_vdb.h"

namespace candela::loaders {
namespace {

// A grid of one leaf at the origin and one lower node's tile, in a file of one segment.
class File {
 public:
  std::string name = "density";
  std::uint32_t version = 32, type = 1;
  bool zip = false;
  double voxel = 0.5;
  bool twice = false;  // the root names its tile twice
  float background = 0.25f;

  std::string bytes() const {
    const std::string grid = grid_bytes();
    std::string packed = grid;
    if (zip) {
      uLongf size = compressBound(grid.size());
      std::string out(size, '\0');
      compress(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(grid.data()),
               grid.size());
      out.resize(size);
      packed.assign(8, '\0');
      put<std::uint64_t>(packed, 0, size);
      packed += out;
    }
    std::string file = "NanoVDB0" + std::string(8, '\0');
    put<std::uint32_t>(file, 8, version << 21);
    put<std::uint16_t>(file, 12, 1);
    put<std::uint16_t>(file, 14, zip ? 1 : 0);
    std::string meta(176, '\0');
    put<std::uint64_t>(meta, 0, grid.size());
    put<std::uint64_t>(meta, 8, packed.size());
    put<std::uint32_t>(meta, 136, static_cast<std::uint32_t>(name.size() + 1));
    return file + meta + name + '\0' + packed;
  }

 private:
  template <class T>
  static void put(std::string& text, std::size_t at, T value) {
    std::memcpy(text.data() + at, &value, sizeof value);
  }
  // Voxel (x, y, z) of the leaf has x + 10 y + 100 z; the box reaches from (0, 1, 0) to (8, 3, 2), whose
  // last x is the tile of value 7 beside the leaf.
  std::string grid_bytes() const {
    constexpr std::size_t kRoot = 672 + 64, kUpper = kRoot + 64 + 2 * 32, kLower = kUpper + 8256 + 8 * 32768;
    constexpr std::size_t kLeaf = kLower + 1088 + 8 * 4096, kEnd = kLeaf + 96 + 4 * 512;
    std::string g(kEnd, '\0');
    for (std::size_t i = 0; i < 3; ++i) {
      put<double>(g, 296 + 88 + 32 * i, voxel);
      put<double>(g, 296 + 88 + 144 + 8 * i, 10.0 + static_cast<double>(i));
    }
    put<std::uint32_t>(g, 636, type);
    put<std::uint64_t>(g, 672 + 24, kRoot - 672);
    const std::int32_t box[6] = {0, 1, 0, 8, 3, 2};
    std::memcpy(g.data() + kRoot, box, sizeof box);
    put<std::uint32_t>(g, kRoot + 24, twice ? 2 : 1);
    put<float>(g, kRoot + 28, background);
    put<std::int64_t>(g, kRoot + 64 + 8, kUpper - kRoot);
    put<std::uint64_t>(g, kUpper + 32 + 4096, 1);
    put<std::int64_t>(g, kUpper + 8256, kLower - kUpper);
    put<std::uint64_t>(g, kLower + 32 + 512, 1);
    put<std::int64_t>(g, kLower + 1088, kLeaf - kLower);
    for (std::size_t i = 1; i < 4096; ++i) put<float>(g, kLower + 1088 + 8 * i, background);
    put<float>(g, kLower + 1088 + std::size_t{8} * 256, 7);
    for (std::size_t i = 0; i < 512; ++i)
      put<float>(g, kLeaf + 96 + 4 * i, static_cast<float>(i / 64 + 10 * (i / 8 % 8) + 100 * (i % 8)));
    return g;
  }
};

std::string outcome(const std::string& bytes, const std::string& grid = "density") {
  const auto read = load_nano_vdb(bytes, "a.nvdb", grid);
  return read.ok() ? "ok" : read.error().to_string();
}

TEST(NanoVdb, GridsBecomeDense) {
  for (const bool zip : {false, true}) {
    File file;
    file.zip = zip;
    ASSERT_TRUE(is_nano_vdb(file.bytes()));
    const auto grid = load_nano_vdb(file.bytes(), "a.nvdb", "density");
    ASSERT_TRUE(grid.ok()) << grid.error().to_string();
    EXPECT_EQ(grid->size, (std::array<std::uint32_t, 3>{9, 3, 3}));
    EXPECT_EQ(grid->channels, 1U);
    for (std::uint32_t z = 0; z < 3; ++z)
      for (std::uint32_t y = 0; y < 3; ++y)
        for (std::uint32_t x = 0; x < 9; ++x)
          EXPECT_EQ(grid->values[(z * 3 + y) * 9 + x],
                    x == 8 ? 7.0f : static_cast<float>(x + 10 * (y + 1) + 100 * z));
    // The outermost cells reach half a voxel beyond their indices.
    EXPECT_EQ(grid->low, Vec3(9.75f, 11.25f, 11.75f));
    EXPECT_EQ(grid->high, Vec3(14.25f, 12.75f, 13.25f));
  }
}

TEST(NanoVdb, ErrorsSayWhatToDo) {
  File file;
  EXPECT_EQ(outcome(file.bytes(), ""), "ok");
  EXPECT_EQ(outcome(file.bytes(), "temperature"),
            "a.nvdb: the NanoVDB file has no grid 'temperature' (it has 'density')");
  file.version = 29;
  EXPECT_NE(outcome(file.bytes()).find("version 29"), std::string::npos) << outcome(file.bytes());
  file = {};
  file.type = 2;
  EXPECT_NE(outcome(file.bytes()).find("does not hold floats"), std::string::npos);
  file = {};
  file.voxel = -1;
  EXPECT_NE(outcome(file.bytes()).find("mirrors"), std::string::npos);
  file = {};
  std::string blosc = file.bytes();
  blosc[14] = 2;
  EXPECT_NE(outcome(blosc).find("BLOSC"), std::string::npos);
  file = {};
  file.twice = true;
  EXPECT_NE(outcome(file.bytes()).find("two tiles"), std::string::npos);
  file = {};
  file.background = -1;
  const auto negative = load_nano_vdb(file.bytes(), "a.nvdb", "");
  ASSERT_TRUE(negative.ok());
  for (const float value : negative->values) EXPECT_GE(value, 0);
}

// Claim: a file of a kilobyte, whose root alone has a value for all, does not make a grid of gigabytes; of a
// box that its bytes can hold it does make one; a larger one than asked for is refused.
TEST(NanoVdb, SmallFilesMakeNoHugeGrids) {
  constexpr std::size_t kGrid = 16 + 176 + 8, kRoot = 672 + 64, kEnd = kRoot + 64 + 2 * 32;
  const auto bare = [&](std::int32_t side) {
    std::string bytes = File().bytes().substr(0, kGrid + kEnd);
    const auto put = [&](std::size_t at, auto value) {
      std::memcpy(bytes.data() + at, &value, sizeof value);
    };
    put(16, std::uint64_t{kEnd});
    put(16 + 8, std::uint64_t{kEnd});
    for (std::size_t i = 0; i < 3; ++i) {
      put(kGrid + kRoot + 4 * i, std::int32_t{0});
      put(kGrid + kRoot + 12 + 4 * i, side - 1);
    }
    put(kGrid + kRoot + 64 + 8, std::int64_t{0});  // no child: a tile
    return bytes;
  };
  EXPECT_EQ(outcome(bare(500)),
            "a.nvdb: the NanoVDB grid has 864 bytes, too few for the 125000000 values of the box around its "
            "active voxels");
  const auto small = load_nano_vdb(bare(20), "a.nvdb", "");
  ASSERT_TRUE(small.ok()) << small.error().to_string();
  EXPECT_EQ(small->values, std::vector<float>(8000, 0.0f));
  const auto refused = load_nano_vdb(bare(20), "a.nvdb", "", 7999);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("has more than 7999 values"), std::string::npos);
}

// Claim: whatever the bytes, the answer is a grid of the size that it tells, or one error.
TEST(NanoVdb, DamagedFilesAreErrors) {
  rng::Stream stream(rng::key(31));
  const std::string good = File().bytes();
  // Bytes that the reader looks at: not the empty tiles of the upper node.
  const std::size_t start = 16 + 176 + 8, upper = start + 672 + 64 + 128;
  std::size_t read = 0, errors = 0;
  for (int i = 0; i < 400; ++i) {
    std::string bytes = good;
    for (std::uint32_t k = 1 + stream.next_u32() % 3; k > 0; --k)
      bytes[stream.next_u32() % (i % 2 == 0 ? upper : bytes.size())] = static_cast<char>(stream.next_u32());
    if (i % 8 == 0) bytes.resize(stream.next_u32() % bytes.size());
    const auto grid = load_nano_vdb(bytes, "a.nvdb", i % 3 == 0 ? "" : "density");
    ++(grid.ok() ? read : errors);
    if (grid.ok())
      EXPECT_EQ(grid->values.size(), std::size_t{grid->size[0]} * grid->size[1] * grid->size[2]);
    else
      EXPECT_FALSE(grid.error().message.empty());
  }
  EXPECT_GT(read, 50U);
  EXPECT_GT(errors, 50U);
  for (std::size_t length = 0; length < 1000; ++length) {
    const std::string said = outcome(good.substr(0, length));
    EXPECT_NE(said, "ok");
    EXPECT_EQ(said.find("floats"), std::string::npos) << length;
  }
}

}  // namespace
}  // namespace candela::loaders
