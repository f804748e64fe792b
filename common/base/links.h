// Symbolic links in the place of files to write.
#pragma once

#include <filesystem>

#include "common/base/result.h"

namespace candela {

// The file that a write to `path` should replace: `path` itself, or the end of the symbolic links that start
// there, which need not exist. Links that lead back to themselves are an input error naming `path`. (Links
// among the folders of the path are the system's to follow.)
Result<std::filesystem::path> follow_links(const std::filesystem::path& path);

}  // namespace candela
