#include "common/description/scene_files.h"

#include <fmt/format.h>

#include <optional>
#include <utility>

#include "common/description/check.h"
#include "common/description/file_key.h"
#include "common/description/text.h"
#include "common/job/bundle.h"

namespace candela::description {
namespace {

constexpr std::size_t max_total_bytes = std::size_t{1} << 30;
constexpr std::size_t max_text_bytes = std::size_t{16} << 20;  // of a file
constexpr std::size_t max_search_folders = 64;

}  // namespace

SceneFiles::SceneFiles(const UnpackedFiles& files, const std::string& main_key)
    : files_(files), main_folder_(folder_of_key(main_key)) {}

Result<std::unique_ptr<XmlDocument>> SceneFiles::document(const std::string& key) {
  if (!bundle::is_valid_key(key))
    return input_error(fmt::format("{} is not the name of a file", text::quote(key)));
  CANDELA_ASSIGN(const FileSource::Bytes bytes, files_.open(key, XmlDocument::max_bytes));
  CANDELA_TRY(count_bytes(key, bytes.view.size()));
  used_.insert(key);
  return XmlDocument::parse(key, bytes.view, budget());
}

Result<std::string> SceneFiles::find(const std::string& from, const Location& where, std::string_view name) {
  std::vector<std::string> folders(folders_.rbegin(), folders_.rend());
  folders.push_back(main_folder_);
  folders.push_back(folder_of_key(from));
  std::optional<Error> first_error;
  for (const std::string& folder : folders) {
    const std::string key = file_key(folder, name);
    if (name.empty() || !bundle::is_valid_key(key))
      return error_at(where, fmt::format("{} is not the name of a file", text::quote(name)));
    if (used_.contains(key)) return key;
    Result<void> found = files_.find(key);
    if (found.ok()) {
      used_.insert(key);
      return key;
    }
    // The main folder's reason is the one to tell.
    if (!first_error || folder == main_folder_) first_error = std::move(found).error();
  }
  Error error = error_at(where, fmt::format("file {}: {}", text::quote(name), first_error->message));
  error.kind = first_error->kind;
  return error;
}

Result<std::string> SceneFiles::find_beside(const std::string& from, const Location& where,
                                            std::string_view name) {
  const std::string key = file_key(folder_of_key(from), name);
  if (!name.empty() && bundle::is_valid_key(key) && files_.find(key).ok()) {
    used_.insert(key);
    return key;
  }
  return find(from, where, name);
}

Result<FileSource::Bytes> SceneFiles::small_file(const std::string& key, const Location& where,
                                                 std::string_view what) {
  CANDELA_ASSIGN(FileSource::Bytes bytes, files_.open(key, max_text_bytes));
  if (bytes.view.size() > max_text_bytes)
    return error_at(where, fmt::format("{} has {} bytes, more than the limit of {} for {}", text::quote(key),
                                       bytes.view.size(), max_text_bytes, what));
  CANDELA_TRY(count_bytes(key, bytes.view.size()));
  return bytes;
}

Result<void> SceneFiles::add_folder(const std::string& from, const Location& where, std::string_view name) {
  std::string folder = file_key(folder_of_key(from), name);
  while (folder.size() > 1 && folder.ends_with('/')) folder.pop_back();
  if (name.empty() || !text::is_utf8(folder)) return error_at(where, "<path> names no folder");
  if (folders_.size() >= max_search_folders)
    return error_at(where, fmt::format("the scene has more than {} <path> elements", max_search_folders));
  folders_.push_back(std::move(folder));
  return {};
}

// A file counts as often as it is read.
Result<void> SceneFiles::count_bytes(const std::string& key, std::size_t bytes) {
  total_bytes_ += bytes;
  if (total_bytes_ <= max_total_bytes) return {};
  return input_error(
             fmt::format("the scene's XML and spectra have more than {} bytes in all", max_total_bytes))
      .at(key, 0);
}

}  // namespace candela::description
