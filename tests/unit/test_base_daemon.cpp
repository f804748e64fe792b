// DaemonSettings: which place a server's setting comes from, and what its readers refuse.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "common/base/daemon.h"
#include "tests/temporary_folder.h"

namespace candela {
namespace {

using Scope = DaemonSettings::Scope;

class Daemon : public testing::Test {
 protected:
  void SetUp() override {
    const std::string file = (folder_.path() / "config.toml").string();
    std::ofstream(file) << "tls-key = \"shared.pem\"\n"
                           "threads = 3\n"
                           "[worker]\n"
                           "threads = 5\n"
                           "give-up = \"soon\"\n";
    ::setenv("CANDELA_CONFIG", file.c_str(), 1);
  }
  void TearDown() override {
    ::unsetenv("CANDELA_CONFIG");
    ::unsetenv("CANDELA_WORKER_THREADS");
  }
  test::TemporaryFolder folder_;
};

// Claim: the command line goes before the environment, that before the program's own section of the files,
// and that before what all programs share, which counts only for options that are shared. The origin names
// the place.
TEST_F(Daemon, ChoosesByPrecedence) {
  const auto settings = DaemonSettings::load("candela-worker", "worker");
  ASSERT_TRUE(settings.ok()) << settings.error().to_string();
  EXPECT_EQ(settings->choose("threads", "7", Scope::shared).value, "7");
  EXPECT_EQ(settings->choose("threads", "7", Scope::shared).origin, "--threads");
  EXPECT_EQ(settings->choose("threads", "", Scope::shared).value, "5");
  EXPECT_TRUE(settings->choose("threads", "", Scope::shared).origin.ends_with("config.toml:4"));
  EXPECT_EQ(settings->choose("tls-key", "", Scope::shared).value, "shared.pem");
  EXPECT_TRUE(settings->choose("tls-key", "", Scope::section).empty());
  EXPECT_EQ(settings->choose("tls-key", "", Scope::section).origin, "--tls-key");
  ::setenv("CANDELA_WORKER_THREADS", "9", 1);
  EXPECT_EQ(settings->choose("threads", "", Scope::shared).value, "9");
  EXPECT_EQ(settings->choose("threads", "", Scope::shared).origin, "$CANDELA_WORKER_THREADS");
}

// Claim: a value that cannot be read is a usage error with its place; no value leaves what was there.
TEST_F(Daemon, ReadersRefuseByPlace) {
  const auto settings = DaemonSettings::load("candela-worker", "worker");
  ASSERT_TRUE(settings.ok()) << settings.error().to_string();
  double seconds = 4;
  const auto bad = read_seconds(settings->choose("give-up", "", Scope::shared), seconds);
  ASSERT_FALSE(bad.ok());
  EXPECT_EQ(bad.error().kind, ErrorKind::usage);
  EXPECT_NE(bad.error().to_string().find("config.toml:5"), std::string::npos) << bad.error().to_string();
  EXPECT_NE(bad.error().to_string().find("'soon' is not a time"), std::string::npos);
  EXPECT_EQ(seconds, 4);
  EXPECT_TRUE(read_seconds({"", "--give-up"}, seconds).ok());
  EXPECT_EQ(seconds, 4);
  EXPECT_TRUE(read_seconds({"0", "--give-up"}, seconds).ok());
  EXPECT_EQ(seconds, 0);
  EXPECT_FALSE(read_positive_seconds({"0s", "--lease-time"}, seconds).ok());
  EXPECT_TRUE(read_positive_seconds({"2m", "--lease-time"}, seconds).ok());
  EXPECT_EQ(seconds, 120);
  std::uint64_t bytes = 1;
  EXPECT_FALSE(read_bytes({"many", "--cache-size"}, bytes).ok());
  EXPECT_TRUE(read_bytes({"2K", "--cache-size"}, bytes).ok());
  EXPECT_EQ(bytes, 2048U);
  bool flag = false;
  EXPECT_FALSE(read_flag({"yes", "insecure"}, flag).ok());
  EXPECT_TRUE(read_flag({"1", "insecure"}, flag).ok());
  EXPECT_TRUE(flag);
}

}  // namespace
}  // namespace candela
