#include "common/description/file_key.h"

#include <filesystem>

#include "common/description/text.h"
#include "common/job/job.h"

namespace candela::description {

std::string file_key(std::string_view folder, std::string_view name) {
  const std::filesystem::path path = std::filesystem::path(folder) / std::filesystem::path(name);
  return path.lexically_normal().generic_string();
}

std::string folder_of_key(std::string_view key) {
  return std::filesystem::path(key).parent_path().generic_string();
}

bool is_file_key(std::string_view key) {
  if (key.empty() || key.size() > Limits::max_path_bytes || !text::is_utf8(key)) return false;
  for (const char c : key)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) return false;
  const std::filesystem::path path(key);
  const std::filesystem::path last = path.filename();
  if (last.empty() || last == "." || last == "..") return false;
  return path.lexically_normal().generic_string() == key;
}

}  // namespace candela::description
