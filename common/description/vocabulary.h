// The plugins and properties Candela knows, as one table that drives validation, nearest-name suggestions and the scene
// support page of the docs.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "common/description/object.h"

namespace candela::description {

struct PropertyRule {
  std::string_view name;
  std::vector<PropertyType> types;          // accepted; `number` also accepts integer, `rgb` also number and texture children where `textured`
  bool textured = false;                    // may be a texture child in this slot instead
  bool required = false;
  std::vector<std::string_view> values;     // of a string: the closed set; empty: any
  bool is_file = false;                     // a string naming a file the bundle must hold
  bool ignored = false;                     // accepted for Mitsuba's sake, without effect on the picture here (says why in doc)
  std::string_view doc;
};

struct PluginRule {
  std::string_view category, name;
  std::vector<PropertyRule> properties;
  std::vector<std::string_view> child_categories;  // allowed children (by category), e.g. shape: bsdf, emitter
  std::string_view doc;
};

std::span<const PluginRule> vocabulary();
const PluginRule* find_plugin(std::string_view category, std::string_view name);

// The known name with the smallest edit distance, or empty if none is near (distance > half the length).
std::string_view nearest_name(std::string_view name, std::span<const std::string_view> known);

}  // namespace candela::description
