#include "client/output.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "client/values.h"
#include "common/base/files.h"
#include "common/base/links.h"
#include "common/image/image.h"

namespace candela::client {
namespace fs = std::filesystem;

Result<void> check_output_path(const std::string& path, std::string_view extension, std::string_view option) {
  const auto bad = [&](std::string message) {
    return usage_error(fmt::format("{}: {}", printable(path), message)).with_field(std::string(option));
  };
  std::string actual = fs::path(path).extension().string();
  std::transform(actual.begin(), actual.end(), actual.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  if (actual != extension) return bad(fmt::format("the name does not end in {}", extension));
  std::error_code code;
  const fs::file_status there = fs::status(path, code);
  if (fs::exists(there) && !fs::is_regular_file(there)) return bad("this is not a regular file");
  auto target = follow_links(path);
  if (!target) return bad(target.error().message);
  for (const fs::path& file : {fs::path(path), *target}) {
    const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
    const std::string shown = printable(folder.string());
    if (!fs::is_directory(folder, code)) return bad(fmt::format("there is no folder {}", shown));
    if (::access(folder.c_str(), W_OK | X_OK) != 0)
      return bad(fmt::format("cannot write into the folder {}: {}", shown, std::strerror(errno)));
  }
  return {};
}

Result<void> check_output(const ImageOutput& output) {
  if (!output.exr.empty()) CANDELA_TRY(check_output_path(output.exr, ".exr", "--output"));
  if (!output.png.empty()) CANDELA_TRY(check_output_path(output.png, ".png", "--png"));
  return {};
}

Result<void> write_images(const ImageOutput& output, const std::string& exr_bytes) {
  if (!output.exr.empty()) CANDELA_TRY(write_file_atomically(output.exr, exr_bytes));
  if (output.png.empty()) return {};
  CANDELA_ASSIGN(const image::Image image, image::decode_exr(exr_bytes));
  CANDELA_ASSIGN(const std::string png, image::encode_png(image));
  return write_file_atomically(output.png, png);
}

}  // namespace candela::client
