// Where images go: checked before anything is rendered, written whole or not at all.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace candela::client {

struct ImageOutput {
  std::string exr;  // path; empty: none
  std::string png;  // path; empty: none
};

// The path ends in `extension`, its folder exists and can be written, and no folder or device is in its
// place. If the path is a symbolic link, its target's folder exists and can be written too.
Result<void> check_output_path(const std::string& path, std::string_view extension, std::string_view option);
Result<void> check_output(const ImageOutput& output);

// Writes the EXR's bytes, and the PNG made of them.
Result<void> write_images(const ImageOutput& output, const std::string& exr_bytes);

}  // namespace candela::client
