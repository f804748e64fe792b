#include "common/bundle/gather.h"

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

Result<GatheredScene> gather(const std::filesystem::path& scene_file,
                             const std::map<std::string, std::string>& parameters,
                             const description::Reading& reading, std::uint64_t memory_bytes) {
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
    gathered.bundle.files.push_back({key, sha256_hex(bytes.view), bytes.view.size()});
    gathered.real_paths.emplace(key, source.real_path(key));
  }
  CANDELA_TRY(validate(gathered.bundle));
  return gathered;
}

}  // namespace candela::bundle
