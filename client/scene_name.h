// Names that follow from a scene's path, and file names made of patterns.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace candela::client {

// Names a scene after its file, or after its folder if the file is called scene, main,
// index or the like. Never empty, at most Limits::max_name_bytes.
std::string scene_name(const std::filesystem::path& scene_file);

// The name as the name of a file in the present folder: without slashes, not hidden.
std::string file_name_of(std::string_view name);

// `pattern` with each {WORD} of `words` in its place, and {frame} or {frame:4}, with zeros in front to so
// many digits, if there is a frame. Other braces stay. Errors (usage): a width that is none.
Result<std::string> fill_pattern(std::string_view pattern, const std::map<std::string, std::string>& words,
                                 std::optional<std::int64_t> frame, std::string_view option);

// True if the pattern has a place for frames.
bool has_frame(std::string_view pattern);

}  // namespace candela::client
