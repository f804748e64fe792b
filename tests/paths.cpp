#include "tests/paths.h"

#include <cstdlib>

namespace candela::test {

std::filesystem::path source_path(std::string_view file) {
  return std::filesystem::path(CANDELA_SOURCE_DIR) / file;
}

std::filesystem::path program_path(std::string_view name) {
  return std::filesystem::path(CANDELA_BINARY_DIR) / name;
}

std::filesystem::path shared_path() {
  const char* given = std::getenv("CANDELA_SHARED");
  return given != nullptr ? std::filesystem::path(given) : source_path("../shared");
}

}  // namespace candela::test
