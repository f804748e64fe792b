// Volume files, honest and hostile.
#include <gtest/gtest.h>

#include <limits>

#include "tests/unit/volume_file.h"
#include "worker/loaders/volume.h"

namespace candela::loaders {
namespace {

using test::volume_file;

// Claim: every encoding gives the values it stands for, in the order x fastest, channels together.
TEST(LoadVolume, ReadsEveryEncoding) {
  const auto floats = load_volume(volume_file({2, 1, 3}, 1, {0, 1, 2, 3, 4, 5.5f}), "v.vol");
  ASSERT_TRUE(floats.ok()) << floats.error().to_string();
  EXPECT_EQ(floats->size, (std::array<std::uint32_t, 3>{2, 1, 3}));
  EXPECT_EQ(floats->values, (std::vector<float>{0, 1, 2, 3, 4, 5.5f}));
  const auto colours = load_volume(volume_file({1, 1, 1}, 3, {1, 2, 3}, 1, {-1, 0, 0, 1, 2, 3}), "v.vol");
  ASSERT_TRUE(colours.ok());
  EXPECT_EQ(colours->channels, 3u);
  EXPECT_EQ(colours->low.x, -1);
  EXPECT_EQ(colours->high.z, 3);
  const auto bytes =
      load_volume(volume_file({3, 1, 1}, 1, {}, 3, {}, std::string("\x00\xff\x33", 3)), "v.vol");
  ASSERT_TRUE(bytes.ok());
  EXPECT_EQ(bytes->values, (std::vector<float>{0, 1, 0.2f}));
  // 1, 65504 (the largest), 2^-24 (the smallest).
  const auto halves =
      load_volume(volume_file({3, 1, 1}, 1, {}, 2, {}, std::string("\x00\x3c\xff\x7b\x01\x00", 6)), "v.vol");
  ASSERT_TRUE(halves.ok());
  EXPECT_EQ(halves->values, (std::vector<float>{1, 65504, 0x1p-24f}));
}

// Claim: negative values, as filters leave them beside dense places, become 0 and are counted.
TEST(LoadVolume, NegativeValuesBecomeZero) {
  const auto volume = load_volume(volume_file({3, 1, 1}, 1, {-1, 2, -0.25f}), "v.vol");
  ASSERT_TRUE(volume.ok()) << volume.error().to_string();
  EXPECT_EQ(volume->values, (std::vector<float>{0, 2, 0}));
  EXPECT_EQ(volume->negative_count, 2u);
  EXPECT_EQ(load_volume(volume_file({1, 1, 1}, 1, {2}), "v.vol")->negative_count, 0u);
}

// Claim: a file that is cut short, lies about its size or holds what no density can be is an error that says
// so, before any memory is taken for it.
TEST(LoadVolume, RefusesWhatIsWrong) {
  const auto message = [](const std::string& bytes) {
    const auto volume = load_volume(bytes, "v.vol");
    return volume.ok() ? std::string("no error") : volume.error().to_string();
  };
  const std::string good = volume_file({1, 1, 2}, 1, {1, 2});
  for (std::size_t size = 0; size < good.size(); ++size) EXPECT_NE(message(good.substr(0, size)), "no error");
  EXPECT_EQ(message(good), "no error");
  EXPECT_EQ(message(volume_file({1, 1, 3}, 1, {1, 2})),
            "v.vol: the volume claims 3 values, but the file holds 2");
  EXPECT_EQ(message(volume_file({2000000000, 2000000000, 2000000000}, 3, {1})),
            "v.vol: the volume has more than 2^32 cells");
  EXPECT_EQ(message(volume_file({65536, 65536, 1}, 1, {1})),
            "v.vol: the volume claims 4294967296 values, but the file holds 1");
  EXPECT_EQ(message(volume_file({-1, 1, 1}, 1, {1})), "v.vol: the volume has -1 cells along one axis");
  EXPECT_EQ(message(volume_file({1, 1, 1}, 6, {1, 1, 1, 1, 1, 1})),
            "v.vol: volumes of 6 channels are not supported (1 and 3 are)");
  EXPECT_EQ(message(volume_file({1, 1, 1}, 1, {std::numeric_limits<float>::quiet_NaN()})),
            "v.vol: value 0 of the volume is not finite");
  EXPECT_EQ(message(volume_file({1, 1, 1}, 1, {std::numeric_limits<float>::infinity()})),
            "v.vol: value 0 of the volume is not finite");
  EXPECT_EQ(message(volume_file({1, 1, 1}, 1, {1}, 7)),
            "v.vol: volume encoding 7 is unknown (there is 1: float32, 2: float16, 3: uint8)");
  EXPECT_EQ(message(volume_file({1, 1, 1}, 3, {1}, 4)), "v.vol: volumes of directions are not supported");
  std::string old = good;
  old[3] = 2;
  EXPECT_EQ(message(old), "v.vol: volume format version 2 is not supported (3 is)");
}

}  // namespace
}  // namespace candela::loaders
