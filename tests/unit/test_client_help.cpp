// Tests the descriptions of the program: examples, shell completion, man pages.
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "client/context.h"
#include "client/embedded/app.h"
#include "client/embedded/commands.h"
#include "client/help/command_tree.h"
#include "tests/temporary_folder.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;

std::string output_of_program(const std::vector<std::string>& arguments) {
  std::vector<std::string> all = {"candela"};
  all.insert(all.end(), arguments.begin(), arguments.end());
  std::ostringstream out, err;
  EXPECT_EQ(run_program(all, out, err), 0) << err.str();
  return out.str();
}

// Both outputs of a command of the shell; the exit code in its last line.
std::string shell(const std::string& command) {
  std::string text;
  std::FILE* pipe = ::popen(("{ " + command + "; } 2>&1; echo \"exit $?\"").c_str(), "r");
  std::array<char, 4096> buffer{};
  while (pipe != nullptr && std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) text += buffer.data();
  if (pipe != nullptr) ::pclose(pipe);
  return text;
}

bool has_program(const std::string& name) {
  return shell("command -v " + name + " >/dev/null") == "exit 0\n";
}

std::vector<CommandEntry> commands_of_program() {
  std::ostringstream out, err;
  Context context{out, err, renderer_facts(), {}, {}};
  return visible_commands(*make_parser(context));
}

// The words of a command line.
std::vector<std::string> split(const std::string& text) {
  std::istringstream line(text);
  return {std::istream_iterator<std::string>(line), {}};
}
std::vector<std::string> operator+(std::vector<std::string> a, const std::vector<std::string>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

// Claim: every command has an example, which its --help and the reference show, and which the program's own
// parser takes.
TEST(Help, ExamplesOfAllCommandsParse) {
  const std::string reference = output_of_program({"help-markdown"});
  for (const CommandEntry& command : commands_of_program()) {
    ASSERT_FALSE(command.examples.empty()) << command.name;
    const std::string help = output_of_program(split(command.name) + std::vector<std::string>{"--help"});
    for (const std::string& example : command.examples) {
      EXPECT_NE(help.find("\n  " + example + "\n"), std::string::npos) << help;
      EXPECT_NE(reference.find("\n    " + example + "\n"), std::string::npos) << example;
      EXPECT_TRUE((example + " ").starts_with("candela " + command.name + " ")) << example;
      const std::vector<std::string> words = split(example.substr(0, example.find(" > ")));
      ASSERT_GE(words.size(), 2U);
      std::ostringstream out, err;
      Context context{out, err, renderer_facts(), {}, {}};
      const auto parser = make_parser(context);
      EXPECT_NO_THROW(parser->parse(std::vector<std::string>(words.rbegin(), words.rend() - 1))) << example;
      EXPECT_TRUE(context.command) << example;
    }
  }
}

// The options that a section of the reference names: each by itself, or within a range such as `--size` to
// `--isa` of the options of several commands.
std::set<std::string> options_named(const std::string& section, const std::string& shared) {
  const auto matches = [](const std::string& text, const std::string& pattern) {
    const std::regex regex(pattern);
    return std::vector<std::smatch>(std::sregex_iterator(text.begin(), text.end(), regex), {});
  };
  std::vector<std::string> order;
  for (const std::smatch& row : matches(shared, "- `(?:-\\w, ?)?(--[a-z-]+)[^`]*`: "))
    order.push_back(row[1]);
  std::set<std::string> names;
  for (const std::smatch& name : matches(section, "--[a-z-]+")) names.insert(name[0]);
  for (const std::smatch& range : matches(section, "`(--[a-z-]+)` to `(--[a-z-]+)`")) {
    const auto first = std::ranges::find(order, range[1].str()),
               last = std::ranges::find(order, range[2].str());
    EXPECT_LT(first, last) << range[0];
    if (last != order.end()) names.insert(first, std::next(last));
  }
  return names;
}

// Claim: the reference names every option in the section of its command, and says what it means: there, or
// once among the options of several commands.
TEST(Help, ReferenceHasEveryOptionOfEveryCommand) {
  const std::string reference = output_of_program({"help-markdown"});
  const auto section = [&](const std::string& title) {
    const std::size_t begin = reference.find("\n## " + title + "\n");
    if (begin == std::string::npos) return std::string();
    return reference.substr(begin, reference.find("\n## ", begin + 1) - begin);
  };
  const std::string shared = section("Options of several commands");
  for (const CommandEntry& command : commands_of_program()) {
    const std::string own = section("candela " + command.name);
    const std::set<std::string> named = options_named(own, shared);
    for (const OptionEntry& option : command.options) {
      const std::string name = option.positional() ? option.value : option.names.back();
      EXPECT_TRUE(option.positional() ? own.find(name) != std::string::npos : named.contains(name))
          << command.name << " " << name;
      const std::string meaning = "`: " + option.text + "\n";
      EXPECT_TRUE(own.find(meaning) != std::string::npos || shared.find(meaning) != std::string::npos)
          << command.name << " " << name;
    }
  }
}

class Completion : public ::testing::Test {
 protected:
  void write_script(const std::string& name) {
    script_ = folder_.path() / ("candela." + name);
    std::ofstream(script_) << output_of_program({"completion", name});
  }
  // The words that bash offers for the last of `words`, one a line.
  std::string complete(const std::vector<std::string>& words) const {
    std::string list;
    for (const std::string& word : words) list += " '" + word + "'";
    return shell(
        "cd '" + folder_.path().string() + "' && bash -c '. \"" + script_.string() +
        "\"; COMP_WORDS=(\"$@\"); COMP_CWORD=$(($# - 1)); _candela; printf \"%s\\n\" \"${COMPREPLY[@]}\"' -" +
        list);
  }

  test::TemporaryFolder folder_;
  fs::path script_;
};

// Claim: bash accepts the script, and completes commands, options, values of closed sets, and files.
TEST_F(Completion, Bash) {
  write_script("bash");
  EXPECT_EQ(shell("bash -n '" + script_.string() + "'"), "exit 0\n");
  EXPECT_EQ(complete({"candela", "ren"}), "render\nexit 0\n");
  EXPECT_EQ(complete({"candela", "render", "--integ"}), "--integrator\nexit 0\n");
  EXPECT_EQ(complete({"candela", "render", "--integrator", "pss"}), "pssmlt\nexit 0\n");
  EXPECT_EQ(complete({"candela", "submit", "--integrator", "=", "pss"}), "pssmlt\nexit 0\n");
  EXPECT_EQ(complete({"candela", "render", "--set", "rr_"}), "rr_depth=\nexit 0\n");
  EXPECT_EQ(complete({"candela", "render", "--aov", "alb"}), "albedo\nexit 0\n");
  EXPECT_EQ(complete({"candela", "fetch", "j1", "--half", ""}), "A\nB\nexit 0\n");
  EXPECT_EQ(complete({"candela", "completion", ""}), "bash\nzsh\nexit 0\n");
  EXPECT_EQ(complete({"candela", "render", "--seed", ""}), "\nexit 0\n");
  EXPECT_EQ(complete({"candela", "insp"}), "inspect\nexit 0\n");
  EXPECT_EQ(complete({"candela", "inspect", "fal"}), "falsecolor\nexit 0\n");
  EXPECT_EQ(complete({"candela", "inspect", "falsecolor", "--map", "vi"}), "viridis\nexit 0\n");
  std::ofstream(folder_.path() / "a scene.xml") << "";
  EXPECT_EQ(complete({"candela", "render", "a s"}), "a scene.xml\nexit 0\n");
  EXPECT_EQ(complete({"candela", "render", "x.xml", "-o", "a s"}), "a scene.xml\nexit 0\n");
  // Every option of every command, in one shell, as at a terminal: each has the words that come before its
  // own.
  std::string lines, expected;
  for (const CommandEntry& command : commands_of_program())
    for (const OptionEntry& option : command.options)
      if (!option.positional()) {
        const std::string line = "candela " + command.name + " " + option.names.back();
        lines += line + "\n";
        expected += line + " offered\n";
      }
  std::ofstream(folder_.path() / "lines") << lines;
  EXPECT_EQ(shell("cd '" + folder_.path().string() + "' && bash -c '. \"" + script_.string() +
                  "\"; while read -r -a COMP_WORDS; do COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); COMPREPLY=(); "
                  "_candela; for offered in \"${COMPREPLY[@]}\"; do "
                  "[ \"$offered\" = \"${COMP_WORDS[-1]}\" ] && echo \"${COMP_WORDS[@]} offered\"; done; "
                  "done < lines'"),
            expected + "exit 0\n");
}

// Claim: ids come from the farm's lists; a job whose id is no plain word is not offered, and nothing of it is
// run.
TEST_F(Completion, IdsAreNotRun) {
  write_script("bash");
  const fs::path program = folder_.path() / "candela";
  std::ofstream(program) << "#!/bin/sh\necho 'ID STATE'\necho 'j1 done'\necho '$(touch${IFS}harm) done'\n";
  fs::permissions(program, fs::perms::owner_all);
  const std::string path = "PATH='" + folder_.path().string() + "':$PATH; ";
  const std::string offered = shell(
      path + "cd '" + folder_.path().string() + "'; bash -c '. \"" + script_.string() +
      "\"; COMP_WORDS=(candela show \"\"); COMP_CWORD=2; _candela; printf \"%s\\n\" \"${COMPREPLY[@]}\"'");
  EXPECT_EQ(offered, "j1\nexit 0\n");
  EXPECT_FALSE(fs::exists(folder_.path() / "harm"));
}

// Claim: zsh accepts the script, and to source it completes the command.
TEST_F(Completion, Zsh) {
  if (!has_program("zsh")) GTEST_SKIP() << "there is no zsh";
  write_script("zsh");
  EXPECT_EQ(shell("zsh -n '" + script_.string() + "'"), "exit 0\n");
  const std::string sourced = "zsh -fc 'autoload -Uz compinit; compinit -u -D; . \"" + script_.string() +
                              "\"; echo $_comps[candela]'";
  EXPECT_EQ(shell(sourced), "_candela\nexit 0\n");
}

// Claim: roff formats the man page of every command without a warning, and shows its options and examples as
// they are typed.
TEST(ManPages, AreFormattedWithoutWarning) {
  if (!has_program("groff")) GTEST_SKIP() << "there is no groff";
  const test::TemporaryFolder folder;
  output_of_program({"help-man", folder.path().string()});
  const auto commands = commands_of_program();
  const std::string format = "groff -man -ww -Tascii -P-cbou '" + folder.path().string() + "/";
  EXPECT_EQ(shell(format + "candela.1' >/dev/null"), "exit 0\n");
  for (const CommandEntry& command : commands) {
    std::string file = command.name;
    std::replace(file.begin(), file.end(), ' ', '-');
    const std::string page = format + "candela-" + file + ".1'";
    EXPECT_EQ(shell(page + " >/dev/null"), "exit 0\n") << command.name;
    const std::string text = shell(page);
    for (const OptionEntry& option : command.options)
      for (const std::string& name : option.names)
        EXPECT_NE(text.find(name), std::string::npos) << command.name << " " << name;
    for (const std::string& example : command.examples)
      EXPECT_NE(text.find(example.substr(0, 60)), std::string::npos) << text;
  }
}

}  // namespace
}  // namespace candela::client
