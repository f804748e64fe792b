// The data folder is for the master's user alone: it has scenes, images and the token.
#pragma once

#include <cstdint>
#include <filesystem>

namespace candela::master {

struct Tightened {
  std::uint64_t changed = 0;   // files and folders whose access was taken from others
  std::filesystem::path left;  // one that could not be changed, of another user; empty: none
};
// Takes from group and others all access to the folder, and to all below it unless the folder was closed to
// them already. Symbolic links stay as they are.
Tightened make_private(const std::filesystem::path& folder);

}  // namespace candela::master
