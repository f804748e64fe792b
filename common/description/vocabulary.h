// The plugins and properties Candela knows, as one table that drives validation, nearest-name suggestions and
// the scene support page of the docs.
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/nearest_name.h"
#include "common/description/object.h"

namespace candela::description {

struct PropertyRule {
  std::string_view name;
  std::vector<PropertyType> types =
      {};  // accepted; `number` also accepts integer, `rgb` also number and texture children where `textured`
  bool textured = false;  // may be a texture child in this slot instead
  bool any_slot = false;  // the plugin's only texture child, whatever its slot is called
  bool required = false;
  std::vector<std::string_view> values = {};  // of a string: the closed set; empty: any
  bool is_file = false;                       // a string naming a file the bundle must hold
  bool ignored = false;  // accepted for Mitsuba's sake, without effect on the picture here (says why in doc)
  std::string_view doc = {};   // meaning, unit and default, for the docs
  std::string_view only = {};  // where set: any other value (in text form) is refused as not supported yet
  double minimum =
      -std::numeric_limits<double>::infinity();  // bounds of an integer, a number, each component of an rgb
  double maximum = std::numeric_limits<double>::infinity();
  bool above_minimum = false;  // the minimum itself is out of bounds
  // If set: how the picture differs from Mitsuba's when the parameter is given, one sentence without its
  // period; not where it has the value `differs_unless` (in text form).
  std::string_view differs = {};
  std::string_view differs_unless = {};
};

struct PluginRule {
  std::string_view category, name;
  std::vector<PropertyRule> properties;
  std::vector<std::string_view>
      child_categories;  // allowed children (by category), e.g. shape: bsdf, emitter
  std::string_view doc;
  std::string_view differs = {};  // where set: how the plugin's picture differs from Mitsuba's
};

std::span<const PluginRule> vocabulary();
const PluginRule* find_plugin(std::string_view category, std::string_view name);

using candela::edit_distance;
using candela::nearest_name;

// `later`: Mitsuba has it and Candela does not yet; `none`: Mitsuba has no such thing either.
enum class Support { none, later };
Support support_of_category(std::string_view category);
Support support_of_plugin(std::string_view category, std::string_view name);

// The name in the table of what Mitsuba has under several: its volumetric path tracers are `path` here, which
// renders media too.
std::string_view canonical_plugin(std::string_view category, std::string_view name);

// Names of the plugins of a category, of the categories that have plugins, and of a plugin's properties.
std::vector<std::string_view> plugin_names(std::string_view category);
std::vector<std::string_view> category_names();
std::vector<std::string_view> property_names(const PluginRule& plugin);

// Indices of refraction by Mitsuba's names ("bk7", "air"; in any case); nullopt for an unknown one.
std::optional<double> named_index_of_refraction(std::string_view name);
std::vector<std::string_view> index_of_refraction_names();

// The page docs/plugins.md: what the loader understands, from the table it obeys.
std::string support_table_markdown();

}  // namespace candela::description
