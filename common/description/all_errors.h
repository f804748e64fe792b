// Readings of a scene file for what a scene that was read does not tell.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "common/description/reading.h"

namespace candela::description {

inline constexpr std::size_t kMaxErrors = 20;

// The errors of a scene whose reading fails, up to kMaxErrors, in the order in which they are met: what
// read_scene() says of the first error, and then of each element that does not depend on it. A pbrt scene has
// its first error alone. Empty if the reading does not fail.
std::vector<Error> all_errors(const FileSource& files, const std::string& main_key,
                              const std::map<std::string, std::string>& parameters, const Reading& reading);

// True if the file is of a version before 2. False if nobody can read it.
bool is_old_scene(const FileSource& files, const std::string& main_key);

}  // namespace candela::description
