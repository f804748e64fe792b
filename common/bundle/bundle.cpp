// A bundle's name, its checks, and gathering one from disk.
#include "common/bundle/bundle.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/base/files.h"
#include "common/base/hash.h"
#include "common/description/file_key.h"
#include "common/description/reading_budget.h"
#include "common/description/text.h"
#include "common/job/job.h"

namespace candela::bundle {
namespace {

// Length first, so that no content can be taken for another field.
void append_field(std::string& text, std::string_view field) {
  text += fmt::format("{}:{}\n", field.size(), field);
}

Error error_in(std::string field, std::string message) {
  return input_error(std::move(message)).with_field(std::move(field));
}

bool has_control_characters(std::string_view text) {
  return std::any_of(text.begin(), text.end(),
                     [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; });
}

Result<void> check_parameters(const std::map<std::string, std::string>& parameters) {
  if (parameters.size() > Limits::max_settings)
    return error_in("parameters", fmt::format("{} parameters, more than the limit of {}", parameters.size(),
                                              Limits::max_settings));
  for (const auto& [name, value] : parameters) {
    const std::string shown = description::text::quote(name);
    if (name.empty() || name.size() > Limits::max_name_bytes || !description::text::is_utf8(name) ||
        has_control_characters(name))
      return error_in("parameters", fmt::format("{} is not a parameter's name", shown));
    if (value.size() > Limits::max_setting_bytes)
      return error_in("parameters", fmt::format("the value of {} has {} bytes, more than the limit of {}",
                                                shown, value.size(), Limits::max_setting_bytes));
    if (!description::text::is_utf8(value) || value.find('\0') != std::string::npos)
      return error_in("parameters", fmt::format("the value of {} is not text in UTF-8", shown));
  }
  return {};
}

}  // namespace

std::string Bundle::hash() const {
  std::string text = "candela bundle 1\n";
  append_field(text, main_path);
  text += fmt::format("{} parameters\n", parameters.size());
  for (const auto& [name, value] : parameters) {
    append_field(text, name);
    append_field(text, value);
  }
  text += fmt::format("{} files\n", files.size());
  for (const File& file : files) {
    append_field(text, file.path);
    text += fmt::format("{} {}\n", file.sha256, file.size_bytes);
  }
  return sha256_hex(text);
}

const File* Bundle::find(const std::string& path) const {
  const auto found =
      std::lower_bound(files.begin(), files.end(), path,
                       [](const File& file, const std::string& key) { return file.path < key; });
  return found != files.end() && found->path == path ? &*found : nullptr;
}

bool is_valid_key(std::string_view key) {
  return description::is_file_key(key);
}

Result<void> validate(const Bundle& bundle) {
  if (bundle.files.empty()) return error_in("files", "the bundle has no files");
  if (bundle.files.size() > Limits::max_bundle_files)
    return error_in("files", fmt::format("{} files, more than the limit of {}", bundle.files.size(),
                                         Limits::max_bundle_files));
  std::uint64_t total = 0;
  for (std::size_t i = 0; i < bundle.files.size(); ++i) {
    const File& file = bundle.files[i];
    const std::string shown = description::text::quote(file.path);
    if (!is_valid_key(file.path))
      return error_in("files.path", fmt::format("{} is not a file's name", shown));
    if (i > 0 && !(bundle.files[i - 1].path < file.path))
      return error_in("files.path", fmt::format("{} is out of order or there twice", shown));
    if (!is_sha256_hex(file.sha256))
      return error_in("files.sha256", fmt::format("the hash of {} is not 64 lower-case hex digits", shown));
    if (file.size_bytes > Limits::max_blob_bytes)
      return error_in("files.size_bytes", fmt::format("{} has {} bytes, more than the limit of {}", shown,
                                                      file.size_bytes, Limits::max_blob_bytes));
    total += file.size_bytes;  // at most 100000 * 64 GiB: no overflow
  }
  if (total > Limits::max_bundle_bytes)
    return error_in("files.size_bytes", fmt::format("{} bytes in all, more than the limit of {}", total,
                                                    Limits::max_bundle_bytes));
  if (bundle.find(bundle.main_path) == nullptr)
    return error_in("main_path", fmt::format("{} is not one of the bundle's files",
                                             description::text::quote(bundle.main_path)));
  return check_parameters(bundle.parameters);
}

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
