// docs/plugins.md, written from the vocabulary: the page cannot say anything else than the loader does.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <span>
#include <utility>

#include "common/description/conductors.h"
#include "common/description/media_presets.h"
#include "common/description/vocabulary.h"

namespace candela::description {
namespace {

constexpr std::string_view introduction = R"(# Plugins

<!-- Generated from common/description/vocabulary.cpp by support_table_markdown(); a test compares the two. -->

The plugins and parameters of [Mitsuba scenes](scenes.md) that Candela knows. `candela check SCENE` prints what this page
says of a scene's own. *Ignored* parameters are accepted because scenes have them, and change nothing in the picture.
*Differs*: the picture is not Mitsuba's. `(0,1]` is the range above 0 and up to 1.
)";

std::string types_of(const PropertyRule& rule) {
  std::string result;
  for (const PropertyType type : rule.types)
    result += fmt::format("{}{}", result.empty() ? "" : "/", name(type));
  if (!rule.textured) return result;
  return result.empty() ? "texture" : result + "/texture";
}

std::string bounds_of(const PropertyRule& rule) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  if (rule.minimum > -infinity && rule.maximum < infinity)
    return fmt::format("{}{},{}]", rule.above_minimum ? '(' : '[', rule.minimum, rule.maximum);
  if (rule.minimum > -infinity) return fmt::format("{}{}", rule.above_minimum ? ">" : "≥", rule.minimum);
  return rule.maximum < infinity ? fmt::format("≤{}", rule.maximum) : "";
}

// The text of a rule, without the parameter's name. An ignored parameter has no type in it.
std::string meaning_of(const PropertyRule& rule) {
  std::string result = !rule.ignored          ? fmt::format(" ({}): ", types_of(rule))
                       : rule.differs.empty() ? ": "
                                              : ": *ignored*: ";
  result += rule.doc;
  if (rule.required) result += "; required";
  if (!rule.values.empty()) {
    std::string values;
    for (const std::string_view value : rule.values)
      values += fmt::format("{}`{}`", values.empty() ? "" : ", ", value);
    result += fmt::format("; {}", values);
  }
  if (!rule.only.empty()) result += fmt::format("; only `{}` for now", rule.only);
  if (const std::string bounds = bounds_of(rule); !rule.ignored && !bounds.empty())
    result += fmt::format("; {}", bounds);
  if (!rule.differs.empty()) result += fmt::format("; *differs*: {}", rule.differs);
  return result;
}

// A line of the page: parameters of one meaning.
struct Line {
  bool ignored;
  std::string meaning;
  std::vector<std::string_view> names;
};
using Lines = std::vector<Line>;

void add(Lines& lines, const PropertyRule& rule) {
  const std::string meaning = meaning_of(rule);
  const bool ignored = rule.ignored && rule.differs.empty();
  const auto same = std::ranges::find_if(
      lines, [&](const Line& line) { return line.ignored == ignored && line.meaning == meaning; });
  if (same != lines.end())
    same->names.push_back(rule.name);
  else
    lines.push_back({.ignored = ignored, .meaning = meaning, .names = {rule.name}});
}

std::string quoted(std::span<const std::string_view> names) {
  std::string result;
  for (const std::string_view name : names) result += fmt::format("{}`{}`", result.empty() ? "" : ", ", name);
  return result;
}

// A list of what counts, then one item of what is ignored.
std::string markdown(const Lines& lines) {
  std::string result, ignored;
  for (const Line& line : lines) {
    const std::string text = quoted(line.names) + line.meaning;
    if (line.ignored)
      ignored += fmt::format("{}{}", ignored.empty() ? "" : "; ", text);
    else
      result += fmt::format("- {}\n", text);
  }
  if (!ignored.empty()) result += fmt::format("- *Ignored*: {}\n", ignored);
  return result.empty() ? "" : "\n" + result;
}

// Parameters that several plugins of a category have with one meaning stand once, before the plugins.
class SharedParameters {
 public:
  explicit SharedParameters(std::span<const PluginRule> category) {
    std::map<std::pair<std::string_view, std::string>, std::size_t> counts;
    for (const PluginRule& plugin : category)
      for (const PropertyRule& rule : plugin.properties) ++counts[{rule.name, meaning_of(rule)}];
    std::map<std::string_view, std::size_t> most;
    for (const auto& [key, count] : counts) most[key.first] = std::max(most[key.first], count);
    for (const PluginRule& plugin : category)
      for (const PropertyRule& rule : plugin.properties) {
        const std::string meaning = meaning_of(rule);
        const std::size_t count = counts[{rule.name, meaning}];
        if (count < 2 || count < most[rule.name] || !meanings_.emplace(rule.name, meaning).second) continue;
        add(count == category.size() ? of_all_ : of_some_, rule);
        if (count == category.size()) all_.insert(rule.name);
      }
  }

  bool has(const PropertyRule& rule) const {
    const auto found = meanings_.find(rule.name);
    return found != meanings_.end() && found->second == meaning_of(rule);
  }
  bool has_of_all(const PropertyRule& rule) const { return has(rule) && all_.contains(rule.name); }

  std::string markdown_of_all() const { return markdown(of_all_); }
  std::string markdown_of_some() const { return markdown(of_some_); }

 private:
  std::map<std::string_view, std::string> meanings_;
  std::set<std::string_view> all_;
  Lines of_all_, of_some_;
};

std::string markdown(std::span<const PluginRule> category) {
  const SharedParameters shared(category);
  std::string page = fmt::format("\n## {}\n", category.front().category);
  if (const std::string text = shared.markdown_of_all(); !text.empty())
    page += fmt::format("\nEvery {} has:\n{}", category.front().category, text);
  if (const std::string text = shared.markdown_of_some(); !text.empty())
    page += fmt::format("\nParameters of several; each plugin names its own after *also*:\n{}", text);
  // Plugins of one text, such as samplers, stand together.
  std::vector<std::pair<std::vector<std::string_view>, std::string>> plugins;
  for (const PluginRule& plugin : category) {
    Lines own;
    std::vector<std::string_view> also;
    for (const PropertyRule& rule : plugin.properties) {
      if (!shared.has(rule))
        add(own, rule);
      else if (!shared.has_of_all(rule))
        also.push_back(rule.name);
    }
    std::string text = fmt::format("{}.\n", plugin.doc);
    if (!plugin.differs.empty()) text += fmt::format("*Differs* from Mitsuba: {}.\n", plugin.differs);
    if (!also.empty()) text += fmt::format("*Also*: {}.\n", quoted(also));
    text += markdown(own);
    const auto same = std::ranges::find(plugins, text, [](const auto& entry) { return entry.second; });
    if (same != plugins.end())
      same->first.push_back(plugin.name);
    else
      plugins.push_back({{plugin.name}, text});
  }
  for (const auto& [names, text] : plugins) page += fmt::format("\n**{}**: {}", quoted(names), text);
  return page;
}

}  // namespace

std::string support_table_markdown() {
  std::string page(introduction);
  const auto other = [](const PluginRule& a, const PluginRule& b) { return a.category != b.category; };
  for (auto rest = vocabulary(); !rest.empty();) {
    const auto end = std::ranges::adjacent_find(rest, other);
    const std::size_t size =
        end == rest.end() ? rest.size() : static_cast<std::size_t>(end - rest.begin()) + 1;
    if (rest.front().category != "scene") page += markdown(rest.first(size));
    rest = rest.subspan(size);
  }
  page += "\n## Indices of refraction by name\n\n";
  std::string names;
  for (const std::string_view index : index_of_refraction_names())
    names += fmt::format("{}{} ({})", names.empty() ? "" : ", ", index, *named_index_of_refraction(index));
  page += names +
          ".\n\n## Conductors by name\n\nMeasured indices of refraction, integrated as Mitsuba's RGB "
          "variants do: ";
  names.clear();
  for (const std::string& conductor : conductor_names())
    names += fmt::format("{}{}", names.empty() ? "" : ", ", conductor);
  page += names +
          ".\n\n## Media by name\n\nBefore version 2, of Jensen et al. 2001 and, from "
          "lowfat milk on, of Narasimhan et al. 2006, whose scattering is reduced by the mean cosine, as in "
          "0.6: ";
  names.clear();
  for (const std::string_view medium : medium_names())
    names += fmt::format("{}{}", names.empty() ? "" : ", ", medium);
  return page + names + ".\n";
}

}  // namespace candela::description
