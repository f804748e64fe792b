// Keys of a bundle's files: paths relative to the scene file's folder (or absolute), lexically normal. A key
// is only a name; nothing but the submitting client ever uses it as a path.
#pragma once

#include <string>
#include <string_view>

namespace candela::description {

// `name` as written in a scene, seen from `folder` (a key, empty for the scene's own), lexically normalized.
// An absolute name stays absolute.
std::string file_key(std::string_view folder, std::string_view name);

// The folder of a key: "" for "scene.xml", "parts" for "parts/lamp.xml".
std::string folder_of_key(std::string_view key);

}  // namespace candela::description
