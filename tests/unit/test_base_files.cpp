// Reading files that are none.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include <sys/stat.h>
#include <unistd.h>

#include "common/base/files.h"

namespace candela {
namespace {

namespace fs = std::filesystem;

// Claim: a pipe without a writer, a device without an end and a folder are refused at once; nothing waits for
// them.
TEST(Files, OnlyRegularFilesAreRead) {
  const fs::path folder = fs::temp_directory_path() / ("candela-files-" + std::to_string(::getpid()));
  fs::create_directories(folder);
  const fs::path pipe = folder / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  for (const fs::path& path : {pipe, fs::path("/dev/zero"), folder}) {
    const auto whole = read_file(path, 1 << 20);
    ASSERT_FALSE(whole.ok()) << path;
    EXPECT_EQ(whole.error().message, "not a regular file");
    const auto mapped = MappedFile::open(path);
    ASSERT_FALSE(mapped.ok()) << path;
    EXPECT_EQ(mapped.error().kind, ErrorKind::input);
  }
  fs::remove_all(folder);
}

// Claim: a file that is cut short while it is open keeps its bytes and kills nobody.
TEST(Files, CutShortWhileOpen) {
  const fs::path path = fs::temp_directory_path() / ("candela-cut-" + std::to_string(::getpid()));
  std::ofstream(path) << std::string(100000, 'x');
  const auto file = MappedFile::open(path);
  ASSERT_TRUE(file.ok()) << file.error().to_string();
  fs::resize_file(path, 0);
  EXPECT_EQ((*file)->bytes(), std::string(100000, 'x'));
  fs::remove(path);
}

}  // namespace
}  // namespace candela
