// Paths as bytes: what a chain carries from one segment to the next [half-vector note, section 17]. No number
// that follows from others is among them.
#pragma once

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "worker/transport/path/path.h"

namespace candela::transport::path {

// Little-endian: a vertex takes at most 32 bytes.
std::string to_bytes(const Path& path);
// Fails (input) on bytes that to_bytes() cannot have made. Whether the scene has such points and objects is
// exists()'s question (assemble.h).
Result<Path> path_from_bytes(std::string_view bytes);

std::string to_bytes(const PathSeed& seed);
Result<PathSeed> seed_from_bytes(std::string_view bytes);

}  // namespace candela::transport::path
