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

template <class T>
std::string error_of(const Result<T>& result) {
  return result.ok() ? "no error" : result.error().message;
}

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
    EXPECT_EQ(error_of(check_readable_file(path)), "not a regular file");
    EXPECT_EQ(error_of(read_start(path, 10)), "not a regular file");
    EXPECT_EQ(error_of(read_in_parts(path, [](std::string_view) { return Result<void>(); })),
              "not a regular file");
  }
  fs::remove_all(folder);
}

// Claim: a file's parts joined are the file, whatever its size beside that of a part; its start is as long as
// asked for or as the file; the first error of a visit ends the reading.
TEST(Files, PartsAndStarts) {
  const fs::path path = fs::temp_directory_path() / ("candela-parts-" + std::to_string(::getpid()));
  for (const std::size_t size : {0U, 1U, 262143U, 262144U, 262145U, 700000U}) {
    std::string bytes(size, ' ');
    for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<char>('a' + i * 7919 % 26);
    std::ofstream(path, std::ios::binary) << bytes;
    std::string joined;
    const auto read = read_in_parts(path, [&](std::string_view part) -> Result<void> {
      joined += part;
      return {};
    });
    ASSERT_TRUE(read.ok()) << read.error().to_string();
    EXPECT_EQ(*read, size);
    EXPECT_TRUE(joined == bytes) << size;
    EXPECT_EQ(*read_start(path, 5), bytes.substr(0, 5)) << size;
    EXPECT_TRUE(*read_start(path, size + 5) == bytes) << size;
  }
  int visits = 0;
  EXPECT_EQ(error_of(read_in_parts(path,
                                   [&](std::string_view) -> Result<void> {
                                     ++visits;
                                     return input_error("enough");
                                   })),
            "enough");
  EXPECT_EQ(visits, 1);
  fs::remove(path);
  EXPECT_FALSE(check_readable_file(path).ok());
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

// Claim: a write through a symbolic link replaces its target and keeps the link; links that lead back to
// themselves, devices and pipes are an error and stay as they are.
TEST(Files, LinksAreWrittenThrough) {
  const fs::path folder = fs::temp_directory_path() / ("candela-links-" + std::to_string(::getpid()));
  fs::create_directories(folder / "far");
  std::ofstream(folder / "far/a") << "old";
  fs::create_symlink("far/a", folder / "link");
  fs::create_symlink(folder / "far/b", folder / "dangling");
  fs::create_symlink("loop", folder / "loop");
  fs::create_symlink("pipe", folder / "to-pipe");
  const fs::path pipe = folder / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);

  for (const auto& [link, target] : {std::pair("link", "a"), std::pair("dangling", "b")}) {
    const auto written = write_file_atomically(folder / link, "new");
    ASSERT_TRUE(written.ok()) << written.error().to_string();
    EXPECT_TRUE(fs::is_symlink(folder / link));
    EXPECT_FALSE(fs::is_symlink(folder / "far" / target));
    EXPECT_EQ(read_file(folder / link, 100).value(), "new");
  }
  const auto loop = write_file_atomically(folder / "loop", "new");
  ASSERT_FALSE(loop.ok());
  EXPECT_EQ(loop.error().message, "the symbolic link leads back to itself");
  EXPECT_EQ(loop.error().file, (folder / "loop").string());
  for (const char* name : {"pipe", "to-pipe", "far"}) {
    const auto written = write_file_atomically(folder / name, "new");
    ASSERT_FALSE(written.ok()) << name;
    EXPECT_EQ(written.error().message, "cannot write: this is not a regular file");
  }
  EXPECT_TRUE(fs::is_fifo(pipe));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder / "far"), fs::directory_iterator()), 2);
  fs::remove_all(folder);
}

}  // namespace
}  // namespace candela
