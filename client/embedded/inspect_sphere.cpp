// candela inspect sphere: the radiance that arrives at a place, by direction.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <limits>
#include <ostream>

#include "client/embedded/commands.h"
#include "client/embedded/inspect_farm.h"
#include "client/embedded/inspect_figures.h"
#include "client/embedded/inspect_scene.h"
#include "client/output.h"
#include "client/scene_name.h"
#include "client/values.h"
#include "common/base/files.h"
#include "common/image/false_color.h"
#include "common/image/image.h"
#include "common/job/tools.h"
#include "common/wire/json_values.h"
#include "worker/inspect/radiance.h"

namespace candela::client {
namespace {

using inspect::MapRequest;
using inspect::Probe;
using inspect::RadianceMap;
using wire::Json;

struct SphereOptions {
  InspectOptions inspect;
  FarmOptions farm;
  std::optional<std::string> at, pixel, radius, map_size, spp, output, png, lobe, lobe_size, map;
  bool disc = false, logarithmic = false, json = false, quiet = false;
};

// The options that can be read without the scene.
struct Choice {
  std::optional<Vec3d> at;
  std::optional<std::pair<std::uint32_t, std::uint32_t>> pixel;
  double radius = 0;
  std::optional<double> lobe_size;
  MapRequest request;
  image::ColorMap map = image::ColorMap::viridis;
};

constexpr double kLargest = 1e30;

Result<void> choose_place(const SphereOptions& options, Choice& choice) {
  if (options.at.has_value() == options.pixel.has_value())
    return usage_error(options.at ? "--at and --pixel exclude each other" : "no place is given")
        .with_field(options.at ? "--pixel" : "--at")
        .with_mend("give one of --at x,y,z and --pixel x,y");
  if (options.disc && options.at)
    return usage_error("a disc lies on the surface that a pixel shows")
        .with_field("--disc")
        .with_mend("give --pixel x,y in place of --at");
  if (options.at) {
    CANDELA_ASSIGN(const std::vector<double> p, parse_numbers(*options.at, "--at", 3, -kLargest, kLargest));
    choice.at = Vec3d{p[0], p[1], p[2]};
  } else {
    CANDELA_ASSIGN(const std::vector<double> p, parse_numbers(*options.pixel, "--pixel", 2, 0, 1e6));
    if (p[0] != std::floor(p[0]) || p[1] != std::floor(p[1]))
      return usage_error(fmt::format("'{}' is no pixel", printable(*options.pixel))).with_field("--pixel");
    choice.pixel = {static_cast<std::uint32_t>(p[0]), static_cast<std::uint32_t>(p[1])};
  }
  CANDELA_TRY(set_if_given(choice.radius, options.radius, "--radius", parse_number, 0, kLargest));
  return {};
}

Result<Choice> choose(const SphereOptions& options) {
  Choice choice;
  CANDELA_TRY(choose_place(options, choice));
  if (options.map_size) {
    CANDELA_ASSIGN(const Size size, parse_size(*options.map_size, "--map-size"));
    choice.request.width = size.width;
    choice.request.height = size.height;
  }
  CANDELA_TRY(set_if_given(choice.request.spp, options.spp, "--spp", parse_count, 1, 1u << 30));
  CANDELA_TRY(set_if_given(choice.lobe_size, options.lobe_size, "--lobe-size", parse_number,
                           std::numeric_limits<float>::min(), kLargest));
  if (options.map) {
    CANDELA_ASSIGN(const std::string name, parse_choice(*options.map, "--map", image::kColorMapNames));
    choice.map = *image::color_map_of(name);
  }
  if (!options.output && !options.png && !options.lobe)
    return usage_error("no output is given")
        .with_field("--output")
        .with_mend("give -o FILE.exr, --png FILE.png or --lobe FILE.ply");
  if (options.output) CANDELA_TRY(check_output_path(*options.output, ".exr", "--output"));
  if (options.png) CANDELA_TRY(check_output_path(*options.png, ".png", "--png"));
  if (options.lobe) CANDELA_TRY(check_output_path(*options.lobe, ".ply", "--lobe"));
  return choice;
}

Result<Probe> probe_of(const Choice& choice, const SphereOptions& options, const OpenedScene& opened) {
  const inspect::Session& session = *opened.session;
  if (choice.at) {
    Probe probe;
    probe.center = Vec3(*choice.at - session.scene().offset());
    probe.radius = choice.radius;
    return probe;
  }
  CANDELA_TRY(check_projection(opened, "--pixel"));
  const auto [x, y] = *choice.pixel;
  const JobSettings& job = session.settings();
  if (x >= job.width || y >= job.height)
    return usage_error(fmt::format("pixel {},{} is not on the film of {}x{}", x, y, job.width, job.height))
        .with_field("--pixel");
  auto found = inspect::probe_of_pixel(session, x, y);
  if (!found) return std::move(found).error().with_field("--pixel");
  found->radius = choice.radius;
  if (!options.disc) found->normal.reset();
  return found;
}

Json color_json(Vec3d v) {
  return Json::array({v.x, v.y, v.z});
}

double luminance_of(Vec3d v) {
  return 0.212671 * v.x + 0.715160 * v.y + 0.072169 * v.z;
}

void print(Context& context, const SphereOptions& options, const RadianceMap& map, const Probe& probe,
           const inspect::Session& session) {
  const Vec3d at = session.in_file(probe.center);
  if (options.json) {
    Json json = {{"at", color_json(at)},
                 {"radius", probe.radius},
                 {"normal", probe.normal ? color_json(Vec3d(*probe.normal)) : Json(nullptr)},
                 {"fluence", color_json(map.fluence)},
                 {"irradiance", probe.normal ? color_json(map.irradiance) : Json(nullptr)},
                 {"not_finite", map.not_finite}};
    context.out << wire::json_text(json) << '\n';
    return;
  }
  context.out << fmt::format("at {:.6g},{:.6g},{:.6g}: integral of the radiance {:.4g}", at.x, at.y, at.z,
                             luminance_of(map.fluence));
  if (probe.normal) context.out << fmt::format(", irradiance {:.4g}", luminance_of(map.irradiance));
  if (map.not_finite > 0) context.out << fmt::format("; {} samples not finite", map.not_finite);
  context.out << '\n';
}

// The settings of the job that makes the map (worker/integrators/sphere/settings.h).
JobSettings map_settings(JobSettings job, const MapRequest& request, const inspect::Session& session) {
  const Probe& probe = request.probe;
  const Vec3d at = session.in_file(probe.center), normal(probe.normal.value_or(Vec3{}));
  for (const auto& [name, value] : {std::pair<const char*, double>{"x", at.x},
                                    {"y", at.y},
                                    {"z", at.z},
                                    {"radius", probe.radius},
                                    {"normal_x", normal.x},
                                    {"normal_y", normal.y},
                                    {"normal_z", normal.z},
                                    {"error", static_cast<double>(probe.error)}})
    job.integrator_settings[name] = fmt::format("{}", value);
  job.integrator = tools::kSphere;
  job.width = request.width;
  job.height = request.height;
  job.crop.reset();
  job.filter = "box";
  job.filter_settings.clear();
  return job;
}

// Makes the map by a job on a farm. Exit code: 0, the job's, or 128+n where a signal ended the waiting.
Result<int> map_on_farm(Context& context, const SphereOptions& options, const MapRequest& request,
                        const OpenedScene& opened, LoadedScene scene, RadianceMap& map) {
  const inspect::Session& session = *opened.session;
  CANDELA_TRY(inspect::check_medium(session, request.probe));
  InspectJob job{.name = fmt::format("sphere of {}", scene_name(options.inspect.scene.scene)),
                 .settings = map_settings(scene.job.settings, request, session),
                 .iterations = request.spp,
                 .quiet = options.quiet};
  CANDELA_ASSIGN(JobImage made,
                 run_inspect_job(context, options.farm, std::move(job), std::move(scene), session));
  if (made.code != 0) return made.code;
  map.width = made.image.width;
  map.height = made.image.height;
  map.rgb = std::move(made.image.rgb);
  map.not_finite += made.not_finite;
  inspect::integrate_map(request.probe, map);
  return 0;
}

Result<int> run_sphere(Context& context, const SphereOptions& options) {
  CANDELA_ASSIGN(Choice choice, choose(options));
  LoadedScene loaded;
  CANDELA_ASSIGN(const OpenedScene opened, open_for_inspection(context, options.inspect, "path", &loaded));
  CANDELA_TRY(check_no_spot(opened));
  const inspect::Session& session = *opened.session;
  MapRequest& request = choice.request;
  CANDELA_ASSIGN(request.probe, probe_of(choice, options, opened));
  request.threads = opened.threads;
  RadianceMap map;
  if (options.farm.master) {
    CANDELA_ASSIGN(const int code, map_on_farm(context, options, request, opened, std::move(loaded), map));
    if (code != 0) return code;
  } else {
    CANDELA_ASSIGN(map, inspect::map_radiance(session, request));
  }

  std::vector<float> values;
  for (std::size_t i = 0; i < map.rgb.size(); i += 3)
    values.push_back(luminance({map.rgb[i], map.rgb[i + 1], map.rgb[i + 2]}));
  image::ColorScale scale;
  if (auto found = image::percentile_scale(values, 0, 100, options.logarithmic, false); found.ok())
    scale = *found;
  else if (options.logarithmic)
    scale.logarithmic = true, scale.low = 0.1;  // all is black
  if (!options.logarithmic) scale.low = 0;
  if (!(scale.high > scale.low)) scale.high = scale.low + 1;

  if (options.output) {
    CANDELA_ASSIGN(const std::string exr, image::encode_exr(map.width, map.height, map.rgb, {}));
    CANDELA_TRY(write_file_atomically(*options.output, exr));
  }
  if (options.png) {
    const image::Figure figure =
        image::draw_false_color(values, map.width, map.height, choice.map, scale,
                                image::summarize(values, scale), "radiance by direction, luminance");
    CANDELA_ASSIGN(const std::string png, image::encode_png(figure.canvas));
    CANDELA_TRY(write_file_atomically(*options.png, png));
  }
  if (options.lobe) {
    const double natural = request.probe.radius > 0
                               ? request.probe.radius
                               : static_cast<double>(session.scene().features().radius) / 10;
    CANDELA_TRY(write_file_atomically(*options.lobe,
                                      lobe_ply(map, session.in_file(request.probe.center),
                                               choice.lobe_size.value_or(natural), choice.map, scale.high)));
  }
  print(context, options, map, request.probe, session);
  return 0;
}

}  // namespace

void add_inspect_sphere(CLI::App& inspect, Context& context) {
  auto options = std::make_shared<SphereOptions>();
  CLI::App* sub = inspect.add_subcommand("sphere",
                                         "Show the radiance that arrives at a place from each direction, by "
                                         "path tracing here or on a farm with --master");
  add_inspect_options(*sub, options->inspect);
  add_named_regions(*sub, options->inspect);
  add_text(*sub, "--at", options->at, "Center of the sphere, in world coordinates", "x,y,z");
  add_text(*sub, "--pixel", options->pixel, "In place of --at: the surface that this pixel shows", "x,y");
  sub->add_flag("--disc", options->disc,
                "With --pixel: light that arrives on a disc on the surface, from its visible side");
  add_text(*sub, "--radius", options->radius,
           "Radius of the sphere or disc over which the radiance is averaged (default 0)", "R");
  add_text(*sub, "--map-size", options->map_size, "Size of the map in pixels (default 512x256)", "WxH");
  add_text(*sub, "--spp", options->spp, "Samples per pixel of the map (default 16)", "N");
  add_text(*sub, "-o,--output", options->output,
           "Write the map: latitude and longitude as an envmap has them", "FILE.exr");
  add_text(*sub, "--png", options->png, "Write its luminance through a color map, with a scale", "FILE.png");
  add_text(*sub, "--map", options->map, "Color map: viridis (default), turbo, grey or heat", "MAP");
  sub->add_flag("--log", options->logarithmic, "Use a logarithmic scale");
  add_text(*sub, "--lobe", options->lobe,
           "Write a closed surface whose distance from the place is proportional to the luminance: a PLY of "
           "triangles with vertex colors",
           "FILE.ply");
  add_text(*sub, "--lobe-size", options->lobe_size,
           "Largest distance of that surface; default: the radius, else a tenth of the scene's", "R");
  sub->add_flag("--json", options->json, "Print JSON");
  sub->add_flag("--quiet", options->quiet, "Print no progress");
  add_farm_options(*sub, options->farm);
  set_command(*sub, context, run_sphere, options);
}

}  // namespace candela::client
