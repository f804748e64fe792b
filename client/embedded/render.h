// candela render, as other commands call it.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "client/commands/image_options.h"
#include "client/context.h"
#include "client/preview/preview.h"

namespace candela::client {

struct RenderOptions {
  SceneOptions scene;
  PreviewOptions preview;
  std::string output;
  ImageOptions image;
  std::optional<std::string> png, page, threads, workers, texture_memory;
  bool resume = false, fresh = false, keep_state = false, quiet = false, json = false, page_stay = false;
  // Not empty: the output goes when the command ends. The user is not told of it, and, if the render is
  // stopped, is told to keep the next one by -o and this name.
  std::string keep_as = {};
  bool passing = false;  // the output goes when the command ends, and no option would keep it
  std::function<Result<void>(const LoadedScene&)> check = {};  // before anything is rendered
};

// Exit code: 0, or 128+n where a signal ended it.
Result<int> run_render(Context& context, const RenderOptions& options);

}  // namespace candela::client
