// The small inputs of ../shared/cases, for checkouts that have them.
#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/paths.h"

namespace candela::test {

// The folder of a case; empty if it is absent: the test skips and says so.
inline std::filesystem::path shared_case(const std::string& name) {
  const std::filesystem::path folder = shared_path() / "cases" / name;
  return std::filesystem::is_directory(folder) ? folder : std::filesystem::path();
}

inline std::string file_text(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace candela::test
