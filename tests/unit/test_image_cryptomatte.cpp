// Ids of names, and the attributes of mattes.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <utility>
#include <vector>

#include "common/image/cryptomatte.h"

namespace candela::image {
namespace {

// Claim: hashes are MurmurHash3_x86_32 with the seed 0, for tails of any length.
TEST(Cryptomatte, HashesAreMurmurs) {
  EXPECT_EQ(murmur3_32(""), 0U);
  EXPECT_EQ(murmur3_32("a"), 0x3c2569b2U);
  EXPECT_EQ(murmur3_32("ab"), 0x9bbfd75fU);
  EXPECT_EQ(murmur3_32("abc"), 0xb3dd93faU);
  EXPECT_EQ(murmur3_32("test"), 0xba6bd213U);
  EXPECT_EQ(murmur3_32("The quick brown fox jumps over the lazy dog"), 0x2e4ff723U);
}

// Claim: ids are the floats that the tests of Cryptomatte's own decoder name
// (cryptomatte_utilities_tests.py).
TEST(Cryptomatte, IdsAreThePublishedOnes) {
  const std::vector<std::pair<std::string, double>> published = {
      {"hello", 6.0705627102400005616e-17},
      {"cube", -4.08461912519e+15},
      {"sphere", 2.79018604383e+15},
      {"plane", 3.66557617593e-11},
      {"\xd1\x80\xd0\xb0\xd0\xb2\xd0\xbd\xd0\xb8\xd0\xbd\xd0\xb0", -1.3192631212399999468e-25},
      {"m\xc3\xa4"
       "dchen",
       6.2361298211599995797e+25}};
  for (const auto& [name, id] : published)
    EXPECT_EQ(std::bit_cast<float>(matte_id_bits(name)), static_cast<float>(id)) << name;
}

// Claim: every id is a normal number, and differs from its hash in one bit at most.
TEST(Cryptomatte, IdsAreNormalNumbers) {
  EXPECT_EQ(matte_id_bits(""), 1U << 23);
  int fixed = 0;
  for (int i = 0; i < 4000; ++i) {
    const std::string name = "object" + std::to_string(i);
    const std::uint32_t id = matte_id_bits(name);
    EXPECT_TRUE(std::isnormal(std::bit_cast<float>(id)));
    EXPECT_TRUE(id == murmur3_32(name) || id == (murmur3_32(name) ^ 1U << 23));
    fixed += id != murmur3_32(name) ? 1 : 0;
  }
  EXPECT_NEAR(fixed, 4000 / 128, 25);
}

// Claim: the manifest is JSON of names and ids whatever bytes the names have, and the attributes are those of
// the layer's key.
TEST(Cryptomatte, AttributesNameTheLayer) {
  const std::vector<std::string> names = {"cube", "a \"b\"\\\n",
                                          "m\xc3\xa4"
                                          "d",
                                          "\xff!"};
  std::map<std::string, std::string> attributes;
  add_matte_attributes("crypto_object", names, attributes);
  ASSERT_EQ(attributes.size(), 4U);
  const std::string key = "cryptomatte/f834d0a/";  // as in files of other renderers
  EXPECT_EQ(attributes.at(key + "name"), "crypto_object");
  EXPECT_EQ(attributes.at(key + "hash"), "MurmurHash3_32");
  EXPECT_EQ(attributes.at(key + "conversion"), "uint32_to_float32");
  const auto hex = [](const std::string& name) {
    char text[9];
    std::snprintf(text, sizeof text, "%08x", matte_id_bits(name));
    return std::string(text);
  };
  EXPECT_EQ(attributes.at(key + "manifest"),
            "{\"cube\":\"" + hex(names[0]) + "\",\"a \\\"b\\\"\\\\\\u000a\":\"" + hex(names[1]) +
                "\",\"m\xc3\xa4"
                "d\":\"" +
                hex(names[2]) + "\",\"\\ufffd!\":\"" + hex(names[3]) + "\"}");
}

}  // namespace
}  // namespace candela::image
