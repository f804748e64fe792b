// The table of plugins and parameters, joined from its parts (rules_*.cpp).
#include "common/description/vocabulary.h"

#include "common/description/rules.h"

namespace candela::description {
namespace {

std::vector<PluginRule> make_table() {
  std::vector<PluginRule> table;
  table.push_back({.category = "scene",
                   .name = "",
                   .properties = {},
                   .child_categories = {"integrator", "sensor", "bsdf", "shape", "emitter", "texture", "film",
                                        "sampler", "rfilter", "medium", "phase", "volume"},
                   .doc = "the root"});
  rules::add_integrators(table);
  rules::add_sensors(table);
  rules::add_shapes(table);
  rules::add_bsdfs(table);
  rules::add_emitters(table);
  rules::add_textures(table);
  rules::add_spectra(table);
  rules::add_media(table);
  return table;
}

}  // namespace

std::span<const PluginRule> vocabulary() {
  static const std::vector<PluginRule> table = make_table();
  return table;
}

const PluginRule* find_plugin(std::string_view category, std::string_view name) {
  for (const PluginRule& plugin : vocabulary())
    if (plugin.category == category && plugin.name == name) return &plugin;
  return nullptr;
}

std::vector<std::string_view> plugin_names(std::string_view category) {
  std::vector<std::string_view> names;
  for (const PluginRule& plugin : vocabulary())
    if (plugin.category == category) names.push_back(plugin.name);
  return names;
}

std::vector<std::string_view> category_names() {
  std::vector<std::string_view> names;
  for (const PluginRule& plugin : vocabulary())
    if (names.empty() || names.back() != plugin.category) names.push_back(plugin.category);
  return names;
}

std::vector<std::string_view> property_names(const PluginRule& plugin) {
  std::vector<std::string_view> names;
  for (const PropertyRule& property : plugin.properties) names.push_back(property.name);
  return names;
}

}  // namespace candela::description
