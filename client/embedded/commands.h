// The commands that bring the renderer along: `render`, a whole farm in this process, `reproduce`, `plan`,
// `check`, and tools of `inspect`.
#pragma once

#include "client/settings.h"

namespace CLI {
class App;
}

namespace candela::client {

struct Context;

void add_render(CLI::App& app, Context& context);
void add_reproduce(CLI::App& app, Context& context);
void add_plan(CLI::App& app, Context& context);
void add_check(CLI::App& app, Context& context);
// These add subcommands to the command `inspect`.
void add_inspect_falsecolor(CLI::App& inspect, Context& context);
void add_inspect_paths(CLI::App& inspect, Context& context);
void add_inspect_sphere(CLI::App& inspect, Context& context);
void add_inspect_volume(CLI::App& inspect, Context& context);

// Facts of the linked renderer.
RendererFacts renderer_facts();

}  // namespace candela::client
