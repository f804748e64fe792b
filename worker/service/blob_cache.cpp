// See blob_cache.h.
#include "worker/service/blob_cache.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <vector>

#include "common/base/hash.h"
#include "common/base/log.h"
#include "common/base/work_monitor.h"

namespace candela::worker {
namespace {

namespace fs = std::filesystem;

constexpr auto kRescanInterval = std::chrono::seconds(60);
constexpr auto kPartialLifetime = std::chrono::hours(24);
constexpr std::int64_t kTouchNs = 60'000'000'000;   // a use is noted in the file's mtime this often
constexpr std::int64_t kSettledNs = 1'000'000'000;  // no file system's clock is coarser, save FAT's

Error disk_error(std::string_view what, const fs::path& path) {
  const int code = errno;
  Error error = resource_error(fmt::format("{}: {}", what, std::strerror(code))).at(path.string(), 0);
  if (code == ENOSPC || code == EDQUOT || code == EFBIG)
    error.mend = "free space on the worker's disk, or give its --cache a larger one";
  else if (code == EACCES || code == EPERM || code == EROFS)
    error.mend = "make the folder writable to the worker";
  return error;
}

// An error of the file system by its kind: the cache's, whatever file it was.
Error as_disk_error(Error error) {
  error.kind = ErrorKind::resource;
  return error;
}

std::int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::int64_t nanoseconds(const timespec& t) {
  return std::int64_t{t.tv_sec} * 1000000000 + t.tv_nsec;
}

// A temporary file that vanishes unless it is given its final name.
class PartialFile {
 public:
  explicit PartialFile(fs::path path)
      : path_(std::move(path)), fd_(::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644)) {}
  ~PartialFile() {
    const bool created = fd_ >= 0 || closed_;
    if (fd_ >= 0) ::close(fd_);
    if (created && !renamed_) ::unlink(path_.c_str());
  }
  PartialFile(const PartialFile&) = delete;
  PartialFile& operator=(const PartialFile&) = delete;

  bool is_open() const { return fd_ >= 0; }
  Result<void> write(std::string_view data) {
    while (!data.empty()) {
      const ssize_t n = ::write(fd_, data.data(), data.size());
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) return disk_error("cannot write to the cache", path_);
      data.remove_prefix(static_cast<std::size_t>(n));
    }
    return {};
  }
  // False: it has been removed.
  Result<bool> rename_to(const fs::path& path) {
    closed_ = true;
    if (::close(std::exchange(fd_, -1)) != 0) return disk_error("cannot write to the cache", path_);
    if (::rename(path_.c_str(), path.c_str()) == 0) return renamed_ = true;
    if (errno == ENOENT) return false;
    return disk_error("cannot write to the cache", path);
  }

 private:
  fs::path path_;
  int fd_ = -1;
  bool closed_ = false, renamed_ = false;
};

struct CachedFile {
  std::string sha256;
  std::uint64_t size_bytes = 0;
  std::int64_t used_ns = 0;
};

// Hashes in steps: the file may be large and on a slow disk.
std::string hash_of(std::string_view bytes) {
  constexpr std::size_t kStep = std::size_t{4} << 20;
  Sha256 hash;
  for (std::size_t at = 0; at < bytes.size(); at += kStep) {
    work_step();
    hash.update(bytes.substr(at, kStep));
  }
  return hash.finish_hex();
}

// Lists the cache; files that vanish during the scan are left out.
std::vector<CachedFile> scan(const fs::path& blobs) {
  std::vector<CachedFile> found;
  std::error_code code;
  for (fs::directory_iterator folder(blobs, code), end; !code && folder != end; folder.increment(code)) {
    std::error_code inner;
    for (fs::directory_iterator file(folder->path(), inner); !inner && file != end; file.increment(inner)) {
      struct stat info {};
      std::string name = file->path().filename().string();
      if (!is_sha256_hex(name) || ::lstat(file->path().c_str(), &info) != 0 || !S_ISREG(info.st_mode))
        continue;
      found.push_back({std::move(name), static_cast<std::uint64_t>(info.st_size), nanoseconds(info.st_mtim)});
    }
  }
  return found;
}

}  // namespace

BlobCache::BlobCache(fs::path folder, std::uint64_t limit_bytes, Beside beside)
    : folder_(std::move(folder)),
      limit_bytes_(limit_bytes),
      beside_(std::move(beside)),
      pins_(std::make_shared<Pins>()) {}

Result<std::unique_ptr<BlobCache>> BlobCache::open(const fs::path& folder, std::uint64_t limit_bytes,
                                                   Beside beside) {
  CANDELA_TRY(make_directories(folder / "blobs"));
  CANDELA_TRY(make_directories(folder / "partial"));
  if (::access((folder / "partial").c_str(), W_OK) != 0)
    return input_error(fmt::format("the cache cannot be written: {}", std::strerror(errno)))
        .at(folder.string(), 0);
  std::error_code code;
  const auto now = fs::file_time_type::clock::now();
  for (fs::directory_iterator file(folder / "partial", code), end; !code && file != end;
       file.increment(code)) {
    std::error_code inner;
    const auto written = file->last_write_time(inner);
    if (!inner && now - written > kPartialLifetime) fs::remove(file->path(), inner);
  }
  return std::unique_ptr<BlobCache>(new BlobCache(folder, limit_bytes, std::move(beside)));
}

fs::path BlobCache::path_of(const std::string& sha256) const {
  return folder_ / "blobs" / sha256.substr(0, 2) / sha256;
}

BlobCache::Pin BlobCache::pin(const std::string& sha256) {
  {
    const Lock lock(pins_->mutex);
    ++pins_->counts[sha256];
  }
  return {static_cast<const void*>(this), [pins = pins_, sha256](const void*) {
            const Lock lock(pins->mutex);
            if (const auto found = pins->counts.find(sha256); --found->second == 0) pins->counts.erase(found);
          }};
}

bool BlobCache::is_pinned(const std::string& sha256) const {
  const Lock lock(pins_->mutex);
  return pins_->counts.contains(sha256);
}

Result<std::optional<BlobCache::Identity>> BlobCache::identity_of(const fs::path& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) {
    if (errno == ENOENT) return std::optional<Identity>();
    return disk_error("cannot read the cache", path);
  }
  return std::optional<Identity>({info.st_dev, info.st_ino, static_cast<std::uint64_t>(info.st_size),
                                  nanoseconds(info.st_mtim), nanoseconds(info.st_ctim)});
}

// The file is mapped first and judged by what is mapped, so that nobody can change it in between by a rename.
// Null: it is not there, or was not what it should be and has been removed. A file beside the cache is not
// this cache's to remove or to touch.
Result<std::shared_ptr<const MappedFile>> BlobCache::open_verified(const fs::path& path,
                                                                   const std::string& sha256,
                                                                   std::uint64_t size_bytes) {
  const bool own = path == path_of(sha256);
  CANDELA_ASSIGN(const std::optional<Identity> before, identity_of(path));
  if (!before) return std::shared_ptr<const MappedFile>();
  auto file = MappedFile::open(path);
  CANDELA_ASSIGN(std::optional<Identity> after, identity_of(path));
  if (!after) return std::shared_ptr<const MappedFile>();
  if (!file) return as_disk_error(std::move(file).error());
  bool known = false;
  {
    const Lock lock(mutex_);
    const auto found = verified_.find(sha256);
    known = found != verified_.end() && found->second.settled && found->second.identity == *before &&
            before == after;
  }
  const std::int64_t checked_ns = now_ns();
  if ((*file)->bytes().size() != size_bytes || (!known && hash_of((*file)->bytes()) != sha256)) {
    log::warn(fmt::format("the {} {} is damaged; it is fetched again", own ? "cached file" : "blob",
                          path.string()));
    if (own) ::unlink(path.c_str());
    const Lock lock(mutex_);
    verified_.erase(sha256);
    return std::shared_ptr<const MappedFile>();
  }
  if (own && checked_ns - std::get<3>(*after) > kTouchNs) {
    // Used now; a failure only makes it look older. It changes the times, so the next use checks the hash
    // again.
    ::utimensat(AT_FDCWD, path.c_str(), nullptr, 0);
    CANDELA_ASSIGN(after, identity_of(path));
    if (!after) return std::move(*file);
  }
  const bool settled = known || (before == after && checked_ns - std::get<4>(*after) > kSettledNs);
  const Lock lock(mutex_);
  verified_[sha256] = {*after, settled && before == after};
  return std::move(*file);
}

Result<void> BlobCache::make_room(std::uint64_t need_bytes) {
  const auto no_room = [&](std::string_view why) {
    return resource_error(fmt::format("no room for a file of {} bytes in the cache: {}", need_bytes, why))
        .at(folder_.string(), 0)
        .with_mend("raise --cache-size, or give --cache a larger disk");
  };
  if (need_bytes > limit_bytes_) return no_room(fmt::format("its limit is {} bytes", limit_bytes_));

  const Lock lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  const bool stale = scanned_ == std::chrono::steady_clock::time_point{} || now - scanned_ > kRescanInterval;
  struct statvfs disk {};
  const bool disk_known = ::statvfs(folder_.c_str(), &disk) == 0;
  std::uint64_t free_bytes = disk_known ? std::uint64_t{disk.f_bavail} * disk.f_frsize : need_bytes;
  if (stale || estimated_bytes_ + need_bytes > limit_bytes_ || free_bytes < need_bytes) {
    std::vector<CachedFile> files = scan(folder_ / "blobs");
    std::uint64_t total = 0;
    for (const CachedFile& file : files) total += file.size_bytes;
    std::sort(files.begin(), files.end(), [](const CachedFile& a, const CachedFile& b) {
      return std::tie(a.used_ns, a.sha256) < std::tie(b.used_ns, b.sha256);
    });
    // Some slack, so that a bundle of many small files does not scan for each of them.
    const std::uint64_t slack = total + need_bytes > limit_bytes_ ? limit_bytes_ / 20 : 0;
    for (const CachedFile& file : files) {
      if (total + need_bytes + slack <= limit_bytes_ && free_bytes >= need_bytes) break;
      if (is_pinned(file.sha256)) continue;
      if (::unlink(path_of(file.sha256).c_str()) == 0) free_bytes += file.size_bytes;
      total -= file.size_bytes;
      verified_.erase(file.sha256);
    }
    estimated_bytes_ = total;
    scanned_ = now;
    if (total + need_bytes > limit_bytes_)
      return no_room(fmt::format("its limit is {} bytes, and {} are in use", limit_bytes_, total));
    if (free_bytes < need_bytes) return no_room(fmt::format("the disk has {} bytes left", free_bytes));
  }
  estimated_bytes_ += need_bytes;
  return {};
}

Result<void> BlobCache::download(const std::string& sha256, std::uint64_t size_bytes, const Fetch& fetch) {
  CANDELA_TRY(make_room(size_bytes));
  std::uint64_t serial = 0;
  {
    const Lock lock(mutex_);
    serial = serial_++;
  }
  const auto stamp =
      std::chrono::system_clock::now().time_since_epoch().count();  // hosts may share the folder and pids
  // Every time: somebody may have removed them since.
  for (const fs::path& needed : {path_of(sha256).parent_path(), folder_ / "partial"})
    if (auto made = make_directories(needed); !made) return as_disk_error(std::move(made).error());
  PartialFile partial(folder_ / "partial" / fmt::format("{}.{}.{}.{}", sha256, ::getpid(), stamp, serial));
  if (!partial.is_open()) return disk_error("cannot write to the cache", folder_ / "partial");

  Sha256 hash;
  std::uint64_t received = 0;
  CANDELA_TRY(fetch(sha256, size_bytes, [&](std::string_view data) -> Result<void> {
    received += data.size();
    if (received > size_bytes)
      return failed_error(
          fmt::format("the master sent more than the {} bytes of blob {}", size_bytes, sha256));
    hash.update(data);
    return partial.write(data);
  }));
  if (received != size_bytes)
    return failed_error(
        fmt::format("the master sent {} of the {} bytes of blob {}", received, size_bytes, sha256));
  if (const std::string actual = hash.finish_hex(); actual != sha256)
    return failed_error(fmt::format("the master sent other bytes (hash {}) for blob {}", actual, sha256));
  CANDELA_ASSIGN(const bool renamed, partial.rename_to(path_of(sha256)));
  // Whoever looks for it fetches it again.
  if (!renamed) log::warn(fmt::format("{} was removed during a download", folder_.string()));
  return {};
}

fs::path BlobCache::beside(const std::string& sha256, std::uint64_t size_bytes) const {
  struct stat info {};
  if (!beside_) return {};
  fs::path path = beside_(sha256);
  const bool fits = ::stat(path.c_str(), &info) == 0 && S_ISREG(info.st_mode) &&
                    static_cast<std::uint64_t>(info.st_size) == size_bytes;
  return fits ? path : fs::path();
}

Result<BlobCache::Mapped> BlobCache::map(const std::string& sha256, std::uint64_t size_bytes,
                                         const Fetch& fetch) {
  if (!is_sha256_hex(sha256)) return internal_error(fmt::format("'{}' is no SHA-256", sha256.substr(0, 64)));
  Pin held = pin(sha256);  // before it is looked for: nothing may evict it in between
  // Another worker may evict it between our download and our look at it, but not for ever.
  for (int attempt = 0; attempt < 3; ++attempt) {
    CANDELA_ASSIGN(std::shared_ptr<const MappedFile> file,
                   open_verified(path_of(sha256), sha256, size_bytes));
    // A file beside the cache that was no good the first time is none the second.
    if (const fs::path path = file || attempt > 0 ? fs::path() : beside(sha256, size_bytes); !path.empty()) {
      CANDELA_ASSIGN(file, open_verified(path, sha256, size_bytes));
    }
    if (file) {
      const std::string_view bytes = file->bytes();
      using Owner = std::pair<Pin, std::shared_ptr<const MappedFile>>;
      return Mapped{std::make_shared<const Owner>(std::move(held), std::move(file)), bytes};
    }
    CANDELA_TRY(download(sha256, size_bytes, fetch));
  }
  return resource_error(fmt::format("blob {} vanishes from the cache as soon as it is fetched", sha256))
      .at(folder_.string(), 0)
      .with_mend("raise --cache-size of the workers that share this cache");
}

Result<BlobCache::Pin> BlobCache::ensure(const std::string& sha256, std::uint64_t size_bytes,
                                         const Fetch& fetch) {
  if (!is_sha256_hex(sha256)) return internal_error(fmt::format("'{}' is no SHA-256", sha256.substr(0, 64)));
  Pin held = pin(sha256);
  CANDELA_ASSIGN(const std::optional<Identity> identity, identity_of(path_of(sha256)));
  if (identity && std::get<2>(*identity) == size_bytes) return held;
  if (beside(sha256, size_bytes).empty()) CANDELA_TRY(download(sha256, size_bytes, fetch));
  return held;
}

}  // namespace candela::worker
