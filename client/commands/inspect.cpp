// candela inspect: tools that look into images and scenes, each a command of its own. Those that link the
// renderer are in client/embedded.
#include <CLI/CLI.hpp>

#include "client/commands/commands.h"
#include "client/commands/inspect_tools.h"

namespace candela::client {

void add_inspect(CLI::App& app, Context& context) {
  CLI::App* inspect =
      app.add_subcommand("inspect", "Look into an image, or into the light of a scene, with a tool");
  inspect->require_subcommand(0, 1);
  add_falsecolor(*inspect, context);
}

}  // namespace candela::client
