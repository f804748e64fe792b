// Scene bundles: every file a scene needs, named by content.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace candela::bundle {

struct File {
  std::string path;  // key (see description::FileSource)
  std::string sha256;
  std::uint64_t size_bytes = 0;
};

struct Bundle {
  std::string main_path;
  std::vector<File> files;  // sorted by path, unique
  std::map<std::string, std::string> parameters;

  // The SHA-256 of the canonical text of all the above: the bundle's name. The text is, each on its line (a
  // string is its length in bytes, a colon and itself): "candela bundle 1"; the string main_path; "N
  // parameters", then per parameter in order of names the strings name and value; "N files", then per file
  // the string path and "sha256 size_bytes".
  std::string hash() const;
  const File* find(const std::string& path) const;
};

// Checks limits (common/job: Limits), sorted unique paths, well-formed keys and hashes, main_path present,
// parameters. Errors name the field.
Result<void> validate(const Bundle& bundle);

// A key is relative or absolute, lexically normal, UTF-8 without NUL or control characters, names a file (not
// "." or "a/"), at most Limits::max_path_bytes. It is never used as a path on the farm.
bool is_valid_key(std::string_view key);

Result<void> check_parameters(const std::map<std::string, std::string>& parameters);

}  // namespace candela::bundle
