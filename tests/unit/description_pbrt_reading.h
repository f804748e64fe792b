// Scenes of pbrt that tests give as text.
#pragma once

#include <map>
#include <string>
#include <utility>

#include "common/description/reading.h"
#include "tests/unit/test_description_common.h"

namespace candela::description {

using Files = std::map<std::string, std::string>;

// Reads a scene file, beside two pictures and more files.
inline Result<ReadScene> read_pbrt(const std::string& text, Files more = {}, const Reading& reading = {}) {
  more["scene.pbrt"] = text;
  more.try_emplace("image.png", "not read here");
  std::string picture = "\x89PNG\r\n";
  picture.append(19, '\0').append("\x06 more");
  more.try_emplace("rgba.png", picture);
  return read_scene(MemorySource(std::move(more)), "scene.pbrt", {}, reading);
}

// "ok", or the error as people see it.
inline std::string outcome_of(const Result<ReadScene>& result) {
  return result.ok() ? "ok" : result.error().to_string();
}

// The objects of the world section: the scene without sensor and integrator.
inline std::string world_of(const Object& scene) {
  std::string text;
  for (const Child& child : scene.children)
    if (child.object->category != "sensor" && child.object->category != "integrator")
      text += dump(*child.object) + "\n";
  return text;
}

// The objects of a pbrt world section, as text.
inline std::string pbrt_world(const std::string& world) {
  const auto read = read_pbrt("WorldBegin\n" + world);
  return read.ok() ? world_of(*read->description.scene) : outcome_of(read);
}

}  // namespace candela::description
