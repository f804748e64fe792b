#include "common/bundle/gather.h"

#include <sys/stat.h>

#include "common/base/files.h"
#include "common/base/hash.h"
#include "common/base/mutex.h"
#include "common/description/reading_budget.h"

namespace candela::bundle {
namespace {

// Hashes each file when it is opened first, so that a large mesh is read once, and the hash is that of the
// bytes that the description was read from.
class HashingSource final : public description::FileSource {
 public:
  // All must outlive the source. `hashes`: null: there are none.
  HashingSource(const DiskSource& files, FileHashes* hashes) : files_(files), hashes_(hashes) {}

  Result<Bytes> open(const std::string& key) const override {
    CANDELA_ASSIGN(Bytes bytes, files_.open(key));
    const Lock lock(mutex_);
    if (const auto [found, is_new] = entries_.try_emplace(key); is_new)
      found->second = {
          key,
          hashes_ != nullptr ? hashes_->sha256(files_.real_path(key), bytes.view) : sha256_hex(bytes.view),
          bytes.view.size()};
    return bytes;
  }

  Result<File> entry(const std::string& key) const {
    {
      const Lock lock(mutex_);
      if (const auto found = entries_.find(key); found != entries_.end()) return found->second;
    }
    CANDELA_TRY(open(key));
    const Lock lock(mutex_);
    return entries_.at(key);
  }

 private:
  const DiskSource& files_;
  FileHashes* const hashes_;
  mutable Mutex mutex_;
  mutable std::map<std::string, File> entries_ CANDELA_GUARDED_BY(mutex_);
};

}  // namespace

std::filesystem::path DiskSource::real_path(const std::string& key) const {
  return root_ / key;
}

Result<description::FileSource::Bytes> DiskSource::open(const std::string& key) const {
  const std::filesystem::path path = real_path(key);
  std::error_code code;
  const std::filesystem::file_type type = std::filesystem::status(path, code).type();
  // Before opening: to open a pipe would wait for its writer.
  if (type != std::filesystem::file_type::regular && type != std::filesystem::file_type::not_found && !code)
    return input_error("not a regular file").at(path.string(), 0);
  CANDELA_ASSIGN(std::shared_ptr<const MappedFile> file, MappedFile::open(path));
  const std::string_view view = file->bytes();
  return Bytes{std::move(file), view};
}

std::string FileHashes::sha256(const std::filesystem::path& file, std::string_view bytes) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0 || static_cast<std::uint64_t>(status.st_size) != bytes.size())
    return sha256_hex(bytes);
  const std::array<std::int64_t, 7> stamp = {static_cast<std::int64_t>(status.st_dev),
                                             static_cast<std::int64_t>(status.st_ino),
                                             status.st_size,
                                             status.st_mtim.tv_sec,
                                             status.st_mtim.tv_nsec,
                                             status.st_ctim.tv_sec,
                                             status.st_ctim.tv_nsec};
  Known& known = known_[file];
  if (known.sha256.empty() || known.stamp != stamp) known = {stamp, sha256_hex(bytes)};
  return known.sha256;
}

Result<GatheredScene> gather(const std::filesystem::path& scene_file,
                             const std::map<std::string, std::string>& parameters,
                             const description::Reading& reading, std::uint64_t memory_bytes,
                             FileHashes* hashes) {
  if (scene_file.filename().empty())
    return input_error("not a scene file").at(scene_file.string(), 0).with_mend("name the scene's XML file");
  CANDELA_TRY(check_parameters(parameters));
  const DiskSource source(scene_file.parent_path());
  const HashingSource hashed(source, hashes);
  GatheredScene gathered;
  gathered.bundle.main_path = scene_file.filename().string();
  gathered.bundle.parameters = parameters;
  description::ReadingBudget budget(memory_bytes);
  const description::BudgetedFiles counted(hashed, budget);
  Result<description::ReadScene> parsed =
      description::read_scene(counted, gathered.bundle.main_path, parameters, reading);
  if (!parsed.ok()) {
    // Places in the scene's text are named by key; what a person can open is the file.
    Error error = std::move(parsed).error();
    if (error.line > 0 || error.file == gathered.bundle.main_path)
      error.file = source.real_path(error.file).string();
    return error;
  }
  gathered.description = std::move(parsed->description);
  gathered.passed_over = std::move(parsed->passed_over);
  for (const std::string& key : gathered.description.files) {
    CANDELA_ASSIGN(File file, hashed.entry(key));
    gathered.bundle.files.push_back(std::move(file));
    gathered.real_paths.emplace(key, source.real_path(key));
  }
  CANDELA_TRY(validate(gathered.bundle));
  return gathered;
}

}  // namespace candela::bundle
