// Shared by the scene description's tests: files in memory.
#pragma once

#include <map>
#include <string>

#include "common/description/object.h"

namespace candela::description {

class MemorySource final : public FileSource {
 public:
  explicit MemorySource(std::map<std::string, std::string> contents) : contents_(std::move(contents)) {}

  Result<Bytes> open(const std::string& key) const override {
    const auto found = contents_.find(key);
    if (found == contents_.end()) return input_error("no such file").at(key, 0);
    auto owner = std::make_shared<std::string>(found->second);
    const std::string_view view = *owner;
    return Bytes{std::move(owner), view};
  }

 private:
  std::map<std::string, std::string> contents_;
};

inline Result<SceneDescription> parse_text(const std::string& xml,
                                           const std::map<std::string, std::string>& given = {},
                                           std::map<std::string, std::string> more_files = {}) {
  more_files["scene.xml"] = xml;
  more_files["mesh.obj"] = "v 0 0 0\n";
  more_files["image.png"] = "not read here";
  return parse_scene(MemorySource(std::move(more_files)), "scene.xml", given);
}

// The message, or "ok".
inline std::string outcome(const Result<SceneDescription>& result) {
  return result.ok() ? "ok" : result.error().to_string();
}

// The whole graph as text, without places: equal texts mean equal scenes.
std::string dump(const Object& object);

}  // namespace candela::description
