// The table of plugins and parameters, from Mitsuba's documentation: what is here is what Candela renders.
#include "common/description/vocabulary.h"

namespace candela::description {
namespace {

using enum PropertyType;

// ---- parameters that several plugins have ----

PropertyRule to_world(std::string_view doc) {
  return {.name = "to_world", .types = {transform}, .doc = doc};
}

PropertyRule ignored(std::string_view name, std::vector<PropertyType> types, std::string_view doc) {
  return {.name = name, .types = std::move(types), .ignored = true, .doc = doc};
}

PropertyRule only(std::string_view name, PropertyType type, std::string_view value, std::string_view doc) {
  return {.name = name, .types = {type}, .doc = doc, .only = value};
}

PropertyRule flag(std::string_view name, std::string_view doc) {
  return {.name = name, .types = {boolean}, .doc = doc};
}

PropertyRule file(std::string_view doc) {
  return {.name = "filename", .types = {string}, .required = true, .is_file = true, .doc = doc};
}

PropertyRule textured(PropertyRule rule) {
  rule.textured = true;
  return rule;
}

PropertyRule positive(std::string_view name, std::string_view doc) {
  return {.name = name, .types = {number}, .doc = doc, .minimum = 0, .above_minimum = true};
}

// A colour of a surface: each component in [0, 1], or a texture.
PropertyRule reflectance(std::string_view name, std::string_view doc) {
  return {.name = name, .types = {rgb}, .textured = true, .doc = doc, .minimum = 0, .maximum = 1};
}

PropertyRule non_negative_rgb(std::string_view name, std::string_view doc) {
  return {.name = name, .types = {rgb}, .doc = doc, .minimum = 0};
}

PropertyRule sampling_weight() {
  return ignored("sampling_weight", {number},
                 "how often the emitter is chosen: noise only, the mean is the same");
}

PropertyRule silhouette() {
  return ignored("silhouette_sampling_weight", {number}, "for differentiable rendering only");
}

// ---- one function a category ----

void add_integrators(std::vector<PluginRule>& table) {
  table.push_back(
      {.category = "integrator",
       .name = "path",
       .properties =
           {{.name = "max_depth",
             .types = {integer},
             .doc =
                 "longest path in edges, -1 for no limit; 1 shows emitters only, 2 direct light (default -1)",
             .minimum = -1},
            {.name = "rr_depth",
             .types = {integer},
             .doc = "path depth from which Russian roulette may end a path (default 5)",
             .minimum = 1},
            flag("hide_emitters", "directly visible emitters are left out (default false)"),
            only("strict_normals", boolean, "false", "0.6: treatment of inconsistent shading normals"),
            ignored("samples_per_pass", {integer}, "the farm cuts work into units itself"),
            ignored("block_size", {integer}, "the farm cuts work into units itself"),
            ignored("timeout", {number, integer}, "a stop rule belongs to the job: --time")},
       .child_categories = {},
       .doc = "path tracing with next event estimation and multiple importance sampling"});
}

void add_sensors(std::vector<PluginRule>& table) {
  table.push_back(
      {.category = "sensor",
       .name = "perspective",
       .properties =
           {to_world("camera to world; the camera looks along +z, +y is up, +x to the left"),
            {.name = "fov",
             .types = {number},
             .doc = "field of view in degrees along fov_axis (default from focal_length)",
             .minimum = 0,
             .maximum = 179.999,
             .above_minimum = true},
            {.name = "fov_axis",
             .types = {string},
             .values = {"x", "y", "diagonal", "smaller", "larger"},
             .doc = "the image axis fov spans (default x)"},
            {.name = "focal_length",
             .types = {string},
             .doc = "35 mm equivalent focal length, such as 50mm, where fov is absent (default 50mm)"},
            positive("near_clip", "distance of the near plane along the view in scene units (default 0.01)"),
            positive("far_clip", "distance of the far plane along the view in scene units (default 10000)"),
            {.name = "principal_point_offset_x",
             .types = {number},
             .doc = "offset of the principal point in image widths (default 0)"},
            {.name = "principal_point_offset_y",
             .types = {number},
             .doc = "offset of the principal point in image heights (default 0)"},
            ignored("focus_distance", {number}, "a pinhole is in focus everywhere"),
            only("shutter_open", number, "0", "opening of the shutter in seconds"),
            only("shutter_close", number, "0", "closing of the shutter in seconds")},
       .child_categories = {"film", "sampler"},
       .doc = "pinhole camera"});
}

void add_samplers(std::vector<PluginRule>& table) {
  for (const std::string_view name : {"independent", "stratified", "multijitter", "orthogonal", "ldsampler"})
    table.push_back(
        {.category = "sampler",
         .name = name,
         .properties =
             {{.name = "sample_count",
               .types = {integer},
               .doc = "samples a pixel: the job's iterations where no stop rule is given (default 4)",
               .minimum = 1},
              ignored("seed", {integer}, "the seed belongs to the job: --seed"),
              ignored("jitter", {boolean}, "the kind of sampler belongs to the job: --sampler"),
              ignored("dimension", {integer}, "0.6: the kind of sampler belongs to the job: --sampler"),
              ignored("scramble", {integer}, "0.6: the kind of sampler belongs to the job: --sampler")},
         .child_categories = {},
         .doc = "accepted for its sample_count; the kind of sampler belongs to the job (--sampler): noise "
                "only, the "
                "mean is the same"});
}

void add_films(std::vector<PluginRule>& table) {
  const double most = 65536;
  table.push_back(
      {.category = "film",
       .name = "hdrfilm",
       .properties =
           {{.name = "width",
             .types = {integer},
             .doc = "pixels (default 768)",
             .minimum = 1,
             .maximum = most},
            {.name = "height",
             .types = {integer},
             .doc = "pixels (default 576)",
             .minimum = 1,
             .maximum = most},
            only("crop_offset_x", integer, "0", "left edge of the crop window in pixels"),
            only("crop_offset_y", integer, "0", "top edge of the crop window in pixels"),
            {.name = "crop_width", .types = {integer}, .doc = "pixels; only the film's width for now"},
            {.name = "crop_height", .types = {integer}, .doc = "pixels; only the film's height for now"},
            ignored("file_format", {string}, "the output's name decides: .exr or .png"),
            ignored("pixel_format", {string}, "images are linear Rec.709 RGB"),
            ignored("component_format", {string}, "images are 32-bit float"),
            ignored("sample_border", {boolean}, "filters are sampled, so edges need no border"),
            ignored("compensate", {boolean}, "sums are exact always"),
            ignored("banner", {boolean}, "0.6: no banner is ever drawn"),
            ignored("attach_log", {boolean}, "0.6: images carry their own metadata"),
            ignored("high_quality_edges", {boolean}, "0.6: filters are sampled, so edges need no border")},
       .child_categories = {"rfilter"},
       .doc = "the image's size and its reconstruction filter (default filter gaussian); 0.6's ldrfilm is "
              "read as "
              "this, without its tone mapping"});
}

void add_filters(std::vector<PluginRule>& table) {
  table.push_back({.category = "rfilter",
                   .name = "box",
                   .properties = {positive("radius", "half width in pixels (default 0.5)")},
                   .child_categories = {},
                   .doc = "the mean over the pixel"});
  table.push_back({.category = "rfilter",
                   .name = "tent",
                   .properties = {positive("radius", "half width in pixels (default 1)")},
                   .child_categories = {},
                   .doc = "linear falloff"});
  table.push_back({.category = "rfilter",
                   .name = "gaussian",
                   .properties = {positive("stddev", "standard deviation in pixels (default 0.5)")},
                   .child_categories = {},
                   .doc = "Gaussian, cut at four standard deviations"});
}

void add_shapes(std::vector<PluginRule>& table) {
  const std::vector<std::string_view> children = {"bsdf", "emitter"};
  const PropertyRule place = to_world("object to world (default identity)");
  const PropertyRule flip = flag("flip_normals", "normals point the other way (default false)");
  const PropertyRule faceted =
      flag("face_normals", "normals of the file are dropped, triangles look flat (default false)");
  table.push_back(
      {.category = "shape",
       .name = "obj",
       .properties = {file("Wavefront OBJ with triangles and polygons; materials are not read"), place,
                      faceted, flip, flag("flip_tex_coords", "v becomes 1 - v (default true)"), silhouette(),
                      ignored("collapse", {boolean}, "0.6: a file is one shape always")},
       .child_categories = children,
       .doc = "triangle mesh of a Wavefront OBJ file"});
  table.push_back({.category = "shape",
                   .name = "serialized",
                   .properties = {file("Mitsuba's compressed mesh file, versions 3 and 4"),
                                  {.name = "shape_index",
                                   .types = {integer},
                                   .doc = "which mesh of the file, from 0 (default 0)",
                                   .minimum = 0,
                                   .maximum = 4294967295.0},
                                  place,
                                  faceted,
                                  flip,
                                  silhouette()},
                   .child_categories = children,
                   .doc = "triangle mesh of Mitsuba's own format"});
  table.push_back({.category = "shape",
                   .name = "rectangle",
                   .properties = {place, flip, silhouette()},
                   .child_categories = children,
                   .doc = "[-1, 1] x [-1, 1] in the plane z = 0, facing +z"});
  table.push_back({.category = "shape",
                   .name = "cube",
                   .properties = {place, flip, silhouette()},
                   .child_categories = children,
                   .doc = "[-1, 1]^3, facing outside"});
  table.push_back({.category = "shape",
                   .name = "sphere",
                   .properties = {{.name = "center",
                                   .types = {point},
                                   .doc = "in object space, before to_world (default 0, 0, 0)"},
                                  positive("radius", "in object space, before to_world (default 1)"),
                                  place,
                                  flip,
                                  silhouette()},
                   .child_categories = children,
                   .doc = "a true sphere; to_world may not scale it unevenly"});
}

void add_bsdfs(std::vector<PluginRule>& table) {
  const auto index_of_refraction = [](std::string_view name, std::string_view doc) {
    return PropertyRule{
        .name = name, .types = {number, string}, .doc = doc, .minimum = 0, .above_minimum = true};
  };
  const PropertyRule specular = reflectance("specular_reflectance", "scales the reflection (default 1)");
  const PropertyRule eta =
      textured(non_negative_rgb("eta", "real part of the index of refraction (default 0)"));
  const PropertyRule k =
      textured(non_negative_rgb("k", "imaginary part of the index of refraction (default 1)"));
  const PropertyRule material = {.name = "material",
                                 .types = {string},
                                 .values = {"none"},
                                 .doc = "named materials are not supported yet: write eta and k as rgb"};
  table.push_back({.category = "bsdf",
                   .name = "diffuse",
                   .properties = {reflectance("reflectance", "albedo (default 0.5)")},
                   .child_categories = {},
                   .doc = "Lambertian, one-sided"});
  table.push_back(
      {.category = "bsdf",
       .name = "dielectric",
       .properties = {index_of_refraction("int_ior",
                                          "index inside, a number or a name (default bk7, 1.5046)"),
                      index_of_refraction("ext_ior",
                                          "index outside, a number or a name (default air, 1.000277)"),
                      specular, reflectance("specular_transmittance", "scales the transmission (default 1)")},
       .child_categories = {},
       .doc = "smooth glass; the side the normal points to is outside"});
  table.push_back({.category = "bsdf",
                   .name = "conductor",
                   .properties = {eta, k, material, specular},
                   .child_categories = {},
                   .doc = "smooth metal, one-sided; without parameters a perfect mirror"});
  table.push_back(
      {.category = "bsdf",
       .name = "roughconductor",
       .properties =
           {{.name = "distribution",
             .types = {string},
             .values = {"beckmann", "ggx"},
             .doc = "microfacet distribution (default beckmann)"},
            textured(positive("alpha",
                              "roughness along both axes; Beckmann: root mean square slope (default 0.1)")),
            textured(positive("alpha_u",
                              "roughness along the tangent; only together with alpha_v, without alpha")),
            textured(positive("alpha_v",
                              "roughness along the bitangent; only together with alpha_u, without alpha")),
            eta,
            k,
            material,
            specular,
            flag("sample_visible", "sample visible normals only: noise, not the mean (default true)")},
       .child_categories = {},
       .doc = "rough metal after Walter et al. 2007, one-sided"});
  table.push_back({.category = "bsdf",
                   .name = "twosided",
                   .properties = {},
                   .child_categories = {"bsdf"},
                   .doc = "one opaque bsdf for both sides, or two: front, then back"});
}

void add_emitters(std::vector<PluginRule>& table) {
  table.push_back(
      {.category = "emitter",
       .name = "area",
       .properties = {non_negative_rgb("radiance", "W/(m^2 sr), towards the normal's side (default 1)"),
                      sampling_weight()},
       .child_categories = {},
       .doc = "makes its shape a diffuse emitter; only inside a shape"});
  table.push_back({.category = "emitter",
                   .name = "point",
                   .properties = {non_negative_rgb("intensity", "W/sr (default 1)"),
                                  {.name = "position",
                                   .types = {point},
                                   .doc = "in world space; instead of to_world (default 0, 0, 0)"},
                                  to_world("moves the light from the origin"),
                                  sampling_weight()},
                   .child_categories = {},
                   .doc = "shines evenly into all directions"});
  table.push_back(
      {.category = "emitter",
       .name = "directional",
       .properties = {non_negative_rgb("irradiance", "W/m^2 on a plane facing the light (default 1)"),
                      {.name = "direction",
                       .types = {vector},
                       .doc = "that the light travels along; instead of to_world (default 0, 0, 1)"},
                      to_world("turns the direction from +z"),
                      sampling_weight()},
       .child_categories = {},
       .doc = "parallel light from infinitely far"});
  table.push_back({.category = "emitter",
                   .name = "constant",
                   .properties = {non_negative_rgb("radiance", "W/(m^2 sr) (default 1)"), sampling_weight()},
                   .child_categories = {},
                   .doc = "the same light from everywhere"});
  table.push_back(
      {.category = "emitter",
       .name = "envmap",
       .properties = {file("latitude-longitude image, +y up"),
                      {.name = "scale", .types = {number}, .doc = "factor (default 1)", .minimum = 0},
                      to_world("turns the environment (default identity)"),
                      sampling_weight(),
                      ignored("mis_compensation", {boolean},
                              "a way of sampling: noise only, the mean is the same"),
                      only("gamma", number, "-1", "0.6: the file's own encoding decides"),
                      ignored("cache", {boolean}, "0.6: no cache files are written")},
       .child_categories = {},
       .doc = "light from an image at infinity"});
}

void add_textures(std::vector<PluginRule>& table) {
  const PropertyRule to_uv = {
      .name = "to_uv",
      .types = {transform},
      .doc =
          "applied to (u, v, 0, 1) before the lookup; a matrix of 9 values is a 2D one "
          "(default identity)"};
  table.push_back(
      {.category = "texture",
       .name = "bitmap",
       .properties = {file("image; encoded ones (8 and 16 bit) are taken for sRGB"),
                      to_uv,
                      {.name = "filter_type",
                       .types = {string},
                       .values = {"bilinear", "nearest"},
                       .doc =
                           "interpolation (default bilinear); 0.6's ewa and trilinear are read as bilinear"},
                      {.name = "wrap_mode",
                       .types = {string},
                       .values = {"repeat", "mirror", "clamp"},
                       .doc = "outside [0, 1] (default repeat)"},
                      flag("raw", "the values are numbers, not sRGB (default false)"),
                      ignored("format", {string}, "storage only"),
                      ignored("accel", {boolean}, "for GPUs only"),
                      only("gamma", number, "-1", "0.6: the file's own encoding decides"),
                      ignored("max_anisotropy", {number}, "0.6: textures are not prefiltered"),
                      ignored("cache", {boolean}, "0.6: no cache files are written")},
       .child_categories = {},
       .doc = "an image"});
  table.push_back({.category = "texture",
                   .name = "checkerboard",
                   .properties = {{.name = "color0",
                                   .types = {rgb},
                                   .textured = true,
                                   .doc = "of the squares at the origin (default 0.4)",
                                   .minimum = 0,
                                   .maximum = 1},
                                  {.name = "color1",
                                   .types = {rgb},
                                   .textured = true,
                                   .doc = "of the other squares (default 0.2)",
                                   .minimum = 0,
                                   .maximum = 1},
                                  to_uv},
                   .child_categories = {},
                   .doc = "two squares by two in [0, 1]^2"});
}

std::vector<PluginRule> make_table() {
  std::vector<PluginRule> table;
  table.push_back({.category = "scene",
                   .name = "",
                   .properties = {},
                   .child_categories = {"integrator", "sensor", "bsdf", "shape", "emitter", "texture", "film",
                                        "sampler", "rfilter"},
                   .doc = "the root"});
  add_integrators(table);
  add_sensors(table);
  add_samplers(table);
  add_films(table);
  add_filters(table);
  add_shapes(table);
  add_bsdfs(table);
  add_emitters(table);
  add_textures(table);
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
