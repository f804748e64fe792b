// Scene bundles: every file a scene needs, named by content.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/description/reading.h"

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

// Reads files of the client, relative to the scene file's folder.
class DiskSource final : public description::FileSource {
 public:
  explicit DiskSource(std::filesystem::path root) : root_(std::move(root)) {}
  Result<Bytes> open(const std::string& key) const override;
  std::filesystem::path real_path(const std::string& key) const;

 private:
  std::filesystem::path root_;
};

// A scene on disk, parsed, with its bundle: what `submit`, `render` and `plan` start from. Errors name files
// as they are on this disk. The same file under two keys is two entries of one hash. `memory_bytes`: what
// reading may take; 0: the default of description::ReadingBudget.
struct GatheredScene {
  description::SceneDescription description;
  Bundle bundle;
  std::map<std::string, std::filesystem::path> real_paths;  // key -> file on this disk
  std::vector<description::Note> passed_over = {};          // see description::ReadScene
};
Result<GatheredScene> gather(const std::filesystem::path& scene_file,
                             const std::map<std::string, std::string>& parameters,
                             const description::Reading& reading = {}, std::uint64_t memory_bytes = 0);

}  // namespace candela::bundle
