#include "common/job/render_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <functional>
#include <map>
#include <optional>
#include <utility>

#include "common/base/shell_words.h"
#include "common/base/text.h"

namespace candela {
namespace {

constexpr std::string_view kNone = "none";  // in place of what the scene asks for

constexpr std::array<std::pair<std::string_view, bool RenderCommand::*>, 4> kFlags{
    {{"--error-layer", &RenderCommand::error_layer},
     {"--variance-layer", &RenderCommand::variance_layer},
     {"--chain-layers", &RenderCommand::chain_layers},
     {"--layers", &RenderCommand::state_layers}}};

bool parse_whole(std::string_view text, auto& value) {
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  return code == std::errc() && end == text.data() + text.size();
}

bool assign(SettingsMap& map, const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0) return false;
  return map.emplace(text.substr(0, equals), text.substr(equals + 1)).second;
}

}  // namespace

std::vector<std::string> words_of(const RenderCommand& command, std::string_view output) {
  const JobSettings& s = command.settings;
  std::vector<std::string> words{"candela", "render",
                                 (command.scene.starts_with('-') ? "./" : "") + command.scene, "-o",
                                 std::string(output)};
  const auto add = [&](const char* option, std::string value) {
    words.emplace_back(option);
    words.push_back(std::move(value));
  };
  for (const auto& [name, value] : command.parameters) add("-D", name + '=' + value);
  // A scene that needs it is read as it was, and others read the same.
  words.emplace_back("--lenient");
  add("--integrator", s.integrator);
  for (const auto& [name, value] : s.integrator_settings) add("--set", name + '=' + value);
  add("--size", s.crop ? fmt::format("{}x{}", s.crop->whole_width, s.crop->whole_height)
                       : fmt::format("{}x{}", s.width, s.height));
  if (s.crop) add("--crop", fmt::format("{},{},{},{}", s.crop->x, s.crop->y, s.width, s.height));
  add("--filter", s.filter);
  add("--sampler", s.sampler);
  add("--seed", fmt::format("{}", s.seed));
  add("--isa", s.isa);
  add("--aov", s.aovs.empty() ? std::string(kNone) : s.aovs);
  add("--layer", s.layers.empty() ? std::string(kNone) : s.layers);
  if (!s.edits.empty()) add("--edits", s.edits);
  add("--indices", command.indices);
  if (!command.half.empty()) add("--half", command.half);
  if (!command.estimator.empty()) add("--estimator", command.estimator);
  for (const auto& [option, layers] : kFlags)
    if (command.*layers) words.emplace_back(option);
  return words;
}

Result<RenderCommand> parse_render_command(std::string_view line) {
  CANDELA_ASSIGN(const std::vector<std::string> words, split_shell_line(line));
  if (words.size() < 3 || words[0] != "candela" || words[1] != "render")
    return input_error("it is not a command of candela render");
  RenderCommand command;
  JobSettings& s = command.settings;
  command.scene = words[2];
  const auto text = [](std::string& to) {
    return [&to](const std::string& value) {
      to = value;
      return !value.empty();
    };
  };
  std::string output;
  std::optional<std::array<std::uint32_t, 4>> crop;
  const std::map<std::string_view, std::function<bool(const std::string&)>> options{
      {"-o", text(output)},
      {"-D", [&](const std::string& value) { return assign(command.parameters, value); }},
      {"--integrator", text(s.integrator)},
      {"--set", [&](const std::string& value) { return assign(s.integrator_settings, value); }},
      {"--size",
       [&](const std::string& value) {
         const std::string_view size(value);
         const std::size_t x = size.find('x');
         return x != std::string_view::npos && parse_whole(size.substr(0, x), s.width) &&
                parse_whole(size.substr(x + 1), s.height);
       }},
      {"--crop",
       [&](std::string_view value) {
         crop.emplace();
         for (std::uint32_t& number : *crop) {
           const std::string_view one = value.substr(0, value.find(','));
           if (!parse_whole(one, number)) return false;
           value.remove_prefix(std::min(value.size(), one.size() + 1));
         }
         return value.empty();
       }},
      {"--filter", text(s.filter)},
      {"--sampler", text(s.sampler)},
      {"--seed", [&](const std::string& value) { return parse_whole(value, s.seed); }},
      {"--isa", text(s.isa)},
      {"--aov",
       [&](const std::string& value) {
         s.aovs = value == kNone ? "" : value;
         return !value.empty();
       }},
      {"--layer",
       [&](const std::string& value) {
         s.layers = value == kNone ? "" : value;
         return !value.empty();
       }},
      {"--edits", text(s.edits)},
      {"--indices", text(command.indices)},
      {"--half", text(command.half)},
      {"--estimator", text(command.estimator)}};
  for (std::size_t i = 3; i < words.size(); ++i) {
    if (words[i] == "--lenient") continue;
    const auto flag =
        std::find_if(kFlags.begin(), kFlags.end(), [&](const auto& each) { return each.first == words[i]; });
    if (flag != kFlags.end()) {
      command.*flag->second = true;
      continue;
    }
    const auto option = options.find(words[i]);
    if (option == options.end())
      return input_error(fmt::format("it has the option '{}'", escape_unprintable(words[i])));
    if (++i == words.size() || !option->second(words[i]))
      return input_error(fmt::format("{} has no value that can be read", option->first));
  }
  if (s.width == 0 || s.height == 0 || command.indices.empty())
    return input_error("it lacks --size or --indices");
  if (crop) {
    s.crop = Crop{(*crop)[0], (*crop)[1], s.width, s.height};
    s.width = (*crop)[2];
    s.height = (*crop)[3];
  }
  return command;
}

}  // namespace candela
