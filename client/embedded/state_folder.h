// OUT.exr.candela: where a render in this process keeps what it has, so that it can go on after Ctrl-C or a
// crash. One process at a time owns it (a file lock, which dies with the process).
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "common/base/result.h"

namespace candela::client {

class StateFolder {
 public:
  enum class Mode {
    create,  // there must be none
    fresh,   // what is there is thrown away
    resume,  // there must be one
  };
  static std::filesystem::path path_for(const std::string& output) { return output + ".candela"; }

  // Errors (usage) say whether --resume or --fresh mends them; one that another process owns is refused.
  static Result<std::unique_ptr<StateFolder>> open(const std::filesystem::path& path, Mode mode);
  ~StateFolder();
  StateFolder(const StateFolder&) = delete;
  StateFolder& operator=(const StateFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path farm() const { return path_ / "farm"; }    // the master's data
  std::filesystem::path cache() const { return path_ / "cache"; }  // the workers' scene files
  // Removes it all. Nothing may use it any more.
  Result<void> remove();

 private:
  StateFolder(std::filesystem::path path, int lock_fd) : path_(std::move(path)), lock_fd_(lock_fd) {}
  std::filesystem::path path_;
  int lock_fd_;
};

}  // namespace candela::client
