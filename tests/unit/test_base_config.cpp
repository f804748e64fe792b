// Config: precedence of environment and files, and errors that name file and line.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include <unistd.h>

#include "common/base/config.h"

namespace candela {
namespace {

namespace fs = std::filesystem;

class ConfigTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("candela-config-" + std::to_string(::getpid()));
    fs::create_directories(folder_ / "candela");
    ::unsetenv("CANDELA_CONFIG");
    ::unsetenv("CANDELA_MASTER");
    ::unsetenv("CANDELA_WORKER_CACHE_SIZE");
    ::setenv("XDG_CONFIG_HOME", folder_.c_str(), 1);
  }
  void TearDown() override {
    fs::remove_all(folder_);
    for (const char* name :
         {"CANDELA_CONFIG", "CANDELA_MASTER", "CANDELA_WORKER_CACHE_SIZE", "XDG_CONFIG_HOME"})
      ::unsetenv(name);
  }
  std::string write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }
  fs::path folder_;
};

// Claim: without a file everything is unset, and nothing is an error.
TEST_F(ConfigTest, NoFileIsNoError) {
  const auto config = Config::load();
  ASSERT_TRUE(config.ok());
  EXPECT_FALSE(config->get("master").has_value());
  EXPECT_EQ(config->origin("master"), "");
}

// Claim: values of every scalar type arrive as text under "key" and "section.key", with file and line.
TEST_F(ConfigTest, ReadsScalarsWithTheirOrigin) {
  const std::string file = write("candela/config.toml",
                                 "master = \"farm:7070\"\n"
                                 "[worker]\n"
                                 "threads = 12\n"
                                 "insecure = true\n"
                                 "give-up = 2.5\n");
  const auto config = Config::load();
  ASSERT_TRUE(config.ok()) << config.error().to_string();
  EXPECT_EQ(config->get("master"), "farm:7070");
  EXPECT_EQ(config->get("worker.threads"), "12");
  EXPECT_EQ(config->get("worker.insecure"), "true");
  EXPECT_EQ(config->get("worker.give-up"), "2.5");
  EXPECT_EQ(config->origin("worker.threads"), file + ":3");
}

// Claim: the environment beats the file; an empty variable counts as unset; dots and dashes become
// underscores.
TEST_F(ConfigTest, EnvironmentBeatsFile) {
  write("candela/config.toml", "master = \"file:1\"\n[worker]\ncache-size = \"1G\"\n");
  ::setenv("CANDELA_MASTER", "env:2", 1);
  ::setenv("CANDELA_WORKER_CACHE_SIZE", "", 1);
  const auto config = Config::load();
  ASSERT_TRUE(config.ok());
  EXPECT_EQ(config->get("master"), "env:2");
  EXPECT_EQ(config->origin("master"), "$CANDELA_MASTER");
  EXPECT_EQ(config->get("worker.cache-size"), "1G");
  ::setenv("CANDELA_WORKER_CACHE_SIZE", "2G", 1);
  EXPECT_EQ(config->get("worker.cache-size"), "2G");
}

// Claim: $CANDELA_CONFIG replaces the usual files and must exist.
TEST_F(ConfigTest, ExplicitFileReplacesAndMustExist) {
  write("candela/config.toml", "master = \"usual:1\"\n");
  ::setenv("CANDELA_CONFIG", write("other.toml", "[client]\ntimeout = \"3s\"\n").c_str(), 1);
  const auto config = Config::load();
  ASSERT_TRUE(config.ok());
  EXPECT_FALSE(config->get("master").has_value());
  EXPECT_EQ(config->get("client.timeout"), "3s");
  ::setenv("CANDELA_CONFIG", (folder_ / "absent.toml").c_str(), 1);
  const auto absent = Config::load();
  ASSERT_FALSE(absent.ok());
  EXPECT_EQ(absent.error().exit_code(), 2);
  EXPECT_EQ(absent.error().field, "$CANDELA_CONFIG");
  EXPECT_NE(absent.error().to_string().find("absent.toml"), std::string::npos);
}

// Claim: whatever is wrong with the file of $CANDELA_CONFIG, the error names the file, the line if there is
// one, and the variable.
TEST_F(ConfigTest, ErrorsOfAnExplicitFileNameTheVariable) {
  const auto error_of = [&](const std::string& file) {
    ::setenv("CANDELA_CONFIG", file.c_str(), 1);
    const auto config = Config::load();
    return config.ok() ? std::string() : config.error().to_string();
  };
  EXPECT_EQ(error_of(folder_.string()), folder_.string() + ": $CANDELA_CONFIG: not a regular file");
  const std::string torn = write("torn.toml", "[client\n");
  EXPECT_TRUE(error_of(torn).starts_with(torn + ":1: $CANDELA_CONFIG: ")) << error_of(torn);
  const std::string list = write("list.toml", "[client]\ntimeout = [1]\n");
  EXPECT_TRUE(error_of(list).starts_with(list + ":2: $CANDELA_CONFIG: 'client.timeout' must be"))
      << error_of(list);
}

// Claim: bad TOML, values of unusable type and too deep nesting are input errors with file and line, in one
// line.
TEST_F(ConfigTest, BadFilesNameTheirLine) {
  const struct {
    const char* text;
    int line;
  } cases[] = {{"a = 1\nb = = 2\n", 2},
               {"a = [1, 2]\n", 1},
               {"[x]\ny = 1979-05-27\n", 2},
               {"[x]\n\n[x.y]\nz = 1\n", 3},
               {"master = \"a:1\"\n[master]\nlisten = 1\n", 2},
               {"a = \"unclosed\n", 1}};
  for (const auto& c : cases) {
    write("candela/config.toml", c.text);
    const auto config = Config::load();
    ASSERT_FALSE(config.ok()) << c.text;
    EXPECT_EQ(config.error().line, c.line) << c.text << config.error().to_string();
    EXPECT_EQ(config.error().kind, ErrorKind::input);
    EXPECT_EQ(config.error().to_string().find('\n'), std::string::npos);
  }
}

// Claim: a misspelt key of a program's own section is an error with line and nearest name; other sections are
// left alone.
TEST_F(ConfigTest, UnknownKeysOfASectionAreErrors) {
  const std::string file =
      write("candela/config.toml", "[master]\nx = 1\n[client]\nmaster = \"a:1\"\ntimeuot = \"3s\"\n");
  const auto config = Config::load();
  ASSERT_TRUE(config.ok());
  const auto checked = config->check_section("client", {"master", "timeout"});
  ASSERT_FALSE(checked.ok());
  EXPECT_EQ(checked.error().to_string(),
            file + ":5: unknown key 'timeuot' in [client] (did you mean 'timeout'?)");
  EXPECT_TRUE(config->check_section("worker", {"threads"}).ok());
}

// Claim: a misspelt key outside the sections, and a section of no program, are errors too; what is known is
// not.
TEST_F(ConfigTest, UnknownSharedKeysAndSectionsAreErrors) {
  const auto checked = [&](const std::string& text) {
    write("candela/config.toml", text);
    const auto config = Config::load();
    EXPECT_TRUE(config.ok());
    const auto result = config->check_shared();
    return result.ok() ? std::string() : result.error().to_string();
  };
  const std::string file = (folder_ / "candela/config.toml").string();
  EXPECT_EQ(checked("master = \"a:1\"\n[worker]\nanything = 1\n"), "");
  EXPECT_EQ(checked("# first\nmastr = \"a:1\"\n"), file + ":2: unknown key 'mastr' (did you mean 'master'?)");
  EXPECT_EQ(checked("[wroker]\nthreads = 1\n"),
            file + ":2: unknown section [wroker] (did you mean 'worker'?)");
}

}  // namespace
}  // namespace candela
