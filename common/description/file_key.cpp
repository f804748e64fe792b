#include "common/description/file_key.h"

#include <filesystem>

namespace candela::description {

std::string file_key(std::string_view folder, std::string_view name) {
  const std::filesystem::path path = std::filesystem::path(folder) / std::filesystem::path(name);
  return path.lexically_normal().generic_string();
}

std::string folder_of_key(std::string_view key) {
  return std::filesystem::path(key).parent_path().generic_string();
}

}  // namespace candela::description
