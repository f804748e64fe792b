#include "master/store/private_folder.h"

namespace candela::master {
namespace {

namespace fs = std::filesystem;

constexpr fs::perms kOthers = fs::perms::group_all | fs::perms::others_all;

bool is_open(const fs::file_status& status) {
  return (status.permissions() & kOthers) != fs::perms::none;
}

void tighten(const fs::path& path, Tightened& out) {
  std::error_code code;
  const fs::file_status status = fs::symlink_status(path, code);
  if (code || fs::is_symlink(status) || !is_open(status)) return;
  fs::permissions(path, kOthers, fs::perm_options::remove | fs::perm_options::nofollow, code);
  if (!code)
    ++out.changed;
  else
    out.left = path;
}

}  // namespace

Tightened make_private(const fs::path& folder) {
  Tightened out;
  std::error_code code;
  if (!is_open(fs::status(folder, code)) || code) return out;
  // The folder first: from then on nobody opens what is in it.
  fs::permissions(folder, kOthers, fs::perm_options::remove, code);
  if (!code)
    ++out.changed;
  else
    out.left = folder;
  fs::recursive_directory_iterator entry(folder, fs::directory_options::skip_permission_denied, code);
  for (; !code && entry != fs::recursive_directory_iterator(); entry.increment(code))
    tighten(entry->path(), out);
  return out;
}

}  // namespace candela::master
