#include "client/embedded/state_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "common/base/files.h"

namespace candela::client {
namespace fs = std::filesystem;
namespace {

// Only a folder with this file in it is ever thrown away.
constexpr const char* kLockName = "candela-render.lock";

Result<void> remove_contents(const fs::path& folder) {
  std::error_code code;
  for (const char* name : {"farm", "cache"}) {
    fs::remove_all(folder / name, code);
    if (code)
      return resource_error(fmt::format("cannot remove: {}", code.message())).at((folder / name).string(), 0);
  }
  return {};
}

}  // namespace

Result<std::unique_ptr<StateFolder>> StateFolder::open(const fs::path& path, Mode mode) {
  std::error_code code;
  const bool there = fs::exists(fs::symlink_status(path, code));
  if (mode == Mode::resume && !there)
    return usage_error(fmt::format("there is nothing to resume: no folder {}", path.string()))
        .with_field("--resume")
        .with_mend("render without --resume");
  if (there && !fs::exists(path / kLockName, code)) {
    // An empty folder is what is left of a crash right at the start.
    if (!fs::is_directory(path, code) || !fs::is_empty(path, code))
      return usage_error("this is not the state of a render").at(path.string(), 0).with_mend("move it away");
    if (mode == Mode::create) mode = Mode::fresh;
  }
  if (mode == Mode::create && there)
    return usage_error("there is an unfinished render")
        .at(path.string(), 0)
        .with_mend("go on with it by --resume, or throw it away by --fresh");

  CANDELA_TRY(make_directories(path));
  if (!there) fs::permissions(path, fs::perms::owner_all, code);  // it has the scene
  const fs::path lock = path / kLockName;
  const int fd = ::open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (fd < 0) return input_error(fmt::format("cannot open: {}", std::strerror(errno))).at(lock.string(), 0);
  auto folder = std::unique_ptr<StateFolder>(new StateFolder(path, fd));
  if (::flock(fd, LOCK_EX | LOCK_NB) != 0)
    return refused_error("another process is rendering to this output").at(path.string(), 0);
  if (mode == Mode::fresh) CANDELA_TRY(remove_contents(path));
  return folder;
}

StateFolder::~StateFolder() {
  if (lock_fd_ >= 0) ::close(lock_fd_);
}

Result<void> StateFolder::remove() {
  CANDELA_TRY(remove_contents(path_));
  std::error_code code;
  fs::remove(path_ / kLockName, code);
  fs::remove(path_, code);  // stays, harmless, if somebody put a file of theirs there
  return {};
}

}  // namespace candela::client
