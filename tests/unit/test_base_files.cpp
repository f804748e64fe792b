// Reading files that are none.
#include <gtest/gtest.h>

#include <filesystem>
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

}  // namespace
}  // namespace candela
