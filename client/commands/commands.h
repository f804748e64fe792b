// The commands that need no renderer, each added to the program's parser. A command's parser fills its
// options and sets Context::command; nothing is done while parsing.
#pragma once

namespace CLI {
class App;
}

namespace candela::client {

struct Context;

void add_submit(CLI::App& app, Context& context);
void add_list(CLI::App& app, Context& context);
void add_show(CLI::App& app, Context& context);
void add_watch(CLI::App& app, Context& context);
void add_fetch(CLI::App& app, Context& context);
void add_pause(CLI::App& app, Context& context);
void add_resume(CLI::App& app, Context& context);
void add_extend(CLI::App& app, Context& context);
void add_cancel(CLI::App& app, Context& context);
void add_priority(CLI::App& app, Context& context);
void add_verify(CLI::App& app, Context& context);
void add_repair(CLI::App& app, Context& context);
void add_workers(CLI::App& app, Context& context);
void add_drain(CLI::App& app, Context& context);
void add_slurm(CLI::App& app, Context& context);
void add_tls(CLI::App& app, Context& context);
void add_objects(CLI::App& app, Context& context);
void add_events(CLI::App& app, Context& context);
void add_compare(CLI::App& app, Context& context);
void add_convert(CLI::App& app, Context& context);
void add_inspect(CLI::App& app, Context& context);
void add_version(CLI::App& app, Context& context);
void add_doctor(CLI::App& app, Context& context);
void add_completion(CLI::App& app, Context& context);
void add_help_markdown(CLI::App& app, Context& context);
void add_help_man(CLI::App& app, Context& context);

}  // namespace candela::client
