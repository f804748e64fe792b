// candela inspect: tools that look into images and scenes, each a command of its own (client/embedded).
#include <CLI/CLI.hpp>

#include "client/commands/commands.h"

namespace candela::client {

void add_inspect(CLI::App& app, Context& /*context*/) {
  app.add_subcommand("inspect", "Look into an image, or into the light of a scene, with a tool")
      ->require_subcommand(0, 1);
}

}  // namespace candela::client
