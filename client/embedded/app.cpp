#include "client/embedded/app.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdlib>
#include <new>
#include <optional>
#include <ostream>
#include <sstream>

#include "client/commands/commands.h"
#include "client/context.h"
#include "client/embedded/commands.h"
#include "client/help/command_tree.h"
#include "client/help/integrator_help.h"
#include "client/help/wrap.h"
#include "client/values.h"
#include "common/base/log.h"
#include "common/base/path_options.h"
#include "common/base/text.h"
#include "common/base/version.h"
#include "common/description/vocabulary.h"

namespace candela::client {
namespace {

int report(std::ostream& err, const std::string& message, int code) {
  err << "candela: error: " << printable(message) << std::endl;
  return code;
}

void add_commands(CLI::App& app, Context& context) {
  add_render(app, context);
  add_reproduce(app, context);
  add_plan(app, context);
  add_check(app, context);
  add_objects(app, context);
  add_submit(app, context);
  add_list(app, context);
  add_show(app, context);
  add_watch(app, context);
  add_fetch(app, context);
  add_pause(app, context);
  add_resume(app, context);
  add_extend(app, context);
  add_cancel(app, context);
  add_priority(app, context);
  add_verify(app, context);
  add_repair(app, context);
  add_workers(app, context);
  add_drain(app, context);
  add_slurm(app, context);
  add_tls(app, context);
  add_events(app, context);
  add_compare(app, context);
  add_convert(app, context);
  add_inspect(app, context);
  CLI::App& inspect = *app.get_subcommand("inspect");
  add_inspect_falsecolor(inspect, context);
  add_inspect_paths(inspect, context);
  add_inspect_sphere(inspect, context);
  add_inspect_volume(inspect, context);
  add_doctor(app, context);
  add_completion(app, context);
  add_version(app, context);
  add_help_markdown(app, context);
  add_help_man(app, context);
}

// " (did you mean '--iterations'?)" for a word that is no option or command.
std::string suggestion(const std::string& word, const std::vector<std::string>& known) {
  const std::vector<std::string_view> names(known.begin(), known.end());
  const std::string_view near = description::nearest_name(word, names);
  return near.empty() ? std::string() : fmt::format(" (did you mean '{}'?)", near);
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App* s) { return !s->get_group().empty(); }))
    names.push_back(sub->get_name());
  return names;
}

bool is_command(const CLI::App& app, const std::string& word) {
  const auto all = app.get_subcommands([](const CLI::App*) { return true; });
  return std::any_of(all.begin(), all.end(), [&](const CLI::App* sub) { return sub->get_name() == word; });
}

// The commands that have an option: " (it is an option of 'fetch')"; empty if none has.
std::string owners(CLI::App& app, const std::string& name) {
  constexpr std::size_t max_named = 3;
  std::vector<std::string> commands;
  for (const auto& [command, sub] : commands_of(app))
    if (!sub->get_group().empty() && name.starts_with("--") && sub->get_option_no_throw(name) != nullptr)
      commands.push_back(fmt::format("'{}'", command));
  if (commands.empty()) return {};
  const bool more = commands.size() > max_named;
  if (more) commands.resize(max_named);
  return fmt::format(" (it is an option of {}{})", fmt::join(commands, ", "), more ? " and others" : "");
}

// The command that was chosen, the innermost; `app` itself if none was.
const CLI::App& chosen_command(const CLI::App& app) {
  const auto chosen = app.get_subcommands();
  return chosen.empty() ? app : chosen_command(*chosen.front());
}

// "candela inspect falsecolor"
std::string full_name(const CLI::App& command) {
  const CLI::App* const parent = command.get_parent();
  return (parent == nullptr ? std::string() : full_name(*parent) + ' ') + command.get_name();
}

// Explains the parser's error in words and with the nearest option.
std::string explain(CLI::App& app, const std::vector<std::string>& arguments, const CLI::ParseError& error) {
  const CLI::App& command = chosen_command(app);
  const std::string what = error.what();
  if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError)) {
    // The words the parser left over, looked up in the order they were given.
    std::vector<std::string> options;
    for (const CLI::Option* option : command.get_options())
      for (const std::string& name : option->get_lnames()) options.push_back("--" + name);
    for (std::size_t i = 1; i < arguments.size(); ++i) {
      const std::string name = arguments[i].substr(0, arguments[i].find('='));
      if (name.size() > 1 && name.starts_with('-') && what.find(arguments[i]) != std::string::npos &&
          std::find(options.begin(), options.end(), name) == options.end()) {
        const std::string elsewhere = owners(app, name);
        return fmt::format("there is no option '{}'{}", printable(name),
                           elsewhere.empty() ? suggestion(name, options) : elsewhere);
      }
    }
  }
  // "--spp: At Most 1 required but received 2"
  std::string text = what;
  if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ArgumentMismatch) &&
      what.find(": At Most 1 ") != std::string::npos)
    text = fmt::format("{} is given twice", printable(what.substr(0, what.find(':'))));
  if (&command != &app) text += fmt::format(" (see: {} --help)", full_name(command));
  return text;
}

// The proto's strings are UTF-8. A path on this disk may be any bytes; files of a scene are checked as they
// are gathered.
Result<void> check_text(const CLI::App& command) {
  for (const CLI::Option* option : command.get_options()) {
    const std::string type = option->get_type_name();
    if (names_a_path(type)) continue;
    for (const std::string& value : option->results()) {
      if (is_utf8(value)) continue;
      const std::string name = option->get_positional() ? type : option->get_name();
      return usage_error(fmt::format("'{}' is not text in UTF-8", printable(value))).with_field(name);
    }
  }
  return {};
}

}  // namespace

std::unique_ptr<CLI::App> make_parser(Context& context) {
  auto app = std::make_unique<CLI::App>(
      "Candela renders scenes by physically based light transport, here or on a farm", "candela");
  app->set_version_flag("--version", fmt::format("candela {} (build {})", version(), build_id()),
                        "Print the version and the build");
  app->set_help_flag("-h,--help", "Print help");
  app->require_subcommand(0, 1);
  const std::string integrators = fmt::format("{}", join(context.facts.integrator_names(), ", "));
  app->footer(
      "candela COMMAND --help says more about a command, candela help INTEGRATOR about the settings of one "
      "of: " +
      integrators);
  add_commands(*app, context);
  for (const auto& [name, command] : commands_of(*app))
    if (CLI::Option* option = command->get_option_no_throw("--integrator"))
      option->description(option->get_description() + ": " + integrators);
  add_examples(*app);
  refuse_empty_paths(*app);
  return app;
}

namespace {

// Counts the leading arguments that name nested commands.
std::size_t count_commands(const CLI::App& app, const std::vector<std::string>& arguments) {
  const CLI::App* command = &app;
  std::size_t count = 0;
  while (count + 1 < arguments.size() && is_command(*command, arguments[count + 1]))
    command = command->get_subcommand(arguments[++count]);
  return count;
}

// "candela help" and "candela help COMMAND", as they are written with --help. A word that is no command is
// kept, to be refused.
std::vector<std::string> spell_help(const CLI::App& app, std::vector<std::string> arguments) {
  if (arguments.size() < 2 || arguments[1] != "help") return arguments;
  arguments.erase(arguments.begin() + 1);
  const std::size_t words = std::max<std::size_t>(2, count_commands(app, arguments) + 1);
  if (arguments.size() > words) arguments.resize(words);
  arguments.emplace_back("--help");
  return arguments;
}

// The error of a word that should be a command and is none; empty if there is no such word.
std::string unknown_command(const CLI::App& app, const std::vector<std::string>& arguments) {
  const CLI::App* command = &app;
  for (std::size_t i = 1; i < arguments.size(); ++i) {
    const std::vector<std::string> names = command_names(*command);
    if (names.empty() || arguments[i].empty() || arguments[i][0] == '-') break;
    if (!is_command(*command, arguments[i]))
      return fmt::format("there is no command '{}{}'{}",
                         command == &app ? "" : full_name(*command).substr(app.get_name().size() + 1) + ' ',
                         printable(arguments[i]), suggestion(arguments[i], names));
    command = command->get_subcommand(arguments[i]);
  }
  return {};
}

}  // namespace

namespace {

// "candela help vcm": prints its settings and returns the exit code; nothing if this is another command.
std::optional<int> help_on_integrator(const std::vector<std::string>& given, const CLI::App& app,
                                      const RendererFacts& facts, std::ostream& out, std::ostream& err) {
  if (given.size() < 3 || given[1] != "help" || given[2].starts_with('-') || is_command(app, given[2]))
    return std::nullopt;
  const std::vector<std::string> names = facts.integrator_names();
  if (std::find(names.begin(), names.end(), given[2]) == names.end()) {
    if (!suggestion(given[2], command_names(app)).empty() || suggestion(given[2], names).empty())
      return std::nullopt;
    return report(err,
                  fmt::format("there is no command or integrator '{}'{}", printable(given[2]),
                              suggestion(given[2], names)),
                  2);
  }
  const auto settings = facts.setting_docs(given[2]);
  if (!settings.ok()) return report(err, settings.error().to_string(), settings.error().exit_code());
  out << integrator_help(given[2], *settings, help_width()) << std::flush;
  return 0;
}

// The help that the parser was asked for, as wide as the terminal.
int print_help(const CLI::App& app, const CLI::Success& success, std::ostream& out, std::ostream& err) {
  std::ostringstream text;
  const int code = app.exit(success, text, err) == 0 ? 0 : 2;
  const std::optional<std::size_t> width = help_width();
  out << (width ? wrap_help(text.str(), *width) : text.str());
  return code;
}

}  // namespace

int run_program(const std::vector<std::string>& given, std::ostream& out, std::ostream& err) {
  const char* level = std::getenv("CANDELA_LOG_LEVEL");
  if (const auto logging =
          log::initialise("candela", level != nullptr && *level != '\0' ? level : "warn", "text");
      !logging.ok())
    return report(err, logging.error().to_string(), logging.error().exit_code());

  Context context{out, err, renderer_facts(), {}, {}};
  const std::unique_ptr<CLI::App> parser = make_parser(context);
  CLI::App& app = *parser;
  if (const auto code = help_on_integrator(given, app, context.facts, out, err)) return *code;
  context.arguments = spell_help(app, given);
  const std::vector<std::string>& arguments = context.arguments;

  if (const std::string unknown = unknown_command(app, arguments); !unknown.empty())
    return report(err, unknown, 2);

  if (const std::string bare = option_without_value(arguments); !bare.empty())
    return report(err,
                  fmt::format("{} has no value (write it as {}VALUE, or leave the option out)",
                              printable(bare), printable(bare)),
                  2);

  try {
    // CLI11 takes the arguments last first, without the program's name.
    std::vector<std::string> reversed;
    if (!arguments.empty()) reversed.assign(arguments.rbegin(), arguments.rend() - 1);
    app.parse(std::move(reversed));
  } catch (const CLI::Success& success) {
    return print_help(app, success, out, err);  // help and version
  } catch (const CLI::ParseError& error) {
    return report(err, explain(app, arguments, error), 2);
  }
  const CLI::App& command = chosen_command(app);
  if (const auto checked = check_text(command); !checked)
    return report(err, checked.error().to_string(), checked.error().exit_code());
  if (!context.command) {
    const std::optional<std::size_t> width = help_width();
    err << (width ? wrap_help(app.help(), *width) : app.help());
    err << command.help();
    return report(err, "no command is given", 2);
  }
  try {
    const Result<int> result = context.command();
    out << std::flush;
    if (!result.ok()) return report(err, result.error().to_string(), result.error().exit_code());
    if (!out) return report(err, "cannot write to standard output", 1);
    return *result;
  } catch (const std::bad_alloc&) {
    return report(err, "out of memory", 1);
  } catch (const std::exception& error) {
    return report(err, fmt::format("internal error: {}", error.what()), 1);
  }
}

}  // namespace candela::client
