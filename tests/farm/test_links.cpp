// Slow, far and breaking networks, and names that no wire carries.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/farm/certificates.h"
#include "tests/farm/farm.h"
#include "tests/farm/slow_link.h"

namespace candela::farm {
namespace {

std::uint64_t size_of(const std::filesystem::path& file) {
  std::error_code code;
  const auto size = std::filesystem::file_size(file, code);
  return code ? 0 : size;
}

class Links : public testing::Test {
 protected:
  // A job that is done, with an image of this size.
  std::string finished_job(const std::string& size) {
    farm.start_master({"--unit-time", "0.2"});
    farm.start_worker("near", 2);
    const CommandResult result =
        farm.candela({"submit", scene_path("cornell"), "--size", size, "--iterations", "2", "--quiet"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    const std::string id = result.out.substr(0, result.out.size() - 1);
    farm.wait_for(id, v1::JOB_STATE_DONE);
    return id;
  }
  CommandResult fetch_over(const SlowLink& link, const std::string& id, const std::filesystem::path& file) {
    return farm.candela({"fetch", id, "-o", file.string(), "--master", link.address()});
  }
  Farm farm;
};

// Claim: a fetch over a link that breaks again and again goes on from the byte it has: the image is the same,
// and few bytes come twice.
TEST_F(Links, ABrokenFetchGoesOn) {
  const std::string id = finished_job("256x192");
  const auto direct = farm.folder() / "direct.exr", file = farm.folder() / "broken.exr";
  ASSERT_EQ(farm.candela({"fetch", id, "-o", direct.string()}).exit_code, 0);
  const std::uint64_t size = size_of(direct);
  const SlowLink link(farm.address(), {.bytes_per_second = 400e3, .break_after_bytes = size / 3});
  const CommandResult result = fetch_over(link, id, file);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_GE(link.breaks(), 2);
  EXPECT_LT(link.bytes_to_caller(), 2 * size);
  expect_identical(image::read_image(file).value(), image::read_image(direct).value(), "over a broken link");
}

// Claim: a fetch at 25 KB/s lives, however long it takes: longer than --timeout, and in the long form longer
// than a stream may be silent.
TEST_F(Links, ASlowFetchThatMovesLives) {
  const std::string id = finished_job(long_form() ? "448x288" : "208x128");
  const auto file = farm.folder() / "slow.exr";
  const SlowLink link(farm.address(), {.delay_seconds = 0.05, .bytes_per_second = 25e3});
  const CommandResult result =
      farm.candela({"fetch", id, "-o", file.string(), "--master", link.address(), "--timeout", "4s"});
  ASSERT_EQ(result.exit_code, 0) << result.err << " after " << result.seconds << " s";
  const std::uint64_t size = size_of(file);
  EXPECT_GT(static_cast<double>(size) / 25e3, long_form() ? 36 : 5)
      << "the image is too small to prove anything";
  EXPECT_LT(link.bytes_to_caller(), size + size / 4) << "it did not come in one go";
}

// Claim: over a slow link a scene is uploaded, a worker fetches it and delivers, and each file goes once.
TEST_F(Links, ASlowWorkerAndASlowClientWork) {
  farm.start_master({"--unit-time", "0.2"});
  const SlowLink link(farm.address(), {.delay_seconds = 0.05, .bytes_per_second = 25e3});
  const std::size_t padding = long_form() ? 1000000 : 150000;
  const auto scene = farm.folder() / "padded.xml";
  {
    std::ifstream in(scene_path("cornell"));
    std::string text{std::istreambuf_iterator<char>(in), {}};
    const std::size_t at = text.find("<scene");
    ASSERT_NE(at, std::string::npos);
    // Bytes without a meaning: a few seconds' worth, in the long form half a minute's.
    text.insert(at, "<!-- " + std::string(padding, 'x') + " -->\n");
    std::ofstream(scene) << text;
  }
  const CommandResult submitted = farm.candela({"submit", scene.string(), "--size", "48x32", "--iterations",
                                                "4", "--quiet", "--master", link.address()});
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  EXPECT_LT(link.bytes_to_target(), padding + 300000) << "the upload did not go in one go";
  const std::uint64_t before = link.bytes_to_caller();
  Process& far = farm.start_worker("far", 1, {"--master", link.address()});
  farm.wait_for(submitted.out.substr(0, submitted.out.size() - 1), v1::JOB_STATE_DONE, 200);
  EXPECT_LT(link.bytes_to_caller() - before, padding + 400000) << far.err();
}

// Claim: with TLS a client and a worker connect over a link of 1.5 s round trip time; an address that
// swallows what is sent to it is unreachable (exit 3) after the timeout.
TEST(FarLinks, TlsConnects) {
  Farm farm;
  const Certificates certificates(farm.folder().path());
  if (!certificates.made()) GTEST_SKIP() << "openssl is not installed";
  farm.start_master(certificates.options("server"));
  const SlowLink link(farm.address(), {.delay_seconds = 0.75});
  std::vector<std::string> arguments = certificates.options("client");
  arguments.insert(arguments.end(), {"--master", link.address()});
  std::vector<std::string> list = arguments;
  list.insert(list.begin(), "list");
  list.insert(list.end(), {"--timeout", "30s"});
  const CommandResult result = farm.candela(list);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  Process& worker = farm.start_worker("far", 1, arguments);
  EXPECT_TRUE(eventually(60, [&] { return worker.err().find("registered as") != std::string::npos; }))
      << worker.err();

  const SlowLink hole(farm.address(), {.delay_seconds = 1000});
  list[list.size() - 3] = hole.address();
  list.back() = "3s";
  const CommandResult lost = farm.candela(list);
  EXPECT_EQ(lost.exit_code, 3) << lost.err;
  EXPECT_LT(lost.seconds, 20);
}

// Claim: names that are not UTF-8 are refused where they are given, with one line that names the option or
// file.
TEST(BadNames, AreRefusedAtTheCommandLine) {
  Farm farm;
  farm.start_master_here();
  const auto check = [](const CommandResult& result, const std::string& word) {
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_NE(result.err.find(word), std::string::npos) << result.err;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  };
  const std::string scene = scene_path("cornell");
  check(farm.candela({"submit", scene, "--name", "\xff"}), "--name: '\\xff'");
  check(farm.candela({"submit", scene, "-D", "x=\xff"}), "--define");
  const auto odd = farm.folder() / "odd\xff.xml";
  std::filesystem::copy_file(scene, odd);
  check(farm.candela({"submit", odd.string()}), "'odd?.xml' is not the name of a file");
  const auto process = farm.start_worker("\xff\n", 1, {"--give-up", "1"}).wait(20);
  EXPECT_EQ(process.value_or(-1), 2);
}

}  // namespace
}  // namespace candela::farm
