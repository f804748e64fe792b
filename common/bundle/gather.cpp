#include "common/bundle/gather.h"

#include <sys/stat.h>

#include <tuple>

#include "common/base/files.h"
#include "common/base/hash.h"
#include "common/base/mutex.h"
#include "common/description/reading_budget.h"

namespace candela::bundle {
namespace {

// Hashes each file when it is opened or begun first, so that a large mesh is read once, and the hash is that
// of the bytes that the description was read from. What is only named is hashed at the end, in parts.
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

  Result<void> find(const std::string& key) const override { return files_.find(key); }

  Result<Bytes> start(const std::string& key, std::size_t count) const override {
    if (known(key)) return files_.start(key, count);
    auto begun = std::make_shared<std::string>();
    CANDELA_TRY(read(key, count, *begun));
    const std::string_view view = *begun;
    return Bytes{std::move(begun), view};
  }

  Result<File> entry(const std::string& key) const {
    if (const auto file = known(key)) return *file;
    std::string begun;
    return read(key, 0, begun);
  }

 private:
  std::optional<File> known(const std::string& key) const {
    const Lock lock(mutex_);
    if (const auto found = entries_.find(key); found != entries_.end()) return found->second;
    return std::nullopt;
  }

  // Hashes a file without keeping more than its first `count` bytes.
  Result<File> read(const std::string& key, std::size_t count, std::string& begun) const {
    CANDELA_TRY(files_.find(key));
    const std::filesystem::path path = files_.real_path(key);
    const Lock lock(mutex_);
    File file{key, {}, 0};
    if (hashes_ != nullptr) {
      if (const auto before = hashes_->known(path)) {
        std::tie(file.sha256, file.size_bytes) = *before;
        CANDELA_ASSIGN(begun, read_start(path, count));
        return entries_.try_emplace(key, std::move(file)).first->second;
      }
    }
    const auto stamp = FileHashes::stamp_of(path);
    Sha256 hash;
    CANDELA_ASSIGN(file.size_bytes, read_in_parts(path, [&](std::string_view part) -> Result<void> {
                     begun += part.substr(0, count - begun.size());
                     hash.update(part);
                     return {};
                   }));
    file.sha256 = hash.finish_hex();
    if (hashes_ != nullptr && stamp) hashes_->learn(path, *stamp, file.sha256);
    return entries_.try_emplace(key, std::move(file)).first->second;
  }

  const DiskSource& files_;
  FileHashes* const hashes_;
  mutable Mutex mutex_;
  mutable std::map<std::string, File> entries_ CANDELA_GUARDED_BY(mutex_);
};

}  // namespace

std::filesystem::path DiskSource::real_path(const std::string& key) const {
  return root_ / key;
}

namespace {

// Before opening: to open a pipe would wait for its writer.
Result<void> check_regular(const std::filesystem::path& path) {
  std::error_code code;
  const std::filesystem::file_type type = std::filesystem::status(path, code).type();
  if (type != std::filesystem::file_type::regular && type != std::filesystem::file_type::not_found && !code)
    return input_error("not a regular file").at(path.string(), 0);
  return {};
}

}  // namespace

Result<void> DiskSource::find(const std::string& key) const {
  CANDELA_TRY(check_regular(real_path(key)));
  return check_readable_file(real_path(key));
}

Result<description::FileSource::Bytes> DiskSource::start(const std::string& key, std::size_t count) const {
  CANDELA_TRY(check_regular(real_path(key)));
  CANDELA_ASSIGN(std::string text, read_start(real_path(key), count));
  auto owner = std::make_shared<const std::string>(std::move(text));
  const std::string_view view = *owner;
  return Bytes{std::move(owner), view};
}

Result<description::FileSource::Bytes> DiskSource::open(const std::string& key) const {
  const std::filesystem::path path = real_path(key);
  CANDELA_TRY(check_regular(path));
  CANDELA_ASSIGN(std::shared_ptr<const MappedFile> file, MappedFile::open(path));
  const std::string_view view = file->bytes();
  return Bytes{std::move(file), view};
}

std::optional<FileHashes::Stamp> FileHashes::stamp_of(const std::filesystem::path& file) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0) return std::nullopt;
  return Stamp{status.st_size,
               static_cast<std::int64_t>(status.st_dev),
               static_cast<std::int64_t>(status.st_ino),
               status.st_mtim.tv_sec,
               status.st_mtim.tv_nsec,
               status.st_ctim.tv_sec,
               status.st_ctim.tv_nsec};
}

std::optional<std::pair<std::string, std::uint64_t>> FileHashes::known(
    const std::filesystem::path& file) const {
  const auto found = known_.find(file);
  if (found == known_.end() || stamp_of(file) != found->second.stamp) return std::nullopt;
  return std::pair(found->second.sha256, static_cast<std::uint64_t>(found->second.stamp[0]));
}

void FileHashes::learn(const std::filesystem::path& file, const Stamp& before, std::string sha256) {
  if (stamp_of(file) == before) known_[file] = {before, std::move(sha256)};
}

std::string FileHashes::sha256(const std::filesystem::path& file, std::string_view bytes) {
  const std::optional<Stamp> stamp = stamp_of(file);
  if (!stamp || static_cast<std::uint64_t>((*stamp)[0]) != bytes.size()) return sha256_hex(bytes);
  Known& known = known_[file];
  if (known.sha256.empty() || known.stamp != *stamp) known = {*stamp, sha256_hex(bytes)};
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
