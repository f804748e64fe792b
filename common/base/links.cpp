#include "common/base/links.h"

#include <fmt/format.h>

namespace candela {

Result<std::filesystem::path> follow_links(const std::filesystem::path& path) {
  namespace fs = std::filesystem;
  constexpr int most_links = 40;  // as Linux has it
  fs::path at = path;
  for (int i = 0; i < most_links; ++i) {
    std::error_code code;
    if (!fs::is_symlink(fs::symlink_status(at, code))) return at;
    const fs::path next = fs::read_symlink(at, code);
    if (code)
      return input_error(fmt::format("cannot read the symbolic link {}: {}", at.string(), code.message()))
          .at(path.string(), 0);
    at = next.is_absolute() ? next : at.parent_path() / next;
  }
  return input_error("the symbolic link leads back to itself")
      .at(path.string(), 0)
      .with_mend("remove the link, or name the file");
}

}  // namespace candela
