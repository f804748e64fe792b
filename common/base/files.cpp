#include "common/base/files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>

#include "common/base/descriptor.h"
#include "common/base/huge_page_advice.h"
#include "common/base/links.h"

namespace candela {
namespace {

Error system_error(std::string what, const std::filesystem::path& path) {
  const int code = errno;
  const bool resource = code == ENOSPC || code == EDQUOT || code == EMFILE || code == ENFILE || code == EFBIG;
  Error error = resource ? resource_error(fmt::format("{}: {}", what, std::strerror(code)))
                         : input_error(fmt::format("{}: {}", what, std::strerror(code)));
  error.file = path.string();
  return error;
}

// Without O_NONBLOCK, to open a named pipe would wait for a writer, perhaps for ever. Reading a regular file
// does not heed the flag, and everything else is refused right after.
int open_to_read(const std::filesystem::path& path) {
  return ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
}

Result<std::uint64_t> regular_file_size(int fd, const std::filesystem::path& path) {
  struct stat info {};
  if (::fstat(fd, &info) != 0) return system_error("cannot read", path);
  if (!S_ISREG(info.st_mode)) return input_error("not a regular file").at(path.string(), 0);
  return static_cast<std::uint64_t>(info.st_size);
}

// Exactly `size` bytes, or an error.
Result<void> read_all(int fd, char* data, std::uint64_t size, const std::filesystem::path& path) {
  std::uint64_t done = 0;
  while (done < size) {
    const ssize_t n = ::read(fd, data + done, size - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return system_error("cannot read", path);
    if (n == 0) return input_error("the file was cut short while it was read").at(path.string(), 0);
    done += static_cast<std::uint64_t>(n);
  }
  return {};
}

// `size` bytes, or fewer of a file that shrinks meanwhile.
Result<std::string> read_up_to(int fd, std::uint64_t size, const std::filesystem::path& path) {
  std::string data(size, '\0');
  std::size_t done = 0;
  while (done < data.size()) {
    const ssize_t n = ::read(fd, data.data() + done, data.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return system_error("cannot read", path);
    if (n == 0) break;
    done += static_cast<std::size_t>(n);
  }
  data.resize(done);
  return data;
}

}  // namespace

Result<std::string> read_file(const std::filesystem::path& path, std::uint64_t limit_bytes) {
  const Descriptor fd(open_to_read(path));
  if (fd.get() < 0) return system_error("cannot open", path);
  CANDELA_ASSIGN(const std::uint64_t size, regular_file_size(fd.get(), path));
  if (size > limit_bytes)
    return input_error(fmt::format("the file has {} bytes, more than the limit of {}", size, limit_bytes))
        .at(path.string(), 0);
  return read_up_to(fd.get(), size, path);
}

Result<std::string> read_start(const std::filesystem::path& path, std::size_t count) {
  const Descriptor fd(open_to_read(path));
  if (fd.get() < 0) return system_error("cannot open", path);
  CANDELA_ASSIGN(const std::uint64_t size, regular_file_size(fd.get(), path));
  return read_up_to(fd.get(), std::min<std::uint64_t>(size, count), path);
}

Result<void> check_readable_file(const std::filesystem::path& path) {
  const Descriptor fd(open_to_read(path));
  if (fd.get() < 0) return system_error("cannot open", path);
  CANDELA_TRY(regular_file_size(fd.get(), path));
  return {};
}

Result<std::uint64_t> read_in_parts(const std::filesystem::path& path,
                                    const std::function<Result<void>(std::string_view)>& visit) {
  constexpr std::uint64_t kPart = std::uint64_t{256} << 10;  // stays in the processor's cache
  const Descriptor fd(open_to_read(path));
  if (fd.get() < 0) return system_error("cannot open", path);
  CANDELA_ASSIGN(const std::uint64_t size, regular_file_size(fd.get(), path));
  const auto buffer = std::make_unique_for_overwrite<char[]>(std::min(size, kPart));
  for (std::uint64_t done = 0; done < size;) {
    const std::uint64_t part = std::min(size - done, kPart);
    CANDELA_TRY(read_all(fd.get(), buffer.get(), part, path));
    CANDELA_TRY(visit({buffer.get(), part}));
    done += part;
  }
  return size;
}

Result<void> write_file_atomically(const std::filesystem::path& path, std::string_view data) {
  static std::atomic<unsigned> serial{0};  // names only; no result depends on it
  // A rename would put a file in the place of a device or a pipe.
  struct stat info {};
  if (::stat(path.c_str(), &info) == 0 && !S_ISREG(info.st_mode))
    return input_error("cannot write: this is not a regular file").at(path.string(), 0);
  CANDELA_ASSIGN(const std::filesystem::path target, follow_links(path));
  const std::filesystem::path folder = target.has_parent_path() ? target.parent_path() : ".";
  const std::filesystem::path temporary =
      folder / fmt::format(".{}.{}.{}.partial", target.filename().string(), ::getpid(), serial++);
  {
    Descriptor fd(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
    if (fd.get() < 0) return system_error("cannot write", path);
    const auto abandon = [&](Error error) {
      ::unlink(temporary.c_str());
      return error;
    };
    std::size_t done = 0;
    while (done < data.size()) {
      const ssize_t n = ::write(fd.get(), data.data() + done, data.size() - done);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) return abandon(system_error("cannot write", path));
      done += static_cast<std::size_t>(n);
    }
    if (::fsync(fd.get()) != 0) return abandon(system_error("cannot write", path));
    if (::close(fd.release()) != 0) return abandon(system_error("cannot write", path));
  }
  if (::rename(temporary.c_str(), target.c_str()) != 0) {
    Error error = system_error("cannot write", path);
    ::unlink(temporary.c_str());
    return error;
  }
  const Descriptor directory(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (directory.get() >= 0) ::fsync(directory.get());
  return {};
}

Result<void> make_directories(const std::filesystem::path& path) {
  std::error_code code;
  std::filesystem::create_directories(path, code);
  if (code)
    return input_error(fmt::format("cannot create the folder: {}", code.message())).at(path.string(), 0);
  return {};
}

Result<std::shared_ptr<const MappedFile>> MappedFile::open(const std::filesystem::path& path) {
  const Descriptor fd(open_to_read(path));
  if (fd.get() < 0) return system_error("cannot open", path);
  CANDELA_ASSIGN(const std::uint64_t size, regular_file_size(fd.get(), path));
  auto file = std::shared_ptr<MappedFile>(new MappedFile);
  if (size > 0 && size <= kSmallBytes) {
    file->small_ = std::make_unique_for_overwrite<char[]>(size);
    CANDELA_TRY(read_all(fd.get(), file->small_.get(), size, path));
    file->data_ = file->small_.get();
    file->size_ = size;
  } else if (size > 0) {
    const bool copied = size <= kCopiedBytes;
    void* data = copied ? ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0)
                        : ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, fd.get(), 0);
    if (data == MAP_FAILED) return system_error("cannot map", path);
    file->data_ = static_cast<const char*>(data);
    file->size_ = size;
    if (copied) advise_huge_pages(data, size);
    if (copied) CANDELA_TRY(read_all(fd.get(), static_cast<char*>(data), size, path));
  }
  return std::shared_ptr<const MappedFile>(std::move(file));
}

MappedFile::~MappedFile() {
  if (data_ != nullptr && !small_) ::munmap(const_cast<char*>(data_), size_);
}

}  // namespace candela
