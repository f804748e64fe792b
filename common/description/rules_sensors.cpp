// Integrators, sensors, samplers, films and filters, from Mitsuba's documentation: what is here is what
// Candela renders.
#include <fmt/format.h>

#include <iterator>
#include <string>
#include <utility>

#include "common/description/mutation_flags.h"
#include "common/description/rules.h"
#include "common/job/integrator_words.h"

namespace candela::description::rules {

namespace {

void add_samplers(std::vector<PluginRule>& table) {
  for (const std::string_view name : {"independent", "stratified", "multijitter", "orthogonal", "ldsampler",
                                      "halton", "hammersley", "sobol"})
    table.push_back(
        {.category = "sampler",
         .name = name,
         .properties = {{.name = "sample_count",
                         .types = {integer},
                         .doc =
                             "samples, or mutations, per pixel: --spp of a job without a limit (default 4)",
                         .minimum = 1,
                         .maximum = 1099511627776.0},
                        [] {
                          PropertyRule rule = ignored("seed", {integer}, "use --seed");
                          rule.minimum = 0;
                          return rule;
                        }(),
                        ignored("jitter", {boolean}, "use --sampler"),
                        ignored("dimension", {integer}, "0.6: use --sampler"),
                        ignored("scramble", {integer}, "0.6: use --sampler"),
                        ignored("strength", {integer}, "use --sampler")},
         .child_categories = {},
         .doc = "accepted for its sample_count; --sampler chooses the kind; changes only noise"});
}

void add_films(std::vector<PluginRule>& table) {
  const double most = 65536;
  table.push_back(
      {.category = "film",
       .name = "hdrfilm",
       .properties = {{.name = "width",
                       .types = {integer},
                       .doc = "pixels (default 768)",
                       .minimum = 1,
                       .maximum = most},
                      {.name = "height",
                       .types = {integer},
                       .doc = "pixels (default 576)",
                       .minimum = 1,
                       .maximum = most},
                      {.name = "crop_offset_x",
                       .types = {integer},
                       .doc = "left edge in pixels of the part of the film that is rendered (default 0)",
                       .minimum = 0,
                       .maximum = most},
                      {.name = "crop_offset_y",
                       .types = {integer},
                       .doc = "top edge of that part (default 0)",
                       .minimum = 0,
                       .maximum = most},
                      {.name = "crop_width",
                       .types = {integer},
                       .doc = "width of that part, and of the image (default: the film's)",
                       .minimum = 1,
                       .maximum = most},
                      {.name = "crop_height",
                       .types = {integer},
                       .doc = "height of that part, and of the image (default: the film's)",
                       .minimum = 1,
                       .maximum = most},
                      ignored("file_format", {string}, "the name of the output decides"),
                      [] {
                        PropertyRule rule =
                            ignored("pixel_format", {string}, "images are linear Rec.709 RGB");
                        rule.differs = "images have the channels R, G and B: no alpha, no luminance alone";
                        rule.differs_unless = "rgb";
                        return rule;
                      }(),
                      ignored("component_format", {string}, "images are 32-bit float"),
                      ignored("sample_border", {boolean}, "filters are sampled"),
                      ignored("compensate", {boolean}, "sums are exact"),
                      [] {
                        PropertyRule rule = ignored("gamma", {number}, "images are linear");
                        rule.differs = "images are linear whatever the gamma is";
                        rule.differs_unless = "1";
                        return rule;
                      }(),
                      ignored("banner", {boolean}, "0.6: no banner is drawn"),
                      ignored("attach_log", {boolean}, "0.6: images have metadata"),
                      ignored("high_quality_edges", {boolean}, "0.6: filters are sampled")},
       .child_categories = {"rfilter"},
       .doc = "size and reconstruction filter (default gaussian) of the image; 0.6's ldrfilm and mfilm are "
              "read as this, without tone mapping"});
}

void add_filters(std::vector<PluginRule>& table) {
  const auto width = [](std::string_view name, std::string_view doc) {
    return PropertyRule{.name = name, .types = {number}, .doc = doc, .minimum = 1e-6, .maximum = 64};
  };
  table.push_back({.category = "rfilter",
                   .name = "box",
                   .properties = {width("radius", "half width in pixels (default 0.5)")},
                   .child_categories = {},
                   .doc = "the mean over the pixel"});
  table.push_back({.category = "rfilter",
                   .name = "tent",
                   .properties = {width("radius", "half width in pixels (default 1)")},
                   .child_categories = {},
                   .doc = "linear falloff"});
  table.push_back({.category = "rfilter",
                   .name = "gaussian",
                   .properties = {width("stddev", "standard deviation in pixels (default 0.5)")},
                   .child_categories = {},
                   .doc = "Gaussian, cut at four standard deviations"});
  const auto spline = [](std::string_view name, std::string_view doc) {
    return PropertyRule{.name = name, .types = {number}, .doc = doc, .minimum = -8, .maximum = 8};
  };
  table.push_back({.category = "rfilter",
                   .name = "mitchell",
                   .properties = {spline("B",
                                         "B of Mitchell and Netravali's paper (default 1/3). Mitsuba's "
                                         "program reads B and C too, against its manual"),
                                  spline("C", "C of the paper (default 1/3)")},
                   .child_categories = {},
                   .doc = "cubic spline; a compromise between sharpness and ringing"});
  table.push_back({.category = "rfilter",
                   .name = "catmullrom",
                   .properties = {},
                   .child_categories = {},
                   .doc = "cubic spline through its points; sharper, with more ringing"});
  table.push_back({.category = "rfilter",
                   .name = "lanczos",
                   .properties = {{.name = "lobes",
                                   .types = {integer},
                                   .doc = "side lobes: the radius in pixels (default 3)",
                                   .minimum = 1,
                                   .maximum = 32}},
                   .child_categories = {},
                   .doc = "windowed sinc"});
}

namespace words = integrator_words;

// The vocabulary checks the minimum of an integer. The renderer checks the maximum, for settings of scene
// files and of command lines alike.
PropertyRule rule_of(const words::IntegerSetting& setting, std::string_view doc) {
  return {
      .name = setting.name, .types = {integer}, .doc = doc, .minimum = static_cast<double>(setting.minimum)};
}

PropertyRule rule_of(const words::NumberSetting& setting, std::string_view doc) {
  return {.name = setting.name,
          .types = {number},
          .doc = doc,
          .minimum = setting.minimum,
          .maximum = setting.maximum,
          .above_minimum = setting.above_minimum};
}

// PropertyRule keeps a view of its text, so text with defaults in it must last as long as the program.
std::string_view max_depth_doc() {
  static const std::string doc = fmt::format(
      "longest path in edges, -1 for no limit; 1 shows emitters only, 2 direct light (default {})",
      words::kDefaultMaxDepth);
  return doc;
}

std::string_view hide_emitters_doc() {
  static const std::string doc =
      fmt::format("hides directly visible emitters (default {})", words::kHideEmitters.default_value);
  return doc;
}

std::string_view alpha_doc() {
  static const std::string doc =
      fmt::format("squared radii shrink as i^(alpha - 1) (default {}; vcm {}, vcmplus {})",
                  words::kPpm.alpha.text, words::kVcm.alpha.text, words::kVcmplus.alpha.text);
  return doc;
}

// The settings that Mitsuba has too, and Mitsuba's parameters that the farm decides or that have no effect
// here. `own`: parameters of that second kind that this integrator has alone.
PluginRule integrator_rule(const words::IntegratorWords& integrator, std::vector<PropertyRule> own,
                           std::string_view doc) {
  std::vector<PropertyRule> rules = {
      rule_of(words::kMaxDepth, max_depth_doc()),
      rule_of(words::kRrDepth,
              "path depth from which Russian roulette may end a path (default: see the integrator)"),
      flag(words::kHideEmitters.name, hide_emitters_doc()),
      ignored("samples_per_pass", {integer}, "the farm cuts units"),
      ignored("block_size", {integer}, "the farm cuts units"),
      ignored("timeout", {number, integer}, "use --time"),
      flag("strict_normals", "no light crosses the surface by shading normals alone (default false)")};
  if (!integrator.alpha.text.empty()) rules.push_back(rule_of(words::kAlpha, alpha_doc()));
  rules.insert(rules.end(), std::make_move_iterator(own.begin()), std::make_move_iterator(own.end()));
  return {.category = "integrator",
          .name = integrator.name,
          .properties = std::move(rules),
          .child_categories = {},
          .doc = doc};
}

}  // namespace

// The order is that of docs/plugins.md.
void add_integrators(std::vector<PluginRule>& table) {
  table.push_back(integrator_rule(
      words::kPath, {ignored("use_spectral_mis", {boolean}, "volpathmis: always done")},
      "path tracing with next event estimation and multiple importance sampling, through media too; "
      "the names `volpath`, `volpathmis` and `volpath_simple` mean this one"));
  table.push_back(integrator_rule(words::kLight,
                                  {ignored("brute_force", {boolean}, "0.6: connections are always made"),
                                   ignored("granularity", {integer}, "the farm cuts units")},
                                  "light tracing; the name `ptracer` means this one"));
  table.push_back(
      integrator_rule(words::kBdpt,
                      {ignored("light_image", {boolean}, "0.6: the plan decides which techniques run"),
                       ignored("sample_direct", {boolean}, "0.6: the plan decides which techniques run")},
                      "bidirectional path tracing with all techniques"));
  table.push_back(integrator_rule(
      words::kPpm,
      {ignored("photon_count", {integer}, "light paths follow the film: --set light_paths"),
       ignored("initial_radius", {number}, "the first radius follows the scene: --set radius"),
       ignored("granularity", {integer}, "the farm cuts units"),
       ignored("max_passes", {integer}, "use --iterations")},
      "stochastic progressive photon mapping; the name `sppm` means this one"));
  table.push_back(integrator_rule(words::kBpm, {}, "bidirectional photon mapping"));
  table.push_back(integrator_rule(words::kVcm, {}, "vertex connection and merging"));
  table.push_back(integrator_rule(words::kUpbp, {}, "vcm with merges of points and beams in media"));
  table.push_back(integrator_rule(words::kOptimis, {},
                                  "path tracing with optimal weights of direct light at the first vertex"));
  table.push_back(integrator_rule(words::kFppm, {}, "photon mapping with radii by F tests"));
  table.push_back(
      integrator_rule(words::kCppm, {}, "photon mapping with radii by chi-squared tests of photon counts"));
  table.push_back(
      integrator_rule(words::kAppm, {}, "photon mapping with radii that minimize the estimated error"));
  table.push_back(
      integrator_rule(words::kVcmplus, {}, "vertex connection and merging with radii by F tests"));
  table.push_back(
      integrator_rule(words::kMcppm, {}, "photon mapping with Metropolis chains of visible photons"));
  const std::string_view their_own = "use --set";
  const std::vector<PropertyRule> chains = {
      ignored("luminance_samples", {integer}, their_own), ignored("direct_samples", {integer}, their_own),
      ignored("p_large", {number}, their_own),
      flag("two_stage", "chains follow light over the brightness of the image (default false; mlt true)")};
  std::vector<PropertyRule> over = chains;
  over.push_back(ignored("bidirectional", {boolean}, "0.6: --set over=bdpt or over=path"));
  table.push_back(
      integrator_rule(words::kPssmlt, std::move(over), "Metropolis light transport in primary sample space"));
  table.push_back(integrator_rule(words::kMmlt, chains, "multiplexed Metropolis light transport"));
  std::vector<PropertyRule> flags;
  for (const MutationFlag& one : kMutationFlags)
    flags.push_back(flag(one.name, "0.6: the mutation has a share of 1 if true, and none if false"));
  std::vector<PropertyRule> mutations = chains;
  mutations.insert(mutations.end(), flags.begin(), flags.end());
  mutations.push_back(ignored("lambda", {number}, "0.6: the steps of mutations follow the scene"));
  table.push_back(
      integrator_rule(words::kMlt, std::move(mutations), "Metropolis light transport in path space"));
  const std::string_view by_pilot = "0.6: the pilot chooses chains and their length: --set";
  std::vector<PropertyRule> redistribution = {
      ignored("num_chains", {number, integer}, by_pilot), ignored("max_chains", {number, integer}, by_pilot),
      ignored("chain_length", {integer}, by_pilot), ignored("direct_samples", {integer}, their_own),
      ignored("lambda", {number}, "0.6: the steps of mutations follow the scene")};
  redistribution.insert(redistribution.end(), flags.begin(), flags.end());
  table.push_back(integrator_rule(words::kErpt, std::move(redistribution),
                                  "energy redistribution path tracing: short chains from independent paths"));
}

namespace {

// Parameters of all sensors.
std::vector<PropertyRule> sensor_properties(PropertyRule to_world) {
  return {std::move(to_world),
          positive("near_clip", "distance of the near plane along the view in scene units (default 0.01)"),
          positive("far_clip", "distance of the far plane along the view in scene units (default 10000)"),
          ignored("shutter_open", {number}, "nothing moves"),
          ignored("shutter_close", {number}, "nothing moves")};
}

std::vector<PropertyRule> perspective_properties() {
  std::vector<PropertyRule> rules =
      sensor_properties(to_world("camera to world; the camera looks along +z, +y is up, +x to the left"));
  for (PropertyRule& rule : field_of_view("image axis of fov (default x)")) rules.push_back(rule);
  rules.push_back({.name = "principal_point_offset_x",
                   .types = {number},
                   .doc = "offset of the principal point in image widths (default 0)"});
  rules.push_back({.name = "principal_point_offset_y",
                   .types = {number},
                   .doc = "offset of the principal point in image heights (default 0)"});
  return rules;
}

}  // namespace

void add_sensors(std::vector<PluginRule>& table) {
  std::vector<PropertyRule> pinhole = perspective_properties();
  pinhole.push_back(ignored("focus_distance", {number}, "a pinhole is in focus everywhere"));
  table.push_back({.category = "sensor",
                   .name = "perspective",
                   .properties = std::move(pinhole),
                   .child_categories = {"film", "sampler", "medium"},
                   .doc = "pinhole camera"});
  std::vector<PropertyRule> lens = perspective_properties();
  lens.push_back({.name = "aperture_radius",
                  .types = {number},
                  .required = true,
                  .doc = "radius of the lens in scene units; 0 is a pinhole",
                  .minimum = 0});
  lens.push_back(positive("focus_distance",
                          "distance from the lens to the plane in focus in scene units (default far_clip)"));
  table.push_back({.category = "sensor",
                   .name = "thinlens",
                   .properties = std::move(lens),
                   .child_categories = {"film", "sampler", "medium"},
                   .doc = "perspective camera with a thin lens: depth of field"});
  std::vector<PropertyRule> parallel =
      sensor_properties(to_world("camera to world; the image spans [-1, 1] along x, times the scale"));
  parallel.push_back(ignored("focus_distance", {number}, "parallel rays have no focus"));
  table.push_back({.category = "sensor",
                   .name = "orthographic",
                   .properties = std::move(parallel),
                   .child_categories = {"film", "sampler", "medium"},
                   .doc = "camera of parallel rays"});
  table.push_back({.category = "sensor",
                   .name = "irradiancemeter",
                   .properties = {ignored("srf", {rgb}, "colors are weighted as in all images"),
                                  ignored("shutter_open", {number}, "nothing moves"),
                                  ignored("shutter_close", {number}, "nothing moves")},
                   .child_categories = {"film", "sampler", "medium"},
                   .doc = "irradiance at the front of its shape: a sphere, disk, cylinder, rectangle or "
                          "mesh; pixels have equal areas on the shape (on a mesh: triangles from top to "
                          "bottom); the filter is a box. As in Mitsuba's path tracer, it does not see point, "
                          "spot and directional lights and projectors directly"});
  table.push_back(
      {.category = "sensor",
       .name = "distant",
       .properties =
           {to_world("the rays go along its +z (default identity)"),
            {.name = "direction",
             .types = {vector},
             .doc = "direction of the rays in the world, in place of to_world"},
            {.name = "target",
             .types = {point},
             .doc = "point that the rays pass, or a <shape> of this name, a rectangle or a disk, which is "
                    "not in the scene (default: a disk across the rays that covers the scene)"},
            ignored("srf", {rgb}, "colors are weighted as in all images"),
            ignored("shutter_open", {number}, "nothing moves"),
            ignored("shutter_close", {number}, "nothing moves")},
       .child_categories = {"film", "sampler", "medium", "shape"},
       .doc = "the mean radiance that leaves the scene in one direction, over a target; the film is 1 x 1, "
              "the filter a box. Light paths do not find a point as target"});
  add_samplers(table);
  add_films(table);
  add_filters(table);
}

}  // namespace candela::description::rules
