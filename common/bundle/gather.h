// Gathers a scene's bundle from the client's disk.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
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
