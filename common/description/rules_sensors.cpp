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

void add_samplers(Plugins samplers) {
  PropertyRule seed = ignored("seed", {integer}, "use --seed");
  seed.minimum = 0;
  for (const std::string_view name : {"independent", "stratified", "multijitter", "orthogonal", "ldsampler",
                                      "halton", "hammersley", "sobol"})
    samplers.add(name, "accepted for its sample_count; --sampler chooses the kind; changes only noise",
                 {value("sample_count", {integer},
                        "samples, or mutations, per pixel: --spp of a job without a limit (default 4)", 1,
                        1099511627776.0),
                  seed, ignored("jitter", {boolean}, "use --sampler"),
                  ignored("dimension", {integer}, "0.6: use --sampler"),
                  ignored("scramble", {integer}, "0.6: use --sampler"),
                  ignored("strength", {integer}, "use --sampler")});
}

void add_films(Plugins films) {
  const double most = 65536;
  PropertyRule format = ignored("pixel_format", {string}, "images are linear Rec.709 RGB");
  format.differs = "images have the channels R, G and B: no alpha, no luminance alone";
  format.differs_unless = "rgb";
  PropertyRule gamma = ignored("gamma", {number}, "images are linear");
  gamma.differs = "images are linear whatever the gamma is";
  gamma.differs_unless = "1";
  films.add(
      "hdrfilm",
      "size and reconstruction filter (default gaussian) of the image; 0.6's ldrfilm and mfilm are "
      "read as this, without tone mapping",
      {value("width", {integer}, "pixels (default 768)", 1, most),
       value("height", {integer}, "pixels (default 576)", 1, most),
       value("crop_offset_x", {integer},
             "left edge in pixels of the part of the film that is rendered (default 0)", 0, most),
       value("crop_offset_y", {integer}, "top edge of that part (default 0)", 0, most),
       value("crop_width", {integer}, "width of that part, and of the image (default: the film's)", 1, most),
       value("crop_height", {integer}, "height of that part, and of the image (default: the film's)", 1,
             most),
       ignored("file_format", {string}, "the name of the output decides"), format,
       ignored("component_format", {string}, "images are 32-bit float"),
       ignored("sample_border", {boolean}, "filters are sampled"),
       ignored("compensate", {boolean}, "sums are exact"), gamma,
       ignored("banner", {boolean}, "0.6: no banner is drawn"),
       ignored("attach_log", {boolean}, "0.6: images have metadata"),
       ignored("high_quality_edges", {boolean}, "0.6: filters are sampled")},
      {"rfilter"});
}

void add_filters(Plugins rfilters) {
  const auto width = [](std::string_view name, std::string_view doc) {
    return value(name, {number}, doc, 1e-6, 64);
  };
  rfilters.add("box", "the mean over the pixel", {width("radius", "half width in pixels (default 0.5)")});
  rfilters.add("tent", "linear falloff", {width("radius", "half width in pixels (default 1)")});
  rfilters.add("gaussian", "Gaussian, cut at four standard deviations",
               {width("stddev", "standard deviation in pixels (default 0.5)")});
  const auto spline = [](std::string_view name, std::string_view doc) {
    return value(name, {number}, doc, -8, 8);
  };
  rfilters.add("mitchell", "cubic spline; a compromise between sharpness and ringing",
               {spline("B",
                       "B of Mitchell and Netravali's paper (default 1/3). Mitsuba's "
                       "program reads B and C too, against its manual"),
                spline("C", "C of the paper (default 1/3)")});
  rfilters.add("catmullrom", "cubic spline through its points; sharper, with more ringing", {});
  rfilters.add("lanczos", "windowed sinc",
               {value("lobes", {integer}, "side lobes: the radius in pixels (default 3)", 1, 32)});
}

namespace words = integrator_words;

// The vocabulary checks the minimum of an integer. The renderer checks the maximum, for settings of scene
// files and of command lines alike.
PropertyRule rule_of(const words::IntegerSetting& setting, std::string_view doc) {
  return value(setting.name, {integer}, doc, static_cast<double>(setting.minimum));
}

PropertyRule rule_of(const words::NumberSetting& setting, std::string_view doc) {
  PropertyRule rule = value(setting.name, {number}, doc, setting.minimum, setting.maximum);
  rule.above_minimum = setting.above_minimum;
  return rule;
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
void add(Plugins& integrators, const words::IntegratorWords& integrator, std::string_view doc,
         std::vector<PropertyRule> own = {}) {
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
  integrators.add(integrator.name, doc, std::move(rules));
}

}  // namespace

// The order is that of docs/plugins.md.
void add_integrators(std::vector<PluginRule>& table) {
  Plugins integrators(table, "integrator");
  add(integrators, words::kPath,
      "path tracing with next event estimation and multiple importance sampling, through media too; "
      "the names `volpath`, `volpathmis` and `volpath_simple` mean this one",
      {ignored("use_spectral_mis", {boolean}, "volpathmis: always done")});
  add(integrators, words::kLight, "light tracing; the name `ptracer` means this one",
      {ignored("brute_force", {boolean}, "0.6: connections are always made"),
       ignored("granularity", {integer}, "the farm cuts units")});
  add(integrators, words::kBdpt, "bidirectional path tracing with all techniques",
      {ignored("light_image", {boolean}, "0.6: the plan decides which techniques run"),
       ignored("sample_direct", {boolean}, "0.6: the plan decides which techniques run")});
  add(integrators, words::kPpm, "stochastic progressive photon mapping; the name `sppm` means this one",
      {ignored("photon_count", {integer}, "light paths follow the film: --set light_paths"),
       ignored("initial_radius", {number}, "the first radius follows the scene: --set radius"),
       ignored("granularity", {integer}, "the farm cuts units"),
       ignored("max_passes", {integer}, "use --iterations")});
  add(integrators, words::kBpm, "bidirectional photon mapping");
  add(integrators, words::kVcm, "vertex connection and merging");
  add(integrators, words::kUpbp, "vcm with merges of points and beams in media");
  add(integrators, words::kOptimis, "path tracing with optimal weights of direct light at the first vertex");
  add(integrators, words::kFppm, "photon mapping with radii by F tests");
  add(integrators, words::kCppm, "photon mapping with radii by chi-squared tests of photon counts");
  add(integrators, words::kAppm, "photon mapping with radii that minimize the estimated error");
  add(integrators, words::kVcmplus, "vertex connection and merging with radii by F tests");
  add(integrators, words::kMcppm, "photon mapping with Metropolis chains of visible photons");
  const std::string_view their_own = "use --set";
  const std::vector<PropertyRule> chains = {
      ignored("luminance_samples", {integer}, their_own), ignored("direct_samples", {integer}, their_own),
      ignored("p_large", {number}, their_own),
      flag("two_stage", "chains follow light over the brightness of the image (default true)")};
  std::vector<PropertyRule> over = chains;
  over.push_back(ignored("bidirectional", {boolean}, "0.6: --set over=bdpt or over=path"));
  add(integrators, words::kPssmlt, "Metropolis light transport in primary sample space", std::move(over));
  add(integrators, words::kMmlt, "multiplexed Metropolis light transport", chains);
  std::vector<PropertyRule> flags;
  for (const MutationFlag& one : kMutationFlags)
    flags.push_back(flag(one.name, "0.6: the mutation has a share of 1 if true, and none if false"));
  std::vector<PropertyRule> mutations = chains;
  mutations.insert(mutations.end(), flags.begin(), flags.end());
  mutations.push_back(ignored("lambda", {number}, "0.6: the steps of mutations follow the scene"));
  add(integrators, words::kMlt, "Metropolis light transport in path space", std::move(mutations));
  const std::string_view by_pilot = "0.6: the pilot chooses chains and their length: --set";
  std::vector<PropertyRule> redistribution = {
      ignored("num_chains", {number, integer}, by_pilot), ignored("max_chains", {number, integer}, by_pilot),
      ignored("chain_length", {integer}, by_pilot), ignored("direct_samples", {integer}, their_own),
      ignored("lambda", {number}, "0.6: the steps of mutations follow the scene")};
  redistribution.insert(redistribution.end(), flags.begin(), flags.end());
  add(integrators, words::kErpt, "energy redistribution path tracing: short chains from independent paths",
      std::move(redistribution));
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
  rules.push_back(value("principal_point_offset_x", {number},
                        "offset of the principal point in image widths (default 0)"));
  rules.push_back(value("principal_point_offset_y", {number},
                        "offset of the principal point in image heights (default 0)"));
  return rules;
}

}  // namespace

void add_sensors(std::vector<PluginRule>& table) {
  Plugins sensors(table, "sensor", {"film", "sampler", "medium"});
  std::vector<PropertyRule> pinhole = perspective_properties();
  pinhole.push_back(ignored("focus_distance", {number}, "a pinhole is in focus everywhere"));
  sensors.add("perspective", "pinhole camera", std::move(pinhole));
  std::vector<PropertyRule> lens = perspective_properties();
  lens.push_back(
      required(value("aperture_radius", {number}, "radius of the lens in scene units; 0 is a pinhole", 0)));
  lens.push_back(positive("focus_distance",
                          "distance from the lens to the plane in focus in scene units (default far_clip)"));
  sensors.add("thinlens", "perspective camera with a thin lens: depth of field", std::move(lens));
  std::vector<PropertyRule> parallel =
      sensor_properties(to_world("camera to world; the image spans [-1, 1] along x, times the scale"));
  parallel.push_back(ignored("focus_distance", {number}, "parallel rays have no focus"));
  sensors.add("orthographic", "camera of parallel rays", std::move(parallel));
  sensors.add("irradiancemeter",
              "irradiance at the front of its shape: a sphere, disk, cylinder, rectangle or "
              "mesh; pixels have equal areas on the shape (on a mesh: triangles from top to "
              "bottom); the filter is a box. As in Mitsuba's path tracer, it does not see point, "
              "spot and directional lights and projectors directly",
              {ignored("srf", {rgb}, "colors are weighted as in all images"),
               ignored("shutter_open", {number}, "nothing moves"),
               ignored("shutter_close", {number}, "nothing moves")});
  sensors.add("distant",
              "the mean radiance that leaves the scene in one direction, over a target; the film is 1 x 1, "
              "the filter a box. Light paths do not find a point as target",
              {to_world("the rays go along its +z (default identity)"),
               value("direction", {vector}, "direction of the rays in the world, in place of to_world"),
               value("target", {point},
                     "point that the rays pass, or a <shape> of this name, a rectangle or a disk, which is "
                     "not in the scene (default: a disk across the rays that covers the scene)"),
               ignored("srf", {rgb}, "colors are weighted as in all images"),
               ignored("shutter_open", {number}, "nothing moves"),
               ignored("shutter_close", {number}, "nothing moves")},
              {"film", "sampler", "medium", "shape"});
  add_samplers({table, "sampler"});
  add_films({table, "film"});
  add_filters({table, "rfilter"});
}

}  // namespace candela::description::rules
