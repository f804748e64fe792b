// The source of the EXR of `candela inspect falsecolor`: a file, a job of a farm, or a scene that is rendered
// for it, here or on a farm.
#pragma once

#include <optional>
#include <string>

#include "client/context.h"
#include "client/passing_folder.h"
#include "client/settings.h"

namespace candela::client {

struct FalseColorSource {
  std::string input;  // an EXR, a scene, or a job
  SceneOptions scene;
  std::optional<std::string> layer, select, threads;
  FarmOptions farm;  // with a master: the input is a job or a scene
  bool quiet = false;
};

// True if the input is a scene, by its ending; with a master it is also a file that exists.
bool is_scene(const FalseColorSource& source);

// Checks --select as far as it can be without a scene.
Result<void> check_select(const FalseColorSource& source);

struct SourceFile {
  int code = 0;          // 0, the job's, or 128+n if a signal ended the rendering
  std::string path;      // of the EXR, if the code is 0
  PassingFolder folder;  // in which it is, unless it is the user's
};
// Has the layers of the image that `layer` and `select` need.
Result<SourceFile> source_file(Context& context, const FalseColorSource& source);

// The layer of the light that a light path expression selects, in an EXR of Candela: the layer whose own
// expression reads the same. shown: the name of the EXR in errors.
Result<std::string> layer_of_expression(const std::string& path, const std::string& shown,
                                        const std::string& expression);

}  // namespace candela::client
