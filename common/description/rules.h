// Rules that several plugins share, and the parts of the table, one function a category.
#pragma once

#include <string_view>
#include <utility>
#include <vector>

#include "common/description/vocabulary.h"

namespace candela::description::rules {

using enum PropertyType;

inline PropertyRule to_world(std::string_view doc) {
  return {.name = "to_world", .types = {transform}, .doc = doc};
}

inline PropertyRule ignored(std::string_view name, std::vector<PropertyType> types, std::string_view doc) {
  return {.name = name, .types = std::move(types), .ignored = true, .doc = doc};
}

inline PropertyRule only(std::string_view name, PropertyType type, std::string_view value,
                         std::string_view doc) {
  return {.name = name, .types = {type}, .doc = doc, .only = value};
}

inline PropertyRule flag(std::string_view name, std::string_view doc) {
  return {.name = name, .types = {boolean}, .doc = doc};
}

inline PropertyRule file(std::string_view doc) {
  return {.name = "filename", .types = {string}, .required = true, .is_file = true, .doc = doc};
}

inline PropertyRule textured(PropertyRule rule) {
  rule.textured = true;
  return rule;
}

inline PropertyRule positive(std::string_view name, std::string_view doc) {
  return {.name = name, .types = {number}, .doc = doc, .minimum = 0, .above_minimum = true};
}

// A color of a surface: each component in [0, 1], or a texture.
inline PropertyRule reflectance(std::string_view name, std::string_view doc) {
  return {.name = name, .types = {rgb}, .textured = true, .doc = doc, .minimum = 0, .maximum = 1};
}

inline PropertyRule non_negative_rgb(std::string_view name, std::string_view doc) {
  return {.name = name, .types = {rgb}, .doc = doc, .minimum = 0};
}

inline PropertyRule sampling_weight() {
  return ignored("sampling_weight", {number}, "changes only noise");
}

// The field of view of a camera or a projector: fov, fov_axis, focal_length. fov_axis_doc says whose axis it
// is.
inline std::vector<PropertyRule> field_of_view(std::string_view fov_axis_doc) {
  return {{.name = "fov",
           .types = {number},
           .doc = "field of view in degrees along fov_axis (default from focal_length)",
           .minimum = 0,
           .maximum = 179.999,
           .above_minimum = true},
          {.name = "fov_axis",
           .types = {string},
           .values = {"x", "y", "diagonal", "smaller", "larger"},
           .doc = fov_axis_doc},
          {.name = "focal_length",
           .types = {string},
           .doc = "35 mm equivalent focal length, such as 50mm, if fov is absent (default 50mm)"}};
}

inline PropertyRule silhouette() {
  return ignored("silhouette_sampling_weight", {number}, "for differentiable rendering only");
}

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
