// candela inspect volume: the light of the image in space, on a grid.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <ostream>

#include "client/embedded/commands.h"
#include "client/embedded/inspect_farm.h"
#include "client/embedded/inspect_scene.h"
#include "client/embedded/volume_figures.h"
#include "client/output.h"
#include "client/scene_name.h"
#include "client/values.h"
#include "common/base/files.h"
#include "common/base/memory_limit.h"
#include "common/job/tools.h"
#include "common/wire/json_values.h"
#include "worker/inspect/path_sampling.h"
#include "worker/inspect/volume.h"
#include "worker/integrators/volume/cell_film.h"
#include "worker/loaders/volume_output.h"

namespace candela::client {
namespace {

using inspect::CellGrid;
using inspect::VolumeReport;
using inspect::VolumeRequest;
using wire::Json;

struct VolumeOptions {
  InspectOptions inspect;
  FarmOptions farm;
  std::optional<std::string> box, resolution, pixels, spp, output, png, slices, axis, map;
  bool eye_edges = false, logarithmic = false, json = false, quiet = false;
};

// The numbers beside the grid.
struct VolumeNumbers {
  Vec3d mean, crossing;                        // as VolumeReport has them
  std::optional<std::uint64_t> contributions;  // not known of a job
  std::uint64_t not_finite = 0, too_large = 0;
};

// The options that can be read without the scene.
struct VolumeChoice {
  VolumeRequest request;
  std::optional<inspect::PixelRect> pixels;
  VolumePictures pictures;
  bool vdb = false;
};

constexpr double kFarthest = 1e30;
constexpr std::uint64_t kMaxCells = 65536;  // along an axis
constexpr std::uint64_t kUsualCells = 64;

Result<void> choose_box(const VolumeOptions& options, CellGrid& grid) {
  CANDELA_ASSIGN(const std::vector<double> n, parse_numbers(*options.box, "--box", 6, -kFarthest, kFarthest));
  grid.low = {n[0], n[1], n[2]};
  grid.high = {n[3], n[4], n[5]};
  const Vec3 low(grid.low), high(grid.high);  // as files have them
  if (!(low.x < high.x) || !(low.y < high.y) || !(low.z < high.z))
    return usage_error(fmt::format("the box '{}' is empty", printable(*options.box)))
        .with_field("--box")
        .with_mend("give the lower corner first, then a higher one: x0,y0,z0,x1,y1,z1");
  return {};
}

Result<void> choose_resolution(const VolumeOptions& options, CellGrid& grid) {
  const std::string text = options.resolution.value_or(std::to_string(kUsualCells));
  std::vector<std::uint64_t> counts;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    CANDELA_ASSIGN(const std::uint64_t count,
                   parse_count(text.substr(begin, end - begin), "--resolution", 1, kMaxCells));
    counts.push_back(count);
    begin = end + 1;
  }
  if (counts.size() != 1 && counts.size() != 3)
    return usage_error(fmt::format("'{}' has {} numbers, not 1 or 3", printable(text), counts.size()))
        .with_field("--resolution")
        .with_mend("give the cells along the longest edge, or nx,ny,nz");
  const Vec3d edges = grid.high - grid.low;
  const double longest = std::max({edges.x, edges.y, edges.z});
  for (std::size_t a = 0; a < 3; ++a) {
    const double share = edges[static_cast<int>(a)] / longest * static_cast<double>(counts[0]);
    grid.size[a] = counts.size() == 3 ? static_cast<std::uint32_t>(counts[a])
                                      : static_cast<std::uint32_t>(std::max(1.0, std::round(share)));
  }
  const std::uint64_t bytes = inspect::volume_bytes(grid), most = memory_limit_bytes() / 2;
  if (bytes > most)
    return resource_error(fmt::format("a grid of {}x{}x{} cells takes {}, more than half of the memory, {}",
                                      grid.size[0], grid.size[1], grid.size[2], format_bytes(bytes),
                                      format_bytes(most)))
        .with_field("--resolution")
        .with_mend("give fewer cells");
  return {};
}

Result<void> choose_volume_outputs(const VolumeOptions& options, VolumeChoice& choice) {
  if (!options.output && !options.png && !options.slices)
    return usage_error("no output is given")
        .with_field("--output")
        .with_mend("give -o FILE.vol, -o FILE.vdb, --png FILE.png or --slices FILE.png");
  if (options.output) {
    choice.vdb = options.output->ends_with(".vdb");
    if (!choice.vdb && !options.output->ends_with(".vol"))
      return usage_error(fmt::format("{}: the name does not end in .vol or .vdb", printable(*options.output)))
          .with_field("--output");
    CANDELA_TRY(check_output_path(*options.output, choice.vdb ? ".vdb" : ".vol", "--output"));
    if (choice.vdb)
      if (auto able = loaders::check_vdb_output(); !able.ok())
        return std::move(able).error().with_field("--output");
  }
  if (options.png) CANDELA_TRY(check_output_path(*options.png, ".png", "--png"));
  if (options.slices) CANDELA_TRY(check_output_path(*options.slices, ".png", "--slices"));
  return {};
}

Result<VolumeChoice> choose_volume(const VolumeOptions& options) {
  VolumeChoice choice;
  CANDELA_TRY(choose_box(options, choice.request.grid));
  CANDELA_TRY(choose_resolution(options, choice.request.grid));
  CANDELA_TRY(choose_volume_outputs(options, choice));
  CANDELA_TRY(set_if_given(choice.pixels, options.pixels, "--pixels", parse_pixel_rect));
  CANDELA_TRY(set_if_given(choice.request.spp, options.spp, "--spp", parse_count, 1, 1u << 30));
  if (options.axis) {
    constexpr std::array<std::string_view, 3> axes = {"x", "y", "z"};
    CANDELA_ASSIGN(const std::string name, parse_choice(*options.axis, "--axis", axes));
    choice.pictures.axis = static_cast<std::size_t>(name[0] - 'x');
  }
  if (options.map) {
    CANDELA_ASSIGN(const std::string name, parse_choice(*options.map, "--map", image::kColorMapNames));
    choice.pictures.map = *image::color_map_of(name);
  }
  choice.pictures.logarithmic = options.logarithmic;
  choice.request.eye_edges = options.eye_edges;
  return choice;
}

double volume_luminance(Vec3d v) {
  return 0.212671 * v.x + 0.715160 * v.y + 0.072169 * v.z;
}

double largest_luminance(const loaders::VolumeData& data) {
  float largest = 0;
  for (std::size_t i = 0; i < data.values.size(); i += 3)
    largest = std::max(largest, luminance({data.values[i], data.values[i + 1], data.values[i + 2]}));
  return static_cast<double>(largest);
}

void print_volume(Context& context, const VolumeOptions& options, const VolumeRequest& request,
                  const VolumeNumbers& report, const loaders::VolumeData& data) {
  const CellGrid& grid = request.grid;
  const auto color = [](Vec3d v) { return Json::array({v.x, v.y, v.z}); };
  const double mean = volume_luminance(report.mean), crossing = volume_luminance(report.crossing);
  if (options.json) {
    const inspect::PixelRect& r = request.pixels;
    const Json json = {{"box", {color(grid.low), color(grid.high)}},
                       {"resolution", grid.size},
                       {"pixels", {r.x0, r.y0, r.x1, r.y1}},
                       {"spp", request.spp},
                       {"select", options.inspect.select ? Json(*options.inspect.select) : Json(nullptr)},
                       {"mean", color(report.mean)},
                       {"crossing", color(report.crossing)},
                       {"contributions", report.contributions ? Json(*report.contributions) : Json(nullptr)},
                       {"maximum_luminance", largest_luminance(data)},
                       {"not_finite", report.not_finite},
                       {"too_large", report.too_large}};
    context.out << wire::json_text(json) << '\n';
    return;
  }
  if (report.crossing == Vec3d()) {
    context.out << "no light of this kind crosses the box\n";
    return;
  }
  context.out << fmt::format(
      "{}x{}x{} cells: {:.1f} % of the light of the pixels crosses the box{}; largest luminance of a cell "
      "{:.4g}",
      grid.size[0], grid.size[1], grid.size[2], mean > 0 ? 100 * crossing / mean : 0.0,
      report.contributions ? fmt::format(", in {} contributions", *report.contributions) : "",
      largest_luminance(data));
  if (report.not_finite > 0) context.out << fmt::format("; {} contributions not finite", report.not_finite);
  if (report.too_large > 0) context.out << fmt::format("; {} contributions too large", report.too_large);
  context.out << '\n';
}

Result<void> write_figure(const std::string& file, const image::Figure& figure) {
  CANDELA_ASSIGN(const std::string png, image::encode_png(figure.canvas));
  return write_file_atomically(file, png);
}

Result<void> volume_here(const VolumeRequest& request, const OpenedScene& opened, loaders::VolumeData& data,
                         VolumeNumbers& numbers) {
  CANDELA_ASSIGN(VolumeReport report, inspect::inspect_volume(*opened.session, request));
  numbers = {report.mean, report.crossing, report.paths, report.not_finite, report.too_large};
  CANDELA_ASSIGN(data, inspect::volume_data(request, report));
  return {};
}

// The settings of the job that makes the grid (worker/integrators/volume/settings.h).
JobSettings grid_settings(JobSettings job, const VolumeRequest& request) {
  job.integrator = tools::kVolume;
  tools::set_camera_film(job);
  const CellGrid& grid = request.grid;
  SettingsMap& settings = job.integrator_settings;
  const std::array<const char*, 3> axes = {"x", "y", "z"};
  for (std::size_t a = 0; a < 3; ++a) {
    const auto axis = static_cast<int>(a);
    settings[fmt::format("low_{}", axes[a])] = fmt::format("{}", grid.low[axis]);
    settings[fmt::format("high_{}", axes[a])] = fmt::format("{}", grid.high[axis]);
    settings[fmt::format("cells_{}", axes[a])] = fmt::format("{}", grid.size[a]);
  }
  const inspect::PixelRect& pixels = request.pixels;
  for (const auto& [name, value] : {std::pair{"pixel_x0", pixels.x0},
                                    {"pixel_y0", pixels.y0},
                                    {"pixel_x1", pixels.x1},
                                    {"pixel_y1", pixels.y1}})
    settings[name] = fmt::format("{}", value);
  settings["eye_edges"] = request.eye_edges ? "true" : "false";
  job.width = integrators::cell_film_width(grid);
  job.height = integrators::cell_film_height(grid);
  job.crop.reset();
  return job;
}

// Makes the grid by a job on a farm. Exit code: 0, the job's, or 128+n where a signal ended the waiting.
Result<int> volume_on_farm(Context& context, const VolumeOptions& options, const VolumeRequest& request,
                           const OpenedScene& opened, LoadedScene scene, loaders::VolumeData& data,
                           VolumeNumbers& numbers) {
  const CellGrid& grid = request.grid;
  // A job would refuse it after it was submitted.
  CANDELA_TRY(inspect::PathSampling::create(*opened.session, request.pixels, request.spp));
  if (grid.count() + integrators::kCellFilmSums > Limits::max_pixels)
    return usage_error(
               fmt::format("a job has at most {} cells", Limits::max_pixels - integrators::kCellFilmSums))
        .with_field("--resolution")
        .with_mend("give fewer cells");
  InspectJob job{.name = fmt::format("volume of {}", scene_name(options.inspect.scene.scene)),
                 .settings = grid_settings(scene.job.settings, request),
                 .iterations = request.spp,
                 .quiet = options.quiet};
  CANDELA_ASSIGN(const JobImage made,
                 run_inspect_job(context, options.farm, std::move(job), std::move(scene), *opened.session));
  if (made.code != 0) return made.code;
  numbers.not_finite = made.not_finite;
  const auto pixels = static_cast<double>(request.pixels.count());
  const auto sum = [&](integrators::CellFilmSum which) {
    const float* rgb = made.image.rgb.data() + 3 * integrators::cell_film_pixel(grid, which);
    return Vec3d(rgb[0], rgb[1], rgb[2]) * (1 / pixels);
  };
  numbers.mean = sum(integrators::CellFilmSum::light);
  numbers.crossing = sum(integrators::CellFilmSum::crossing);
  return within_memory("there is no room for the grid", [&]() -> Result<int> {
    const Vec3d cell = grid.cell();
    const double each = integrators::cell_film_unit(grid) / cell.x / cell.y / cell.z / pixels;
    data.size = grid.size;
    data.channels = 3;
    data.low = Vec3(grid.low);
    data.high = Vec3(grid.high);
    for (std::size_t i = 0; i < 3 * grid.count(); ++i)
      data.values.push_back(static_cast<float>(static_cast<double>(made.image.rgb[i]) * each));
    return 0;
  });
}

Result<int> run_volume(Context& context, const VolumeOptions& options) {
  CANDELA_ASSIGN(VolumeChoice choice, choose_volume(options));
  LoadedScene loaded;
  CANDELA_ASSIGN(const OpenedScene opened, open_for_inspection(context, options.inspect, "bdpt", &loaded));
  CANDELA_TRY(check_no_spot(opened));
  VolumeRequest& request = choice.request;
  CANDELA_ASSIGN(request.pixels, pixels_on_film(choice.pixels, opened, "--pixels"));
  if (!options.spp) request.spp = usual_spp(request.pixels);
  request.threads = opened.threads;
  loaders::VolumeData data;
  VolumeNumbers numbers;
  if (options.farm.master) {
    CANDELA_ASSIGN(const int code,
                   volume_on_farm(context, options, request, opened, std::move(loaded), data, numbers));
    if (code != 0) return code;
  } else {
    CANDELA_TRY(volume_here(request, opened, data, numbers));
  }
  return within_memory("the grid cannot be written", [&]() -> Result<int> {
    if (options.output) {
      std::string bytes;
      if (choice.vdb) {
        CANDELA_ASSIGN(bytes, loaders::vdb_output(data));
      } else {
        bytes = loaders::encode_volume(data);
      }
      CANDELA_TRY(write_file_atomically(*options.output, bytes));
    }
    if (options.png) CANDELA_TRY(write_figure(*options.png, draw_projection(data, choice.pictures)));
    if (options.slices) CANDELA_TRY(write_figure(*options.slices, draw_slices(data, choice.pictures)));
    print_volume(context, options, request, numbers, data);
    return 0;
  });
}

}  // namespace

void add_inspect_volume(CLI::App& inspect, Context& context) {
  auto options = std::make_shared<VolumeOptions>();
  CLI::App* sub = inspect.add_subcommand("volume",
                                         "Show the light of the image in space: paths of bidirectional path "
                                         "tracing in the cells of a box, here or on a farm with --master");
  add_inspect_options(*sub, options->inspect);
  sub->add_option("--box", options->box, "Two corners of the box, in world coordinates")
      ->required()
      ->type_name("x0,y0,z0,x1,y1,z1");
  add_text(*sub, "--resolution", options->resolution,
           "Cells along the longest edge of the box (default 64), or along x, y and z", "N|nx,ny,nz");
  add_text(*sub, "--pixels", options->pixels,
           "Take the light of these pixels alone: a rectangle, both corners included", "X0,Y0,X1,Y1");
  add_named_regions(*sub, options->inspect);
  add_spp_of_pixels(*sub, options->spp);
  sub->add_flag("--eye-edges", options->eye_edges, "Also count the last edge of each path, to the eye");
  add_text(
      *sub, "-o,--output", options->output,
      "Write the grid: Mitsuba's .vol with three channels, or OpenVDB with the grids density (luminance) "
      "and color",
      "FILE.vol|FILE.vdb");
  add_text(*sub, "--png", options->png, "Write the mean along --axis through a color map, with a scale",
           "FILE.png");
  add_text(*sub, "--slices", options->slices,
           "Write up to 16 slices across --axis through a color map, with a scale", "FILE.png");
  add_text(
      *sub, "--axis", options->axis,
      "Axis that pictures look along: z (default; x to the right, y up), y (x to the right, z down) or x "
      "(z to the right, y up)",
      "AXIS");
  add_text(*sub, "--map", options->map, "Color map: viridis (default), turbo, grey or heat", "MAP");
  sub->add_flag("--log", options->logarithmic, "Use a logarithmic scale");
  sub->add_flag("--json", options->json, "Print JSON");
  sub->add_flag("--quiet", options->quiet, "Print no progress");
  add_farm_options(*sub, options->farm);
  set_command(*sub, context, run_volume, options);
}

}  // namespace candela::client
