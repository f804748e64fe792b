// Tests of `candela convert`, and of --denoise with a library that says what it was asked (fake_oidn.cpp).
#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <sstream>

#include "client/embedded/app.h"
#include "client/output.h"
#include "common/base/files.h"
#include "common/image/image.h"
#include "tests/unit/client_outcome.h"
#include "tests/unit/fake_oidn.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;

class Convert : public CommandTest {
 protected:
  std::string in_folder(const std::string& name) const { return (folder_.path() / name).string(); }

  static Outcome run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "convert");
    return run_candela(arguments);
  }
  // The code of a channel of an 8-bit picture.
  static int code_at(const std::string& file, std::size_t at) {
    const auto picture = image::read_image(file);
    EXPECT_TRUE(picture.ok()) << picture.error().to_string();
    if (!picture.ok()) return -1;
    return static_cast<int>(std::lround(255 * image::linear_to_srgb(picture->rgb.at(at))));
  }
  // As where Open Image Denoise is installed: the linker finds a library by the name of one that is loaded.
  static void install_denoiser() {
    ASSERT_NE(dlopen(test::fake_oidn(2).c_str(), RTLD_NOW | RTLD_LOCAL), nullptr) << dlerror();
  }

  void SetUp() override {
    CommandTest::SetUp();
    const std::vector<image::Layer> layers = {
        {"depth", depth_, {}, "Z"}, {"n", normal_, {}, "XYZ"}, {"albedo", albedo_, {}, "RGB"}};
    const auto bytes = image::encode_exr(2, 1, color_, {}, layers);
    ASSERT_TRUE(bytes.ok() && write_file_atomically(exr_, *bytes).ok());
  }

  const std::vector<float> color_ = {0.1F, 0.1F, 0.1F, 0.2F, 0.2F, 0.2F};
  const std::vector<float> depth_ = {2, 6}, normal_ = {0, 0, 1, -1, 0, 0};
  const std::vector<float> albedo_ = {0.01F, 0.01F, 0.01F, 0.02F, 0.02F, 0.02F};
  const std::string exr_ = in_folder("in.exr");
};

// Claim: --range gives the layer's values codes in proportion; layers other than colors have a range by
// default, which the command prints: that of their values, -1 to 1 for normals.
TEST_F(Convert, ShowsDepthAndNormals) {
  const std::string png = in_folder("o.png");
  ASSERT_EQ(run({exr_, png, "--layer", "depth", "--range", "0,8"}).err, "");
  EXPECT_EQ(code_at(png, 0), 64);
  EXPECT_EQ(code_at(png, 3), 191);
  EXPECT_EQ(run({exr_, png, "--layer", "depth"}).err, "candela: the range is 2,6\n");
  EXPECT_EQ(code_at(png, 0), 0);
  EXPECT_EQ(code_at(png, 3), 255);
  EXPECT_EQ(run({exr_, png, "--layer", "n", "--range", "auto"}).err, "candela: the range is -1,1\n");
  EXPECT_EQ(code_at(png, 0), 128);
  EXPECT_EQ(code_at(png, 2), 255);
  EXPECT_EQ(code_at(png, 3), 0);
  // An exposure asks for colors.
  ASSERT_EQ(run({exr_, png, "--layer", "n", "--exposure", "0"}).err, "");
  EXPECT_EQ(code_at(png, 0), 0);
}

// Claim: the ending of the name decides the format; each can be read again.
TEST_F(Convert, WritesThreeFormats) {
  for (const auto& [name, magic] : {std::pair<std::string, std::string>{"o.png", "\x89PNG"},
                                    {"o.jpg", "\xff\xd8\xff"},
                                    {"o.JPEG", "\xff\xd8\xff"},
                                    {"o.tif", "II*"},
                                    {"o.tiff", "II*"}}) {
    const Outcome done = run({exr_, in_folder(name)});
    EXPECT_EQ(done.code, 0) << done.err;
    EXPECT_THAT(*read_file(in_folder(name), 1 << 20), testing::StartsWith(magic)) << name;
    EXPECT_NEAR(code_at(in_folder(name), 3), 124, 2) << name;
  }
}

// Claim: options that cannot be together, or say nothing, are one line that names the option.
TEST_F(Convert, RefusesOptions) {
  const std::string png = in_folder("o.png");
  struct Case {
    std::vector<std::string> arguments;
    const char* said;
  };
  for (const Case& c : std::vector<Case>{
           {{exr_, png, "--range", "0,1", "--exposure", "1"}, "--exposure and --range exclude each other"},
           {{exr_, png, "--range", "1"}, "--range: '1' is not LOW,HIGH (give LOW,HIGH, or auto)"},
           {{exr_, png, "--range", "1,1"}, "--range: the range '1,1' is empty"},
           {{exr_, png, "--range", "0,x"}, "--range: 'x' is not a number"},
           {{exr_, png, "--quality", "90"}, "--quality: only a JPEG has a quality"},
           {{exr_, in_folder("o.jpg"), "--quality", "0"}, "--quality: '0' is not"},
           {{exr_, in_folder("o.gif")}, "the name does not end in .png, .jpg or .tif"},
           {{exr_, in_folder("o.gif"), "--denoise"}, "the name does not end in .png, .jpg or .tif, or .exr"},
           {{exr_, in_folder("o.exr")}, "an EXR is made with --denoise or --mix only"},
           {{exr_, in_folder("no/o.tif")}, "there is no folder"},
           {{exr_, png, "--layer", "depth", "--denoise"}, "--layer and --denoise exclude each other"},
           {{exr_, in_folder("o.exr"), "--range", "0,1", "--denoise"}, "--range and an EXR exclude"}}) {
    const Outcome r = run(c.arguments);
    EXPECT_EQ(r.code, 2) << c.said;
    EXPECT_THAT(r.err, testing::HasSubstr(c.said));
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
  }
  EXPECT_FALSE(fs::exists(png));
}

// Claim: where Open Image Denoise is not installed, convert, fetch, submit and render say so before anything
// is rendered or asked of a farm, and write nothing.
TEST_F(Convert, SaysThatTheDenoiserIsMissing) {
  void* const there = dlopen("libOpenImageDenoise.so.2", RTLD_NOW);
  if (there != nullptr || dlopen("libOpenImageDenoise.so.1", RTLD_NOW) != nullptr)
    GTEST_SKIP()
        << "Open Image Denoise is installed, or another test of this process has installed a stand-in";
  std::ostringstream out, err;
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"candela", "convert", exr_, in_folder("o.png"), "--denoise"},
        {"candela", "fetch", "j1", "--master", "127.0.0.1:1", "-o", in_folder("o.exr"), "--denoise"},
        {"candela", "submit", "deploy/none.xml", "--master", "127.0.0.1:1", "--wait", "--png",
         in_folder("o.png"), "--denoise"},
        {"candela", "submit", "deploy/none.{frame}.xml", "--frames", "1-2", "--master", "127.0.0.1:1",
         "--wait", "-o", in_folder("o.{frame}.exr"), "--denoise"},
        {"candela", "render", "deploy/none.xml", "-o", in_folder("o.exr"), "--denoise", "--quiet"}}) {
    err.str("");
    EXPECT_NE(run_program(command, out, err), 0);
    EXPECT_THAT(err.str(), testing::HasSubstr("Open Image Denoise is not installed")) << command[1];
  }
  EXPECT_FALSE(fs::exists(in_folder("o.png")));
  EXPECT_FALSE(fs::exists(in_folder("o.exr")));
}

// Claim: convert --denoise shows the denoised image, or writes the EXR with one layer more.
TEST_F(Convert, ShowsTheDenoisedImage) {
  install_denoiser();
  const Outcome done = run({exr_, in_folder("o.png"), "--denoise"});
  ASSERT_EQ(done.code, 0) << done.err;
  EXPECT_EQ(code_at(in_folder("o.png"), 0), std::lround(255 * image::linear_to_srgb(0.3F)));
  ASSERT_EQ(run({exr_, in_folder("o.exr"), "--denoise"}).code, 0);
  EXPECT_NEAR(image::read_layer(in_folder("o.exr"), "denoised")->rgb[3], 0.6F, 1e-6F);
  EXPECT_EQ(image::read_image(in_folder("o.exr"))->rgb, color_);
}

// Claim: --mix makes the image anew of its layers, as EXR and as picture; a fault of the mix names the image.
TEST_F(Convert, MixesLayers) {
  const std::vector<float> sum = {0.1F, 0.2F, 0.3F, 0.4F, 0.5F, 0.6F}, none(6, 0.0F);
  const std::vector<image::Layer> layers = {{"light.key", sum, {}}, {"light.off", none, {}}};
  const auto bytes = image::encode_exr(2, 1, sum, {{"candela:partition", "light.key, light.off"}}, layers);
  ASSERT_TRUE(bytes.ok() && write_file_atomically(exr_, *bytes).ok());
  const std::string mix = in_folder("mix.json"), text = R"({"layers": {"light.key": {"intensity": 0.5}}})";
  ASSERT_TRUE(write_file_atomically(mix, text).ok());
  ASSERT_EQ(run({exr_, in_folder("o.exr"), "--mix", mix}).code, 0);
  EXPECT_EQ(image::read_image(in_folder("o.exr"))->rgb[5], 0.3F);
  EXPECT_EQ(image::read_layer(in_folder("o.exr"), "light.key")->rgb, sum);
  ASSERT_EQ(run({exr_, in_folder("o.png"), "--mix", mix, "--exposure", "1"}).code, 0);
  EXPECT_EQ(code_at(in_folder("o.png"), 5), std::lround(255 * image::linear_to_srgb(0.6F)));
  const Outcome again = run({in_folder("o.exr"), in_folder("p.exr"), "--mix", mix});
  EXPECT_EQ(again.code, 2);
  EXPECT_THAT(again.err, testing::HasSubstr("o.exr: the image is a mix already"));
}

// Claim: outputs of render and fetch: the EXR keeps its image and has the layer, the PNG shows the layer. If
// the denoiser fails, the EXR of a long render is written all the same.
TEST_F(Convert, DenoisesOutputs) {
  install_denoiser();
  const auto bytes = read_file(exr_, 1 << 20);
  ImageOutput output{in_folder("o.exr"), in_folder("o.png"), *image::Denoiser::load()};
  ASSERT_TRUE(write_images(output, {*bytes}).ok());
  EXPECT_EQ(image::read_image(output.exr)->rgb, color_);
  EXPECT_NEAR(image::read_layer(output.exr, "denoised")->rgb[0], 0.3F, 1e-6F);
  EXPECT_EQ(code_at(output.png, 0), std::lround(255 * image::linear_to_srgb(0.3F)));

  const auto breaking = reinterpret_cast<void (*)(bool)>(
      dlsym(dlopen(test::fake_oidn(2).c_str(), RTLD_NOW), "fake_oidn_break"));
  fs::remove(output.exr);
  breaking(true);
  const auto failed = write_images(output, {*bytes});
  breaking(false);
  ASSERT_FALSE(failed.ok());
  EXPECT_THAT(failed.error().to_string(), testing::HasSubstr("out of memory"));
  EXPECT_EQ(*read_file(output.exr, 1 << 20), *bytes);
}

}  // namespace
}  // namespace candela::client
