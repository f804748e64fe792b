// Rules that several plugins share, and the parts of the table, one function a category.
#pragma once

#include <limits>
#include <string_view>
#include <utility>
#include <vector>

#include "common/description/vocabulary.h"

namespace candela::description::rules {

using enum PropertyType;

constexpr double kNoBound = std::numeric_limits<double>::infinity();

// A parameter whose numbers lie in [low, high].
inline PropertyRule value(std::string_view name, std::vector<PropertyType> types, std::string_view doc,
                          double low = -kNoBound, double high = kNoBound) {
  return {.name = name, .types = std::move(types), .doc = doc, .minimum = low, .maximum = high};
}

inline PropertyRule choice(std::string_view name, std::vector<std::string_view> values,
                           std::string_view doc) {
  return {.name = name, .types = {string}, .values = std::move(values), .doc = doc};
}

inline PropertyRule to_world(std::string_view doc) {
  return value("to_world", {transform}, doc);
}

inline PropertyRule ignored(std::string_view name, std::vector<PropertyType> types, std::string_view doc) {
  return {.name = name, .types = std::move(types), .ignored = true, .doc = doc};
}

inline PropertyRule only(std::string_view name, PropertyType type, std::string_view value,
                         std::string_view doc) {
  return {.name = name, .types = {type}, .doc = doc, .only = value};
}

inline PropertyRule flag(std::string_view name, std::string_view doc) {
  return value(name, {boolean}, doc);
}

inline PropertyRule file(std::string_view doc) {
  return {.name = "filename", .types = {string}, .required = true, .is_file = true, .doc = doc};
}

inline PropertyRule textured(PropertyRule rule) {
  rule.textured = true;
  return rule;
}

inline PropertyRule required(PropertyRule rule) {
  rule.required = true;
  return rule;
}

// The lower bound itself is excluded.
inline PropertyRule above(PropertyRule rule) {
  rule.above_minimum = true;
  return rule;
}

inline PropertyRule positive(std::string_view name, std::string_view doc) {
  return above(value(name, {number}, doc, 0));
}

// A color of a surface: each component in [0, 1], or a texture.
inline PropertyRule reflectance(std::string_view name, std::string_view doc) {
  return textured(value(name, {rgb}, doc, 0, 1));
}

inline PropertyRule non_negative_rgb(std::string_view name, std::string_view doc) {
  return value(name, {rgb}, doc, 0);
}

inline PropertyRule sampling_weight() {
  return ignored("sampling_weight", {number}, "changes only noise");
}

// The field of view of a camera or a projector: fov, fov_axis, focal_length. fov_axis_doc says whose axis it
// is.
inline std::vector<PropertyRule> field_of_view(std::string_view fov_axis_doc) {
  return {above(value("fov", {number}, "field of view in degrees along fov_axis (default from focal_length)",
                      0, 179.999)),
          choice("fov_axis", {"x", "y", "diagonal", "smaller", "larger"}, fov_axis_doc),
          value("focal_length", {string},
                "35 mm equivalent focal length, such as 50mm, if fov is absent (default 50mm)")};
}

inline PropertyRule silhouette() {
  return ignored("silhouette_sampling_weight", {number}, "for differentiable rendering only");
}

// The plugins of one category, and the categories of children that most of them may have.
class Plugins {
 public:
  Plugins(std::vector<PluginRule>& table, std::string_view category,
          std::vector<std::string_view> children = {})
      : table_(table), category_(category), children_(std::move(children)) {}

  void add(std::string_view name, std::string_view doc, std::vector<PropertyRule> properties = {}) {
    add(name, doc, std::move(properties), children_);
  }
  void add(std::string_view name, std::string_view doc, std::vector<PropertyRule> properties,
           std::vector<std::string_view> children, std::string_view differs = {}) {
    table_.push_back({category_, name, std::move(properties), std::move(children), doc, differs});
  }

 private:
  std::vector<PluginRule>& table_;
  std::string_view category_;
  std::vector<std::string_view> children_;
};

void add_integrators(std::vector<PluginRule>& table);
void add_sensors(std::vector<PluginRule>& table);
void add_shapes(std::vector<PluginRule>& table);
void add_bsdfs(std::vector<PluginRule>& table);
void add_old_bsdfs(std::vector<PluginRule>& table);  // those that Mitsuba 0.6 alone has
void add_emitters(std::vector<PluginRule>& table);
void add_textures(std::vector<PluginRule>& table);
void add_spectra(std::vector<PluginRule>& table);
void add_media(std::vector<PluginRule>& table);  // media, phase functions and volumes

}  // namespace candela::description::rules
