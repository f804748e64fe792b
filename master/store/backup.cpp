#include "master/store/backup.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "common/base/descriptor.h"
#include "common/base/files.h"
#include "master/store/backup_store.h"

namespace candela::master {
namespace {

namespace fs = std::filesystem;

constexpr const char* kStoreFile = "master.sqlite";
constexpr int kTries = 20;  // of a job whose checkpoints are replaced while they are copied

Error copy_error(std::string_view what, const fs::path& path) {
  const int code = errno;
  const bool full = code == ENOSPC || code == EDQUOT || code == EFBIG;
  std::string text = fmt::format("{}: {}", what, std::strerror(code));
  Error e = full ? resource_error(std::move(text)) : failed_error(std::move(text));
  e.file = path.string();
  if (full) e.mend = "free space on the disk of the backups";
  return e;
}

// Files that are replaced as a whole and never written again.
bool never_changes(std::string_view name) {
  return name.ends_with(".ckpt") || name == "job.manifest" || name == "image.exr";
}
bool is_checkpoint(std::string_view name) {
  return name.starts_with("film.") && name.ends_with(".ckpt");
}

// Reads on until the buffer is full or the file ends. -1: it cannot be read.
ssize_t read_full(int fd, std::vector<char>& buffer) {
  std::size_t have = 0;
  while (have < buffer.size()) {
    const ssize_t n = ::read(fd, buffer.data() + have, buffer.size() - have);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return -1;
    if (n == 0) break;
    have += static_cast<std::size_t>(n);
  }
  return static_cast<ssize_t>(have);
}

// Byte by byte: size and time would take a copy for good that the disk of the backups has lost since. Where
// either cannot be read they are not the same.
bool same_content(const fs::path& a, const fs::path& b) {
  const Descriptor first(::open(a.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  const Descriptor second(::open(b.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  struct stat x {
  }, y{};
  if (first.get() < 0 || second.get() < 0 || ::fstat(first.get(), &x) != 0 ||
      ::fstat(second.get(), &y) != 0 || !S_ISREG(x.st_mode) || !S_ISREG(y.st_mode) || x.st_size != y.st_size)
    return false;
  std::vector<char> left(1 << 20), right(1 << 20);
  for (;;) {
    const ssize_t n = read_full(first.get(), left), m = read_full(second.get(), right);
    if (n < 0 || n != m || std::memcmp(left.data(), right.data(), static_cast<std::size_t>(n)) != 0)
      return false;
    if (n == 0) return true;
  }
}

class Backup {
 public:
  Backup(fs::path data, fs::path base, fs::path to)
      : data_(std::move(data)), base_(std::move(base)), to_(std::move(to)) {}

  Result<BackupReport> run() {
    CANDELA_TRY(copy_store(data_ / kStoreFile, to_ / kStoreFile));
    ++report_.files;
    report_.bytes += fs::file_size(to_ / kStoreFile);
    CANDELA_TRY(make_directories(to_ / "jobs"));
    CANDELA_ASSIGN(const std::vector<std::string> jobs, jobs_of_store(to_ / kStoreFile));
    for (const std::string& id : jobs) {
      CANDELA_ASSIGN(const bool there, add_job(id));
      report_.jobs += there ? 1 : 0;
    }
    CANDELA_TRY(add_blobs());
    const Descriptor folder(::open(to_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (folder.get() < 0 || ::syncfs(folder.get()) != 0) return copy_error("cannot write the backup", to_);
    return report_;
  }

 private:
  // False: it is gone. `path` is relative to the data folder and to the backups.
  Result<bool> add_file(const fs::path& path, bool linkable) {
    const fs::path from = data_ / path, to = to_ / path;
    const auto count = [&](std::uint64_t bytes, bool linked) {
      ++report_.files;
      report_.bytes += bytes;
      if (!linked) return;
      ++report_.linked_files;
      report_.linked_bytes += bytes;
    };
    struct stat info {};
    if (::lstat(from.c_str(), &info) != 0)
      return errno == ENOENT ? Result<bool>(false) : copy_error("cannot read", from);
    if (!S_ISREG(info.st_mode)) return true;
    const auto bytes = static_cast<std::uint64_t>(info.st_size);
    if (linkable && ::link(from.c_str(), to.c_str()) == 0) {
      count(bytes, true);
      return true;
    }
    if (linkable && errno == ENOENT) return false;
    const fs::path earlier = base_ / path;
    if (linkable && !base_.empty() && same_content(from, earlier) &&
        ::link(earlier.c_str(), to.c_str()) == 0) {
      count(bytes, true);
      return true;
    }
    const Descriptor in(::open(from.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
    if (in.get() < 0) return errno == ENOENT ? Result<bool>(false) : copy_error("cannot read", from);
    if (::fstat(in.get(), &info) != 0) return copy_error("cannot read", from);
    const Descriptor out(::open(to.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644));
    if (out.get() < 0) return copy_error("cannot write the backup", to);
    std::vector<char> buffer(1 << 20);
    for (;;) {
      const ssize_t n = ::read(in.get(), buffer.data(), buffer.size());
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) return copy_error("cannot read", from);
      if (n == 0) break;
      for (ssize_t done = 0; done < n;) {
        const ssize_t written = ::write(out.get(), buffer.data() + done, static_cast<std::size_t>(n - done));
        if (written < 0 && errno == EINTR) continue;
        if (written < 0) return copy_error("cannot write the backup", to);
        done += written;
      }
    }
    const std::array<timespec, 2> times{info.st_mtim, info.st_mtim};
    ::futimens(out.get(), times.data());
    count(static_cast<std::uint64_t>(info.st_size), false);
    return true;
  }

  // Lists the job's folder as it is now; false if it lost its checkpoints to newer ones meanwhile.
  Result<bool> add_folder(const std::string& id) {
    const fs::path path = fs::path("jobs") / id;
    CANDELA_TRY(make_directories(to_ / path));
    bool listed = false, copied = false;
    std::error_code code;
    for (fs::directory_iterator it(data_ / path, code), end; !code && it != end; it.increment(code)) {
      const std::string name = it->path().filename().string();
      if (name.starts_with('.')) continue;  // half written
      CANDELA_ASSIGN(const bool there, add_file(path / name, never_changes(name)));
      listed = listed || is_checkpoint(name);
      copied = copied || (there && is_checkpoint(name));
    }
    return !code && (copied || !listed) && fs::exists(data_ / path, code);
  }

  Result<bool> add_job(const std::string& id) {
    const BackupReport before = report_;
    for (int i = 0; i < kTries; ++i) {
      std::error_code code;
      if (!fs::exists(data_ / "jobs" / id, code)) break;
      CANDELA_ASSIGN(const bool whole, add_folder(id));
      if (whole) return true;
      fs::remove_all(to_ / "jobs" / id, code);
      report_ = before;
      if (i + 1 == kTries) return failed_error(fmt::format("job {} changes too quickly to be copied", id));
    }
    // Without a film yet, or removed since the store was copied: its folder goes first, then its row, then
    // what is left in `removed`.
    std::error_code code;
    bool removed = fs::exists(data_ / "removed" / id, code);
    if (!removed) {
      CANDELA_ASSIGN(const std::vector<std::string> present, jobs_of_store(data_ / kStoreFile));
      removed = !std::binary_search(present.begin(), present.end(), id);
    }
    if (!removed) return true;
    CANDELA_TRY(drop_job(to_ / kStoreFile, id));
    return false;
  }

  Result<void> add_blobs() {
    std::error_code code;
    const fs::path blobs = data_ / "blobs";
    for (fs::directory_iterator it(blobs, code), end; !code && it != end; it.increment(code)) {
      const std::string part = it->path().filename().string();
      if (part.size() != 2) continue;  // tmp, damaged
      CANDELA_TRY(make_directories(to_ / "blobs" / part));
      for (fs::directory_iterator file(it->path(), code), last; !code && file != last; file.increment(code))
        CANDELA_TRY(add_file(fs::path("blobs") / part / file->path().filename(), true));
    }
    if (code)
      return failed_error(fmt::format("cannot list the blobs: {}", code.message())).at(blobs.string(), 0);
    return {};
  }

  const fs::path data_, base_, to_;
  BackupReport report_;
};

bool lies_in(const fs::path& path, const fs::path& folder) {
  std::error_code code;
  const std::string inner = fs::weakly_canonical(path, code).string() + "/";
  return inner.starts_with(fs::weakly_canonical(folder, code).string() + "/");
}

}  // namespace

Result<BackupReport> back_up(const BackupOptions& options) {
  std::error_code code;
  const fs::path& data = options.data_dir;
  fs::path target = options.target;
  if (!target.has_filename()) target = target.parent_path();  // "folder/"
  if (!fs::is_regular_file(data / kStoreFile, code))
    return usage_error("no master has kept its jobs in this folder")
        .at(data.string(), 0)
        .with_field("--data");
  if (fs::exists(fs::symlink_status(target, code)))
    return usage_error("this is there already")
        .at(target.string(), 0)
        .with_mend("give the backup a name of its own");
  if (lies_in(target, data))
    return usage_error("a backup cannot lie in the data folder")
        .at(target.string(), 0)
        .with_mend("give another place");
  if (!options.base.empty() && !fs::is_regular_file(options.base / kStoreFile, code))
    return usage_error("this is no backup").at(options.base.string(), 0).with_field("--base");
  const fs::path partial = target.string() + ".partial";
  CANDELA_TRY(make_directories(partial));
  const Descriptor lock(::open(partial.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (lock.get() < 0) return copy_error("cannot write the backup", partial);
  if (::flock(lock.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
    return usage_error("another backup is being written there").at(partial.string(), 0);
  // Remains of a backup that was broken off.
  for (fs::directory_iterator it(partial, code), end; !code && it != end; it.increment(code))
    fs::remove_all(it->path(), code);
  Result<BackupReport> report =
      code
          ? Result<BackupReport>(failed_error("cannot be emptied: " + code.message()).at(partial.string(), 0))
          : Backup(data, options.base, partial).run();
  if (report.ok() && ::renameat2(AT_FDCWD, partial.c_str(), AT_FDCWD, target.c_str(), RENAME_NOREPLACE) != 0)
    report = copy_error("cannot give the backup its name", target);
  if (!report.ok()) {
    fs::remove_all(partial, code);
    return report;
  }
  const fs::path parent = target.has_parent_path() ? target.parent_path() : fs::path(".");
  const Descriptor folder(::open(parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder.get() >= 0) ::fsync(folder.get());
  return report;
}

}  // namespace candela::master
