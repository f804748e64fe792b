#include "client/embedded/inspect_scene.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>

#include "client/embedded/local_farm.h"
#include "client/values.h"

namespace candela::client {
namespace {

constexpr const char* kSpot = "spot";

Result<inspect::Selection> selection_of(const InspectOptions& options, std::optional<letters::Region>& spot) {
  inspect::Selection selection;
  if (options.select) {
    if (options.select->empty()) return usage_error("the expression is empty").with_field("--select");
    selection.expression = *options.select;
  }
  if (options.scene.glossy_below) {
    auto parsed = letters::parse_glossy_below(*options.scene.glossy_below);
    if (!parsed) return std::move(parsed).error().with_field("--glossy-below");
    selection.glossy_below = *parsed;
  }
  for (const std::string& text : options.regions) {
    const bool named = text.find('=') != std::string::npos;
    auto region = letters::parse_region(named ? text : std::string(kSpot) + "=" + text);
    if (!region) return std::move(region).error().with_field("--region");
    if (!named) {
      if (spot) return usage_error("two regions have no name").with_field("--region");
      spot = *region;
    }
    selection.regions.push_back(*std::move(region));
  }
  letters::LayerRequest request{{{"select", selection.expression}}, selection.regions};
  request.glossy_below = selection.glossy_below;
  if (selection.expression.empty()) request.layers[0].text = "L[DGSV]*E";
  if (auto checked = letters::check(request); !checked)
    return std::move(checked).error().with_field(options.select ? "--select" : "--region");
  return selection;
}

}  // namespace

void add_inspect_options(CLI::App& app, InspectOptions& options) {
  SceneOptions& scene = options.scene;
  add_scene_file(app, scene);
  add_lenient(app, scene);
  add_texts(app, "--set", scene.sets, "Set a setting of the integrator; may be repeated", "KEY=VALUE");
  add_text(app, "--select", options.select,
           "Take only light whose paths match this light path expression, such as LS+DE", "EXPR");
  add_text(app, "--glossy-below", scene.glossy_below,
           "Roughness alpha below which light that is not mirrored counts as G, above as D (default 0.3)",
           "ALPHA");
  add_text(app, "--seed", scene.seed, "Seed; default: that of the scene's sampler, else 0", "N");
  add_text(app, "--size", scene.size,
           "Size of the image in pixels; default: the scene's film, or its crop window", "WxH");
  add_text(app, "--crop", scene.crop,
           "Render this part of the image alone: left, top, width and height in pixels of the whole image",
           "X,Y,W,H");
  add_text(app, "--edits", scene.edits,
           "Edit how light travels at chosen surfaces, by a file of JSON; none: no edits; default: those of "
           "the scene's integrator `edits`",
           "FILE");
  add_text(app, "--threads", options.threads, "Threads; default: one for each core", "N");
  add_scene_memory(app, scene);
}

void add_named_regions(CLI::App& app, InspectOptions& options) {
  add_texts(app, "--region", options.regions,
            "Name a region for @NAME in --select: NAME=box:x0,y0,z0,x1,y1,z1 or NAME=sphere:x,y,z,radius; "
            "may be repeated",
            "REGION");
}

void add_spp_of_pixels(CLI::App& app, std::optional<std::string>& spp) {
  add_text(app, "--spp", spp, "Samples per pixel; default: 200000 over all pixels, and at least 16 per pixel",
           "N");
}

Result<OpenedScene> open_for_inspection(Context& context, const InspectOptions& options,
                                        const std::string& integrator, LoadedScene* loaded) {
  OpenedScene opened;
  CANDELA_ASSIGN(opened.threads, parse_threads(options.threads));
  CANDELA_ASSIGN(const inspect::Selection selection, selection_of(options, opened.spot));
  SceneOptions wanted = options.scene;
  wanted.integrator = integrator;
  wanted.layers = {"none"};  // what the scene's own integrator adds to an image
  wanted.aov = "none";
  wanted.glossy_below = {};
  CANDELA_ASSIGN(LoadedScene scene, load_scene(wanted, context.facts));
  scene.job.other_integrator.reset();  // the tool has one integrator
  scene.job.default_integrator.reset();
  warn_of_scene(context.err, scene);
  const auto sensors = scene.gathered.description.scene->children_of("sensor");
  opened.sensor = sensors.empty() ? std::string() : sensors[0]->plugin;
  auto session = inspect::Session::open(bundle::DiskSource(scene.folder), scene.gathered.bundle.main_path,
                                        scene.gathered.bundle.parameters, scene.job.settings, selection,
                                        opened.threads, scene.memory_bytes);
  if (!session) {
    Error error = std::move(session).error();
    if (options.select && error.field.empty() && error.message.starts_with("layer 'select'"))
      return std::move(error).with_field("--select");
    return error;
  }
  opened.session = *std::move(session);
  if (loaded != nullptr) *loaded = std::move(scene);
  return opened;
}

Result<void> check_projection(const OpenedScene& scene, const std::string& option) {
  if (scene.sensor != "irradiancemeter" && scene.sensor != "distant") return {};
  return usage_error(fmt::format("the scene's sensor '{}' has no picture of the scene", scene.sensor))
      .with_field(option)
      .with_mend("use a scene with a perspective, thinlens or orthographic sensor");
}

Result<void> check_no_spot(const OpenedScene& scene) {
  if (!scene.spot) return {};
  return usage_error("a region without a name selects nothing here")
      .with_field("--region")
      .with_mend("name it, NAME=..., and write @NAME in --select");
}

Result<inspect::PixelRect> parse_pixel_rect(const std::string& text, const std::string& option) {
  auto numbers = parse_numbers(text, option, 4, 0, 1e6);
  if (!numbers && parse_numbers(text, option, 2, 0, 1e6).ok())
    return std::move(numbers).error().with_mend(fmt::format("for one pixel write {0},{0}", printable(text)));
  CANDELA_ASSIGN(const std::vector<double> n, std::move(numbers));
  for (const double v : n)
    if (v != std::floor(v)) return usage_error(fmt::format("{} is no pixel", v)).with_field(option);
  const auto at = [&](std::size_t i) { return static_cast<std::uint32_t>(n[i]); };
  const inspect::PixelRect rect{at(0), at(1), at(2), at(3)};
  if (rect.x0 > rect.x1 || rect.y0 > rect.y1)
    return usage_error("the rectangle is empty")
        .with_field(option)
        .with_mend("give the upper left corner first, then the lower right one");
  return rect;
}

Result<inspect::PixelRect> pixels_on_film(const std::optional<inspect::PixelRect>& rect,
                                          const OpenedScene& scene, const std::string& option) {
  const JobSettings& job = scene.session->settings();
  if (rect && (rect->x1 >= job.width || rect->y1 >= job.height))
    return usage_error(fmt::format("pixel {},{} is not on the film of {}x{}", rect->x1, rect->y1, job.width,
                                   job.height))
        .with_field(option);
  return rect.value_or(inspect::PixelRect{0, 0, job.width - 1, job.height - 1});
}

std::uint64_t usual_spp(const inspect::PixelRect& pixels) {
  constexpr std::uint64_t samples = 200'000, fewest = 16;
  return std::max(fewest, samples / pixels.count());
}

Result<std::vector<double>> parse_numbers(const std::string& text, const std::string& option,
                                          std::size_t count, double least, double most) {
  std::vector<double> numbers;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    CANDELA_ASSIGN(const double number, parse_number(text.substr(begin, end - begin), option, least, most));
    numbers.push_back(number);
    begin = end + 1;
  }
  if (numbers.size() != count)
    return usage_error(fmt::format("'{}' has {} numbers, not {}", printable(text), numbers.size(), count))
        .with_field(option);
  return numbers;
}

}  // namespace candela::client
