// A folder for a file that another part of the command reads again.
#pragma once

#include <filesystem>
#include <system_error>
#include <utility>

#include "common/base/result.h"

namespace candela::client {

// A folder that goes with the object.
class PassingFolder {
 public:
  static Result<PassingFolder> make();
  PassingFolder() = default;
  PassingFolder(PassingFolder&& other) noexcept : path_(std::exchange(other.path_, {})) {}
  PassingFolder& operator=(PassingFolder&& other) noexcept {
    std::swap(path_, other.path_);
    return *this;
  }
  ~PassingFolder() {
    std::error_code error;
    if (!path_.empty()) std::filesystem::remove_all(path_, error);
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace candela::client
