// Scenes for tests, from XML text and files in memory.
#pragma once

#include <fmt/format.h>

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/description/object.h"
#include "common/rng/stream.h"
#include "worker/core/warp.h"
#include "worker/scene/scene.h"

namespace candela::test {

class TextFiles final : public description::FileSource {
 public:
  explicit TextFiles(std::map<std::string, std::string> contents) : contents_(std::move(contents)) {}
  Result<Bytes> open(const std::string& key) const override {
    const auto found = contents_.find(key);
    if (found == contents_.end()) return input_error("no such file").at(key, 0);
    return Bytes{nullptr, found->second};
  }

 private:
  std::map<std::string, std::string> contents_;
};

// `body`: what is inside <scene>; a camera is added at the origin, looking along +z.
inline Result<std::unique_ptr<scene::Scene>> build_scene(const std::string& body,
                                                         std::map<std::string, std::string> files = {},
                                                         const std::string& sensor = "",
                                                         scene::Scene::Options options = {}) {
  const std::string camera =
      sensor.empty() ? "<sensor type=\"perspective\"><float name=\"fov\" value=\"60\"/></sensor>" : sensor;
  files["scene.xml"] = fmt::format("<scene version=\"3.0.0\">\n{}\n{}\n</scene>\n", camera, body);
  const TextFiles source(std::move(files));
  CANDELA_ASSIGN(const description::SceneDescription description,
                 description::parse_scene(source, "scene.xml", {}));
  return scene::Scene::build(description, source, options);
}

inline std::string matrix(const std::vector<double>& m) {
  std::string text;
  for (const double v : m) text += fmt::format("{} ", v);
  return fmt::format("<transform name=\"to_world\"><matrix value=\"{}\"/></transform>", text);
}

inline Vec3 uniform_direction(rng::Stream& stream) {
  const float x = stream.next_float();
  return warp::uniform_sphere({x, stream.next_float()});
}

// A reference for next event estimation that is no surface: both sides, no offset.
inline scene::SurfaceHit point_reference(Vec3 p, Vec3 n = {0, 0, 1}) {
  scene::SurfaceHit hit;
  hit.p = p;
  hit.ng = n;
  hit.shading = make_frame(n);
  return hit;
}

}  // namespace candela::test
