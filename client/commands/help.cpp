// candela version, completion, help-markdown and help-man: the program about itself.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <ostream>

#include "client/commands/commands.h"
#include "client/context.h"
#include "client/help/command_tree.h"
#include "client/help/pages.h"
#include "client/json.h"
#include "client/values.h"
#include "common/base/files.h"
#include "common/base/version.h"
#include "common/image/color_map.h"
#include "common/job/aov.h"
#include "common/job/setting_names.h"

namespace candela::client {
namespace {

template <class Names>
std::vector<std::string> words(const Names& names) {
  return {names.begin(), names.end()};
}

// "key=" for the settings of all integrators.
std::vector<std::string> setting_words(const RendererFacts& facts) {
  std::vector<std::string> out;
  for (const std::string& integrator : facts.integrator_names()) {
    const auto names = facts.setting_names(integrator);
    if (!names) continue;
    for (const std::string& name : *names) out.push_back(name + "=");
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

// Layers that --aov may name first.
std::vector<std::string> aov_words() {
  std::vector<std::string> out = {"normal", "none"};
  for (int kind = 0; kind <= static_cast<int>(kLastAovKind); ++kind)
    out.emplace_back(name(static_cast<AovKind>(kind)));
  return out;
}

Choices choices(const RendererFacts& facts) {
  return {{"--integrator", facts.integrator_names()},
          {"--set", setting_words(facts)},
          {"--filter", words(kFilterNames)},
          {"--sampler", words(kSamplerNames)},
          {"--isa", words(kIsaNames)},
          {"--aov", aov_words()},
          {"--until", {"relmse="}},
          {"--half", {"A", "B"}},
          {"--map", words(image::kColorMapNames)}};
}

Result<int> write_pages(CLI::App& app, const std::string& folder) {
  CANDELA_TRY(make_directories(folder));
  for (const auto& [name, page] : man_pages(visible_commands(app)))
    CANDELA_TRY(write_file_atomically(std::filesystem::path(folder) / name, page));
  return 0;
}

// A command for those who build or install the program, left out of its help.
CLI::App* add_hidden(CLI::App& app, const char* name, const char* doc) {
  CLI::App* sub = app.add_subcommand(name, doc);
  sub->group("");
  return sub;
}

}  // namespace

void add_version(CLI::App& app, Context& context) {
  auto json = std::make_shared<bool>(false);
  CLI::App* sub = app.add_subcommand("version", "Print version and build");
  sub->add_flag("--json", *json, "Print JSON");
  set_command(*sub, context, [&context, json]() -> Result<int> {
    context.out << (*json ? version_json() : fmt::format("candela {} (build {})", version(), build_id()))
                << '\n';
    return 0;
  });
}

void add_completion(CLI::App& app, Context& context) {
  auto shell = std::make_shared<std::string>();
  CLI::App* sub = app.add_subcommand("completion", "Print a script that completes commands in a shell");
  sub->add_option("shell", *shell, "bash or zsh")->required()->type_name("SHELL");
  set_command(*sub, context, [&app, &context, shell]() -> Result<int> {
    constexpr std::array<std::string_view, 2> shells = {"bash", "zsh"};
    CANDELA_ASSIGN(const std::string name, parse_choice(*shell, "SHELL", shells));
    const auto make = name == "bash" ? bash_completion : zsh_completion;
    context.out << make(visible_commands(app), choices(context.facts));
    return 0;
  });
}

void add_help_markdown(CLI::App& app, Context& context) {
  CLI::App* sub = add_hidden(app, "help-markdown", "Print the reference of all commands as Markdown");
  set_command(*sub, context, [&app, &context]() -> Result<int> {
    context.out << help_markdown(visible_commands(app));
    return 0;
  });
}

void add_help_man(CLI::App& app, Context& context) {
  auto folder = std::make_shared<std::string>();
  CLI::App* sub = add_hidden(app, "help-man", "Write a man page for each command");
  sub->add_option("folder", *folder, "Folder for the pages, such as /usr/local/share/man/man1")
      ->required()
      ->type_name("DIR");
  set_command(*sub, context, [&app, folder] { return write_pages(app, *folder); });
}

}  // namespace candela::client
