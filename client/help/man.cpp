// Man pages in the macros of man(7).
#include <fmt/format.h>

#include <algorithm>

#include "client/help/pages.h"
#include "common/base/version.h"

namespace candela::client {
namespace {

// Text as roff reads it back: its escapes, and the characters that it would show as others.
std::string roff(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '\\':
        out += "\\e";
        break;
      case '-':
        out += "\\-";
        break;
      case '\'':
        out += "\\(aq";
        break;
      case '`':
        out += "\\(ga";
        break;
      case '^':
        out += "\\(ha";
        break;
      case '~':
        out += "\\(ti";
        break;
      case '"':
        out += "\\(dq";
        break;
      default:
        out += c;
    }
  }
  // A line that begins with a dot would be a request.
  return out.starts_with('.') ? "\\&" + out : out;
}

std::string bold(std::string_view text) {
  return "\\fB" + roff(text) + "\\fR";
}
std::string italic(std::string_view text) {
  return "\\fI" + roff(text) + "\\fR";
}

std::string page_begin(const std::string& name, const std::string& text) {
  std::string upper;
  for (const char c : name) upper += c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  return fmt::format(".TH {} 1 \"\" \"candela {}\" \"Candela\"\n.SH NAME\n{} \\- {}\n", roff(upper),
                     version(), roff(name), roff(text));
}

std::string term(const OptionEntry& option) {
  std::string names;
  for (const std::string& name : option.names) names += (names.empty() ? "" : ", ") + bold(name);
  if (!option.value.empty()) names += (names.empty() ? "" : " ") + italic(option.value);
  return fmt::format(".TP\n{}\n{}.\n", names, roff(option.text));
}

// "candela-inspect-falsecolor"
std::string page_name(const CommandEntry& command) {
  std::string name = "candela-" + command.name;
  std::replace(name.begin(), name.end(), ' ', '-');
  return name;
}

std::string command_page(const CommandEntry& command) {
  std::string page = page_begin(page_name(command), command.text);
  page += ".SH SYNOPSIS\n" + bold("candela " + command.name);
  for (const OptionEntry& option : command.options)
    if (option.positional())
      page += option.required ? " " + italic(option.value) : " [" + italic(option.value) + "]";
  page += " [" + italic("OPTIONS") + "]\n.SH OPTIONS\n";
  for (const OptionEntry& option : command.options) page += term(option);
  if (!command.examples.empty()) page += ".SH EXAMPLES\n.nf\n";
  for (const std::string& example : command.examples) page += roff(example) + "\n";
  if (!command.examples.empty()) page += ".fi\n";
  return page + ".SH SEE ALSO\n.BR candela (1)\n";
}

std::string main_page(std::span<const CommandEntry> commands) {
  std::string page = page_begin("candela", "render scenes by physically based light transport");
  page += ".SH SYNOPSIS\n" + bold("candela") + " " + italic("COMMAND") + " [" + italic("OPTIONS") +
          "]\n.SH COMMANDS\n";
  for (const CommandEntry& command : commands)
    page += fmt::format(".TP\n.BR {} (1)\n{}.\n", roff(page_name(command)), roff(command.text));
  page += ".SH EXIT STATUS\n";
  constexpr std::pair<std::string_view, std::string_view> codes[] = {
      {"0", "done"},
      {"1", "the job failed or was cancelled, or the farm refused"},
      {"2", "bad usage or input: a retry will not help"},
      {"3", "the master cannot be reached, or is overloaded: try again"},
      {"128+n", "ended by signal n"}};
  for (const auto& [code, text] : codes) page += fmt::format(".TP\n{}\n{}.\n", bold(code), roff(text));
  page += ".SH ENVIRONMENT\n";
  for (const char* name : {"CANDELA_MASTER", "CANDELA_TLS_CERT", "CANDELA_TLS_KEY", "CANDELA_TLS_CA",
                           "CANDELA_INSECURE", "CANDELA_TIMEOUT"})
    page += ".TP\n" + bold(name) + "\nThe option of this name, for commands that talk to a master.\n";
  page += ".TP\n" + bold("CANDELA_CONFIG") + "\nThe configuration file, in place of those below.\n";
  page += ".SH FILES\n";
  for (const char* name : {"~/.config/candela/config.toml", "/etc/candela/config.toml"})
    page +=
        ".TP\n" + italic(name) + "\nSettings, if neither the command line nor the environment has them.\n";
  return page;
}

}  // namespace

std::map<std::string, std::string> man_pages(std::span<const CommandEntry> commands) {
  std::map<std::string, std::string> pages;
  pages["candela.1"] = main_page(commands);
  for (const CommandEntry& command : commands) pages[page_name(command) + ".1"] = command_page(command);
  return pages;
}

}  // namespace candela::client
