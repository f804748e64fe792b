// Mattes from a scene to an EXR: channels, attributes, ranks, and the commands that read such a file.
#include <gtest/gtest.h>
#include <unistd.h>

#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "client/embedded/app.h"
#include "common/base/files.h"
#include "common/image/cryptomatte.h"
#include "common/image/exr_channels.h"
#include "common/image/image.h"
#include "tests/unit/client_outcome.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kSide = 24;

class Mattes : public testing::Test {
 protected:
  // Nine spheres in a row of a thin pixel, so that some pixels have more names than ranks, above a floor that
  // the sky ends.
  void SetUp() override {
    fs::create_directories(folder_);
    std::ofstream scene(folder_ / "scene.xml");
    scene
        << "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><transform "
           "name='to_world'><lookat origin='0,0,4' target='0,0,0' up='0,1,0'/></transform><film "
           "type='hdrfilm'>"
           "<integer name='width' value='24'/><integer name='height' value='24'/><rfilter type='box'/></film>"
           "</sensor><emitter type='constant'/><shape type='rectangle' id='floor'><transform "
           "name='to_world'><scale "
           "value='3'/><translate y='-3'/></transform></shape>";
    for (int i = 0; i < 9; ++i)
      scene << "<shape type='sphere' id='bead" << i << "'><point name='center' x='" << 0.012 * i
            << "' y='0.05' z='0.5'/><float name='radius' value='0.005'/></shape>";
    scene << "</scene>";
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string in_folder(const std::string& name) const { return (folder_ / name).string(); }
  static Outcome run(std::vector<std::string> arguments) { return run_candela(arguments); }
  void render(const std::string& integrator, const std::string& name) const {
    std::vector<std::string> words = {"render",        in_folder("scene.xml"), "--quiet", "-o",
                                      in_folder(name), "--integrator",         integrator};
    const std::vector<std::string> more =
        integrator == "pssmlt"
            ? std::vector<std::string>{"--iterations", "16", "--set", "chains=4", "--set", "bootstrap=1000"}
            : std::vector<std::string>{"--iterations", "32"};
    words.insert(words.end(), more.begin(), more.end());
    words.insert(words.end(), {"--aov", "coverage,crypto_object"});
    const Outcome done = run(words);
    ASSERT_EQ(done.code, 0) << done.err;
  }
  image::ExrChannels read(const std::string& name) const {
    const auto bytes = read_file(folder_ / name, 1 << 28);
    EXPECT_TRUE(bytes.ok());
    auto all = image::read_channels(*bytes, "");
    EXPECT_TRUE(all.ok()) << all.error().to_string();
    return std::move(*all);
  }

  const fs::path folder_ = fs::path(testing::TempDir()) / ("mattes-" + std::to_string(::getpid()));
};

// Claim: the EXR has six ranks of ids that the manifest names, the largest coverage first; with no more names
// than ranks they sum to the coverage, and what is left is the sky. So it is with chains.
TEST_F(Mattes, RanksSumToTheCoverage) {
  for (const std::string integrator : {"path", "pssmlt"}) {
    render(integrator, "out.exr");
    const image::ExrChannels all = read("out.exr");
    std::map<std::string, std::string> texts(all.spec.texts.begin(), all.spec.texts.end());
    EXPECT_EQ(texts.at("cryptomatte/3ae39a5/name"), "CryptoObject");
    EXPECT_EQ(texts.at("cryptomatte/3ae39a5/hash"), "MurmurHash3_32");
    EXPECT_EQ(texts.at("cryptomatte/3ae39a5/conversion"), "uint32_to_float32");
    const std::string& manifest = texts.at("cryptomatte/3ae39a5/manifest");
    std::map<std::uint32_t, std::string> names = {{image::matte_id_bits("floor"), "floor"}};
    for (int i = 0; i < 9; ++i)
      names[image::matte_id_bits("bead" + std::to_string(i))] = "bead" + std::to_string(i);
    for (const auto& [id, name] : names)
      EXPECT_NE(manifest.find("\"" + name + "\":\""), std::string::npos) << manifest;
    std::vector<std::size_t> at;
    for (const char* layer : {"CryptoObject00", "CryptoObject01", "CryptoObject02"})
      for (const std::size_t channel : image::channels_of_layer(all, layer, "RGBA")) at.push_back(channel);
    ASSERT_EQ(at.size(), 12U);
    const auto coverage_at = image::channels_of_layer(all, "coverage", "Y");
    ASSERT_EQ(coverage_at.size(), 1U);
    std::size_t full = 0, sky = 0, several = 0;
    for (std::size_t p = 0; p < all.pixels(); ++p) {
      const float* const pixel = &all.values[p * all.count()];
      double sum = 0;
      std::size_t ranks = 0;
      float before = 2;
      for (std::size_t rank = 0; rank < 6; ++rank) {
        const float id = pixel[at[2 * rank]], share = pixel[at[2 * rank + 1]];
        EXPECT_LE(share, before);
        before = share;
        sum += static_cast<double>(share);
        if (share == 0) {
          EXPECT_EQ(id, 0);
          continue;
        }
        ++ranks;
        EXPECT_TRUE(names.contains(std::bit_cast<std::uint32_t>(id)));
      }
      const auto coverage = static_cast<double>(pixel[coverage_at[0]]);
      if (ranks < 6) {
        EXPECT_NEAR(sum, coverage, 1e-6);
      }
      EXPECT_LE(sum, coverage + 1e-6);
      full += coverage == 1 ? 1 : 0;
      sky += coverage == 0 ? 1 : 0;
      several += ranks > 1 ? 1 : 0;
    }
    EXPECT_GT(full, kSide * kSide / 4) << integrator;
    EXPECT_GT(sky, kSide * kSide / 8) << integrator;
    EXPECT_GT(several, 0U) << integrator;
  }
}

// Claim: commands that read images take such files: a matte's preview becomes a picture, the image stays the
// first layer.
TEST_F(Mattes, OtherCommandsReadThem) {
  render("path", "out.exr");
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"convert", in_folder("out.exr"), in_folder("image.png")},
        {"convert", in_folder("out.exr"), in_folder("matte.png"), "--layer", "CryptoObject"},
        {"convert", in_folder("out.exr"), in_folder("rank.png"), "--layer", "CryptoObject00"},
        {"compare", in_folder("out.exr"), in_folder("out.exr")}}) {
    const Outcome done = run(words);
    EXPECT_EQ(done.code, 0) << words[0] << ": " << done.err;
  }
  const auto preview = image::read_layer(folder_ / "out.exr", "CryptoObject");
  ASSERT_TRUE(preview.ok());
  EXPECT_TRUE(image::read_image(folder_ / "out.exr")->metadata.contains("cryptomatte/3ae39a5/manifest"));
}

}  // namespace
}  // namespace candela::client
