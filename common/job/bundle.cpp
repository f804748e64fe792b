#include "common/job/bundle.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "common/base/hash.h"
#include "common/base/text.h"
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
  if (key.empty() || key.size() > Limits::max_path_bytes || !is_utf8(key) || has_control_characters(key))
    return false;
  const std::filesystem::path path(key);
  const std::filesystem::path last = path.filename();
  if (last.empty() || last == "." || last == "..") return false;
  return path.lexically_normal().generic_string() == key;
}

Result<void> check_parameters(const std::map<std::string, std::string>& parameters) {
  if (parameters.size() > Limits::max_settings)
    return error_in("parameters", fmt::format("{} parameters, more than the limit of {}", parameters.size(),
                                              Limits::max_settings));
  for (const auto& [name, value] : parameters) {
    const std::string shown = quote(name);
    if (name.empty() || name.size() > Limits::max_name_bytes || !is_utf8(name) ||
        has_control_characters(name))
      return error_in("parameters", fmt::format("{} is not a parameter's name", shown));
    if (value.size() > Limits::max_setting_bytes)
      return error_in("parameters", fmt::format("the value of {} has {} bytes, more than the limit of {}",
                                                shown, value.size(), Limits::max_setting_bytes));
    if (!is_utf8(value) || value.find('\0') != std::string::npos)
      return error_in("parameters", fmt::format("the value of {} is not text in UTF-8", shown));
  }
  return {};
}

Result<void> validate(const Bundle& bundle) {
  if (bundle.files.empty()) return error_in("files", "the bundle has no files");
  if (bundle.files.size() > Limits::max_bundle_files)
    return error_in("files", fmt::format("{} files, more than the limit of {}", bundle.files.size(),
                                         Limits::max_bundle_files));
  std::uint64_t total = 0;
  for (std::size_t i = 0; i < bundle.files.size(); ++i) {
    const File& file = bundle.files[i];
    const std::string shown = quote(file.path);
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
    return error_in("main_path", fmt::format("{} is not one of the bundle's files", quote(bundle.main_path)));
  return check_parameters(bundle.parameters);
}

}  // namespace candela::bundle
