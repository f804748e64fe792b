// The command that makes an image again, as the image carries it: what the pixels depend on, complete.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/job/job.h"

namespace candela {

struct RenderCommand {
  std::string scene;  // path of the scene file
  SettingsMap parameters;
  // But for the settings of the filter, which are the scene's.
  JobSettings settings;
  std::string indices;    // of both halves (common/film/index_text.h)
  std::string half;       // "A" or "B" for the image of one half
  std::string estimator;  // empty: the job's own
  // Layers beside the image and those of the job.
  bool error_layer = false, variance_layer = false, chain_layers = false, state_layers = false;
};

// candela render SCENE -o OUTPUT ...
std::vector<std::string> words_of(const RenderCommand& command, std::string_view output);

// The inverse, for the line of a shell made of such words; the output does not count. Errors (input): the
// line is no such command.
Result<RenderCommand> parse_render_command(std::string_view line);

}  // namespace candela
