#include "master/store/blob_store.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>

#include "common/base/files.h"
#include "common/base/log.h"
#include "common/job/job.h"

namespace candela::master {
namespace {

constexpr std::uint64_t kReserveBytes = 64ULL << 20;  // of free disk left for checkpoints and the store

double steady_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Error blob_disk_error(std::string_view what, const std::filesystem::path& path) {
  const int code = errno;
  Error e = resource_error(fmt::format("{}: {}", what, std::strerror(code)));
  e.file = path.string();
  if (code == ENOSPC || code == EDQUOT || code == EFBIG) e.mend = "free space on the master's disk";
  return e;
}

}  // namespace

Result<std::unique_ptr<BlobStore>> BlobStore::open(const std::filesystem::path& folder) {
  auto store = std::unique_ptr<BlobStore>(new BlobStore);
  store->folder_ = folder;
  std::error_code code;
  std::filesystem::remove_all(folder / "tmp", code);
  CANDELA_TRY(make_directories(folder / "tmp"));
  return store;
}

std::filesystem::path BlobStore::path(const std::string& sha256) const {
  return folder_ / sha256.substr(0, 2) / sha256;
}

std::optional<std::uint64_t> BlobStore::size(const std::string& sha256) const {
  std::error_code code;
  const std::uint64_t bytes = std::filesystem::file_size(path(sha256), code);
  if (code) return std::nullopt;
  return bytes;
}

Result<std::unique_ptr<BlobStore::Reader>> BlobStore::read(const std::string& sha256) {
  auto reader = std::unique_ptr<Reader>(new Reader(*this));
  reader->sha256_ = sha256;
  reader->fd_ = ::open(path(sha256).c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (reader->fd_ < 0 && errno == ENOENT) return std::unique_ptr<Reader>();
  struct stat info {};
  if (reader->fd_ < 0 || ::fstat(reader->fd_, &info) != 0)
    return blob_disk_error("cannot read a blob", path(sha256));
  reader->size_ = static_cast<std::uint64_t>(info.st_size);
  return reader;
}

BlobStore::Reader::~Reader() {
  if (fd_ >= 0) ::close(fd_);
}

Error BlobStore::Reader::damaged(const std::string& why) {
  store_.set_aside(sha256_, fd_);
  return failed_error(fmt::format("blob {} is damaged: {}", sha256_, why))
      .at(store_.path(sha256_).string(), 0);
}

Result<void> BlobStore::Reader::next(std::size_t most_bytes, std::string& out) {
  out.resize(static_cast<std::size_t>(std::min<std::uint64_t>(most_bytes, size_ - read_)));
  std::size_t have = 0;
  while (have < out.size()) {
    const ssize_t n = ::read(fd_, out.data() + have, out.size() - have);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && errno == EIO) return damaged("the disk cannot read it");
    if (n < 0) return blob_disk_error("cannot read a blob", store_.path(sha256_));
    if (n == 0) return damaged("it became shorter while it was read");
    have += static_cast<std::size_t>(n);
  }
  hash_.update(out);
  read_ += out.size();
  if (read_ == size_ && !checked_) {
    checked_ = true;
    const std::string actual = hash_.finish_hex();
    if (actual != sha256_) return damaged(fmt::format("its bytes have the hash {}", actual));
  }
  return {};
}

Result<bool> BlobStore::check(const std::string& sha256) {
  use(sha256);
  CANDELA_ASSIGN(const std::unique_ptr<Reader> reader, read(sha256));
  if (!reader) return false;
  std::string bytes;
  do {
    if (auto more = reader->next(1 << 20, bytes); !more.ok()) {
      if (more.error().kind == ErrorKind::failed) return false;
      return std::move(more).error();
    }
  } while (!bytes.empty());
  return true;
}

void BlobStore::use(const std::string& sha256) {
  const Lock lock(names_mutex_);
  used_[sha256] = steady_seconds();
}

Result<BlobStore::Collected> BlobStore::collect(const std::set<std::string>& needed, double grace_seconds) {
  namespace fs = std::filesystem;
  Collected out;
  {
    const Lock lock(names_mutex_);
    const double now = steady_seconds();
    std::erase_if(used_, [&](const auto& entry) { return now - entry.second >= grace_seconds; });
  }
  const auto oldest =
      fs::file_time_type::clock::now() - std::chrono::milliseconds(std::llround(grace_seconds * 1000));
  std::error_code code;
  for (fs::directory_iterator folder(folder_, code), end; !code && folder != end; folder.increment(code)) {
    if (folder->path().filename().string().size() != 2) continue;  // tmp, damaged
    for (fs::directory_iterator it(folder->path(), code), last; !code && it != last; it.increment(code)) {
      const fs::directory_entry& file = *it;
      const std::string sha256 = file.path().filename().string();
      if (!is_sha256_hex(sha256)) continue;
      std::error_code gone;
      const std::uint64_t bytes = file.file_size(gone);
      if (gone) continue;
      const Lock lock(names_mutex_);
      const auto written = file.last_write_time(gone);
      if (needed.contains(sha256) || used_.contains(sha256) || gone || written > oldest) {
        ++out.kept;
        out.kept_bytes += bytes;
      } else if (::unlink(file.path().c_str()) == 0) {
        ++out.removed;
        out.removed_bytes += bytes;
      } else {
        return blob_disk_error("cannot remove a blob", file.path());
      }
    }
  }
  if (code)
    return resource_error(fmt::format("cannot list the blobs: {}", code.message())).at(folder_.string(), 0);
  return out;
}

// Moves the file away that was read, if it still bears the blob's name: it may have been uploaded again
// since.
void BlobStore::set_aside(const std::string& sha256, int fd) {
  const Lock lock(names_mutex_);
  struct stat read {
  }, named{};
  if (::fstat(fd, &read) != 0 || ::stat(path(sha256).c_str(), &named) != 0) return;
  if (read.st_dev != named.st_dev || read.st_ino != named.st_ino) return;
  std::error_code code;
  std::filesystem::create_directories(folder_ / "damaged", code);
  std::filesystem::path to = folder_ / "damaged" / sha256;
  for (int i = 1; std::filesystem::exists(to, code); ++i)
    to = folder_ / "damaged" / fmt::format("{}.{}", sha256, i);
  if (::rename(path(sha256).c_str(), to.c_str()) != 0)
    log::error(fmt::format("the damaged blob {} cannot be set aside: {}", path(sha256).string(),
                           std::strerror(errno)));
}

Result<std::unique_ptr<BlobStore::Upload>> BlobStore::begin(const std::string& sha256,
                                                            std::uint64_t size_bytes) {
  if (!is_sha256_hex(sha256)) return input_error("must be 64 lower-case hex digits").with_field("sha256");
  if (size_bytes > Limits::max_blob_bytes)
    return input_error(
               fmt::format("{} bytes are more than the limit of {}", size_bytes, Limits::max_blob_bytes))
        .with_field("size_bytes");
  struct statvfs info {};
  if (::statvfs(folder_.c_str(), &info) != 0) return blob_disk_error("cannot ask for free space", folder_);
  const std::uint64_t free_bytes = static_cast<std::uint64_t>(info.f_bavail) * info.f_frsize;
  if (free_bytes < size_bytes + std::min(kReserveBytes, size_bytes))
    return resource_error(fmt::format("a blob of {} bytes does not fit: the master's disk has {} free",
                                      size_bytes, free_bytes))
        .at(folder_.string(), 0)
        .with_mend("free space on the master's disk");
  use(sha256);
  auto upload = std::unique_ptr<Upload>(new Upload(*this));
  upload->sha256_ = sha256;
  upload->size_ = size_bytes;
  upload->final_ = path(sha256);
  upload->temporary_ = folder_ / "tmp" / fmt::format("{}.{}", sha256.substr(0, 16), serial_++);
  CANDELA_TRY(make_directories(upload->final_.parent_path()));
  upload->fd_ = ::open(upload->temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (upload->fd_ < 0) return blob_disk_error("cannot store a blob", upload->temporary_);
  return upload;
}

Result<void> BlobStore::take(const std::string& sha256, std::uint64_t size_bytes,
                             const std::filesystem::path& file) {
  CANDELA_ASSIGN(const std::unique_ptr<Upload> upload, begin(sha256, size_bytes));
  if (size(sha256) == size_bytes) return {};
  CANDELA_TRY(read_in_parts(file, [&](std::string_view part) { return upload->append(part); }));
  return upload->finish();
}

BlobStore::Upload::~Upload() {
  if (fd_ < 0) return;
  ::close(fd_);
  ::unlink(temporary_.c_str());
}

Result<void> BlobStore::Upload::append(std::string_view data) {
  if (data.size() > size_ - received_)
    return failed_error(fmt::format("blob {} is longer than the {} bytes announced", sha256_, size_))
        .with_field("data");
  received_ += data.size();
  hash_.update(data);
  while (!data.empty()) {
    const ssize_t n = ::write(fd_, data.data(), data.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return blob_disk_error("cannot store a blob", temporary_);
    data.remove_prefix(static_cast<std::size_t>(n));
  }
  return {};
}

Result<void> BlobStore::Upload::finish() {
  if (received_ != size_)
    return failed_error(fmt::format("blob {} has {} bytes, {} were announced", sha256_, received_, size_))
        .with_field("data");
  if (hash_.finish_hex() != sha256_)
    return failed_error(fmt::format("the bytes do not have the hash {}", sha256_)).with_field("sha256");
  if (::fsync(fd_) != 0) return blob_disk_error("cannot store a blob", temporary_);
  {
    const Lock lock(store_.names_mutex_);
    if (::rename(temporary_.c_str(), final_.c_str()) != 0)
      return blob_disk_error("cannot store a blob", final_);
    store_.used_[sha256_] = steady_seconds();
  }
  ::close(fd_);
  fd_ = -1;
  const int folder = ::open(final_.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder >= 0) {
    ::fsync(folder);
    ::close(folder);
  }
  return {};
}

}  // namespace candela::master
