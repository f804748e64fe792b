// Gathers a scene's bundle from the client's disk.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/description/reading.h"
#include "common/job/bundle.h"

namespace candela::bundle {

// Reads files of the client, relative to the scene file's folder.
class DiskSource final : public description::FileSource {
 public:
  explicit DiskSource(std::filesystem::path root) : root_(std::move(root)) {}
  Result<Bytes> open(const std::string& key) const override;
  Result<Bytes> start(const std::string& key, std::size_t count) const override;
  Result<void> find(const std::string& key) const override;
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

// Hashes of files that were taken before, for scenes that share files. A file is taken anew if its size or
// its times have changed.
class FileHashes {
 public:
  using Stamp = std::array<std::int64_t, 7>;  // size, device, file number, times of content and status
  // None: nobody can ask for it.
  static std::optional<Stamp> stamp_of(const std::filesystem::path& file);

  std::string sha256(const std::filesystem::path& file, std::string_view bytes);
  // Hash and size, if they were taken before.
  std::optional<std::pair<std::string, std::uint64_t>> known(const std::filesystem::path& file) const;
  // The hash of the bytes that were read since the file had this stamp; kept if it still has it.
  void learn(const std::filesystem::path& file, const Stamp& before, std::string sha256);

 private:
  struct Known {
    Stamp stamp{};
    std::string sha256;
  };
  std::map<std::filesystem::path, Known> known_;
};

// `hashes`: of other scenes; null: there are none.
Result<GatheredScene> gather(const std::filesystem::path& scene_file,
                             const std::map<std::string, std::string>& parameters,
                             const description::Reading& reading = {}, std::uint64_t memory_bytes = 0,
                             FileHashes* hashes = nullptr);

}  // namespace candela::bundle
