#include "common/bundle/gather.h"

#include <sys/stat.h>

#include "common/base/files.h"
#include "common/base/hash.h"
#include "common/description/reading_budget.h"

namespace candela::bundle {

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
  GatheredScene gathered;
  gathered.bundle.main_path = scene_file.filename().string();
  gathered.bundle.parameters = parameters;
  description::ReadingBudget budget(memory_bytes);
  const description::BudgetedFiles counted(source, budget);
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
    CANDELA_ASSIGN(const description::FileSource::Bytes bytes, source.open(key));
    const std::filesystem::path file = source.real_path(key);
    gathered.bundle.files.push_back(
        {key, hashes != nullptr ? hashes->sha256(file, bytes.view) : sha256_hex(bytes.view),
         bytes.view.size()});
    gathered.real_paths.emplace(key, source.real_path(key));
  }
  CANDELA_TRY(validate(gathered.bundle));
  return gathered;
}

}  // namespace candela::bundle
