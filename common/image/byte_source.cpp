#include "common/image/byte_source.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <string>
#include <system_error>

namespace candela::image {
namespace {

bool contains(std::uint64_t size, std::uint64_t at, std::size_t count) {
  return at <= size && count <= size - at;
}

class MemorySource final : public ByteSource {
 public:
  explicit MemorySource(std::string_view bytes) : bytes_(bytes) {}
  std::uint64_t size() const override { return bytes_.size(); }
  bool read(std::uint64_t at, std::size_t count, void* out) override {
    if (!contains(bytes_.size(), at, count)) return false;
    if (count > 0) std::memcpy(out, bytes_.data() + at, count);
    return true;
  }

 private:
  std::string_view bytes_;
};

class FileSource final : public ByteSource {
 public:
  FileSource(int file, std::uint64_t size) : file_(file), size_(size) {}
  ~FileSource() override { ::close(file_); }
  std::uint64_t size() const override { return size_; }
  bool read(std::uint64_t at, std::size_t count, void* out) override {
    if (!contains(size_, at, count)) return false;
    if (count >= buffer_.size()) return read_file(at, count, static_cast<char*>(out));
    if (at < buffered_at_ || at + count > buffered_at_ + buffered_) {
      buffered_ = 0;
      const auto fill = static_cast<std::size_t>(std::min<std::uint64_t>(buffer_.size(), size_ - at));
      if (!read_file(at, fill, buffer_.data())) return false;
      buffered_at_ = at;
      buffered_ = fill;
    }
    std::memcpy(out, buffer_.data() + (at - buffered_at_), count);
    return true;
  }

 private:
  bool read_file(std::uint64_t at, std::size_t count, char* out) {
    while (count > 0) {
      const ssize_t got = ::pread(file_, out, count, static_cast<off_t>(at));
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) return false;
      out += got;
      at += static_cast<std::uint64_t>(got);
      count -= static_cast<std::size_t>(got);
    }
    return true;
  }

  int file_;
  std::uint64_t size_;
  std::array<char, 1 << 16> buffer_{};  // readers of headers ask for single bytes
  std::uint64_t buffered_at_ = 0;
  std::size_t buffered_ = 0;
};

}  // namespace

std::unique_ptr<ByteSource> memory_source(std::string_view bytes) {
  return std::make_unique<MemorySource>(bytes);
}

Result<std::unique_ptr<ByteSource>> file_source(const std::filesystem::path& path) {
  const std::string name = path.string();
  // Without O_NONBLOCK a named pipe would wait for a writer.
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) {
    if (errno == ENOENT)
      return input_error("there is no such image file").at(name, 0).with_mend("check the name");
    return input_error("cannot open: " + std::generic_category().message(errno)).at(name, 0);
  }
  struct stat status {};
  if (::fstat(file, &status) != 0 || !S_ISREG(status.st_mode)) {
    ::close(file);
    return input_error("this is not a file").at(name, 0);
  }
  return std::unique_ptr<ByteSource>(
      std::make_unique<FileSource>(file, static_cast<std::uint64_t>(status.st_size)));
}

}  // namespace candela::image
