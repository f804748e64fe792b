#include "common/description/reading.h"

#include "common/description/all_errors.h"
#include "common/description/element_names.h"
#include "common/description/pbrt/reader.h"
#include "common/description/scene_files.h"
#include "common/description/unpacked_files.h"

namespace candela::description {

bool is_old_scene(const FileSource& files, const std::string& main_key) {
  if (pbrt::is_pbrt_file(main_key)) return false;
  const UnpackedFiles unpacked(files);
  const auto document = SceneFiles(unpacked, main_key).document(main_key);
  if (!document.ok()) return false;
  const std::optional<int> major = major_version((*document)->root().attribute("version").value());
  return major && *major < 2;
}

Result<SceneDescription> parse_scene(const FileSource& files, const std::string& main_key,
                                     const std::map<std::string, std::string>& parameters) {
  CANDELA_ASSIGN(ReadScene scene, read_scene(files, main_key, parameters, {}));
  return std::move(scene.description);
}

}  // namespace candela::description
