// Mixes of layers: their files, what they make of an image, and files and images that are refused.
#include "common/image/mix.h"

#include <gtest/gtest.h>

#include <fstream>
#include <limits>
#include <map>

#include "common/image/exr_channels.h"
#include "common/image/image.h"
#include "tests/temporary_folder.h"

namespace candela::image {
namespace {

// An image of two pixels: the sum of two light groups; with layers that are no part of the sum.
class MixTest : public testing::Test {
 protected:
  std::string exr(std::map<std::string, std::string> texts) const {
    const std::vector<Layer> layers = {{"light.key", key_, {}},
                                       {"light.fill", fill_, {}},
                                       {"caustics", caustics_, {}},
                                       {"error", error_, {}}};
    std::vector<float> sum;
    for (std::size_t i = 0; i < key_.size(); ++i) sum.push_back(key_[i] + fill_[i]);
    const auto bytes = encode_exr(2, 1, sum, texts, layers);
    EXPECT_TRUE(bytes.ok());
    return *bytes;
  }
  std::string mixed_error(const std::string& exr_bytes, const std::string& mix) const {
    const auto parsed = parse_mix(mix);
    if (!parsed) return parsed.error().to_string();
    const auto out = mix_exr(exr_bytes, *parsed);
    return out.ok() ? "none" : out.error().to_string();
  }

  const std::vector<float> key_ = {1, 2, 3, 0.1F, 0, 0}, fill_ = {0.5F, 0.25F, 0.125F, 0.3F, 0.7F, 0};
  const std::vector<float> caustics_ = {1, 1, 1, 0, 0, 0}, error_ = {9, 9, 9, 9, 9, 9};
  const std::map<std::string, std::string> texts_ = {{"candela:partition", "light.key, light.fill"},
                                                     {"candela:relmse_estimate", "0.1"},
                                                     {"candela:relmse_upper", "0.2"},
                                                     {"candela:seed", "7"},
                                                     {"candela:reproduce", "candela render ..."}};
};

// Claim: the image is the weighted sum of its layers, in linear light; layers that the mix does not name stay
// as they are; the file keeps its layers, says that it is a mix, and claims no error of the image before it.
TEST_F(MixTest, IsTheWeightedSum) {
  const auto mix = parse_mix(R"({"layers": {"light.key": {"intensity": 2, "tint": [1, 0.5, 0]}}})");
  ASSERT_TRUE(mix.ok()) << mix.error().to_string();
  const auto out = mix_exr(exr(texts_), *mix);
  ASSERT_TRUE(out.ok()) << out.error().to_string();
  const auto image = decode_exr(out->bytes);
  ASSERT_TRUE(image.ok());
  const std::vector<double> factor = {2, 1, 0};
  for (std::size_t i = 0; i < key_.size(); ++i)
    EXPECT_EQ(image->rgb[i], static_cast<float>(factor[i % 3] * double{key_[i]} + double{fill_[i]})) << i;
  EXPECT_EQ(out->left_out, std::vector<std::string>{"error"});
  const auto all = read_channels(out->bytes, "");
  ASSERT_TRUE(all.ok());
  EXPECT_EQ(layer_values(*all, "light.key", "RGB"), key_);
  EXPECT_TRUE(layer_values(*all, "error", "RGB").empty());
  EXPECT_EQ(image->metadata.count("candela:relmse_estimate") + image->metadata.count("candela:relmse_upper"),
            0U);
  EXPECT_EQ(image->metadata.at("candela:seed"), "7");
  EXPECT_EQ(image->metadata.at(kMixAttribute), text_of(*mix));
  EXPECT_NE(mixed_error(out->bytes, R"({"layers": {}})").find("the image is a mix already"),
            std::string::npos);
}

// Claim: a light that is off leaves no trace, however bright it was; a mix of ones is the image, bit by bit.
TEST_F(MixTest, OffIsBlackAndOnesAreTheImage) {
  const std::vector<float> bright(6, 1e7F), dim(6, 1e-7F), sum(6, 1e7F);
  const std::vector<Layer> layers = {{"light.sun", bright, {}}, {"light.led", dim, {}}};
  const auto bytes = encode_exr(2, 1, sum, {{kPartitionAttribute, "light.sun, light.led"}}, layers);
  ASSERT_TRUE(bytes.ok());
  const auto off = mix_exr(*bytes, *parse_mix(R"({"layers": {"light.sun": {"intensity": 0}}})"));
  ASSERT_TRUE(off.ok()) << off.error().to_string();
  EXPECT_EQ(decode_exr(off->bytes)->rgb, dim);
  const auto ones = mix_exr(*bytes, *parse_mix(R"({"layers": {"light.led": {"tint": [1, 1, 1]}}})"));
  ASSERT_TRUE(ones.ok());
  EXPECT_EQ(decode_exr(ones->bytes)->rgb, sum);
}

// Claim: the text that a mix is written as is read as the same mix.
TEST(MixFile, IsReadAsItWasWritten) {
  const Mix mix{{{"light.key", 0.1, {1, 0.3333333333333333, 0}}, {"rim", 0, {1, 1, 1}}, {"fill"}}};
  const auto read = parse_mix(text_of(mix));
  ASSERT_TRUE(read.ok()) << read.error().to_string();
  EXPECT_EQ(*read, mix);
}

// Claim: each fault of a file is one line that names the key, and nothing is read.
TEST(MixFile, FaultsNameTheKey) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "it is no JSON at line 1"},
      {"{\n\"layers\": {,}}", "it is no JSON at line 2"},
      {"[]", "the mix is no object"},
      {"{}", "layers: it is missing"},
      {R"({"layer": {}})", "layer: this key is not known (did you mean 'layers'?)"},
      {R"({"layers": []})", "layers: it is no object"},
      {R"({"layers": {"a": 2}})", "layers.a: it is no object"},
      {R"({"layers": {"a": {"intensty": 2}}})",
       "layers.a.intensty: this key is not known (did you mean 'intensity'?)"},
      {R"({"layers": {"a": {"intensity": -1}}})", "layers.a.intensity: -1 is below 0"},
      {R"({"layers": {"a": {"intensity": 1e300}}})", "layers.a.intensity: 1e+300 is beyond 1000000"},
      {R"({"layers": {"a": {"intensity": 1e999}}})", "a number is too large"},
      {R"({"layers": {"a": {"intensity": null}}})", "layers.a.intensity: it is no number"},
      {R"({"layers": {"a": {"tint": [1, 1]}}})", "layers.a.tint: it is no list of 3 numbers"},
      {R"({"layers": {"a": {"tint": [1, -1, 1]}}})", "layers.a.tint[1]: -1 is below 0"},
      {R"({"layers": {"a": {}, "a": {}}})", "the key 'a' is given twice"},
      {R"({"layers": {"error": {}}})", "layers.error: no layer has this name"},
      {R"({"layers": {"\u001b[2J": {}}})", "no layer has this name"},
      {R"({"layers": {"a": {"tint": [[[[1]]]]}}})", "it nests deeper"},
      {std::string(kMaxMixBytes + 1, ' '), "more than 65536"},
      {"{\"layers\": {\"\xff\": {}}}", "no UTF-8"},
  };
  for (const auto& [text, wanted] : cases) {
    const auto mix = parse_mix(text);
    ASSERT_FALSE(mix.ok()) << text;
    const std::string said = mix.error().to_string();
    EXPECT_NE(said.find(wanted), std::string::npos) << text << ": " << said;
    EXPECT_EQ(said.find_first_of("\n\x1b"), std::string::npos) << said;
  }
  const test::TemporaryFolder folder;
  const auto absent = read_mix(folder.path() / "none.json");
  ASSERT_FALSE(absent.ok());
  EXPECT_NE(absent.error().to_string().find("none.json"), std::string::npos);
}

// Claim: images are refused whose layers do not add up to them, by what they say or by what they are, and
// mixes that name another layer; the error says which layers there are.
TEST_F(MixTest, ImagesWithoutAPartitionAreRefused) {
  const std::string key = R"({"layers": {"light.key": {}}})";
  EXPECT_EQ(mixed_error(exr(texts_), key), "none");
  std::map<std::string, std::string> texts = texts_;
  texts.erase("candela:partition");
  EXPECT_NE(mixed_error(exr(texts), key).find("no layers that add up to it"), std::string::npos);
  texts["candela:partition"] = "light.key";
  EXPECT_NE(mixed_error(exr(texts), key).find("the layers do not add up to the image: at pixel (1, 0)"),
            std::string::npos);
  texts["candela:partition"] = "light.key, light.gone";
  EXPECT_NE(mixed_error(exr(texts), key).find("lacks its layer 'light.gone'"), std::string::npos);
  EXPECT_EQ(mixed_error(exr(texts_), R"({"layers": {"light.kye": {}}})"),
            "layers.light.kye: the image has no such layer (did you mean 'light.key'?)");
  EXPECT_EQ(
      mixed_error(exr(texts_), R"({"layers": {"caustics": {"intensity": 2}}})"),
      "layers.caustics: this layer is none of those that add up to the image (layers that can be mixed: "
      "light.key, light.fill)");
  const std::string whole = exr(texts_);
  EXPECT_NE(mixed_error(whole.substr(0, whole.size() / 2), key), "none");
  EXPECT_NE(mixed_error("no image", key), "none");
  const std::vector<float> image = {1, 1, std::numeric_limits<float>::quiet_NaN()}, one = {1, 1, 1};
  EXPECT_FALSE(check_sum(1, image, std::vector<std::span<const float>>{one}).ok());
  EXPECT_TRUE(check_sum(1, one, std::vector<std::span<const float>>{one}).ok());
}

}  // namespace
}  // namespace candela::image
