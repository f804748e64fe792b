// candela inspect paths: where the light of some pixels comes from.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <ostream>

#include "client/embedded/commands.h"
#include "client/embedded/inspect_figures.h"
#include "client/embedded/inspect_scene.h"
#include "client/embedded/inspect_shares.h"
#include "client/output.h"
#include "client/scene_name.h"
#include "client/values.h"
#include "common/base/files.h"
#include "common/image/false_color.h"
#include "common/wire/json_values.h"
#include "worker/inspect/path_groups.h"
#include "worker/inspect/paths.h"

namespace candela::client {
namespace {

using inspect::PathGroup;
using inspect::PathsReport;
using inspect::PathsRequest;
using wire::Json;

struct PathsOptions {
  InspectOptions inspect;
  FarmOptions farm;
  std::optional<std::string> pixels, spp, by, from, rows, keep, output, ply, overlay;
  bool json = false, quiet = false;
};

constexpr std::uint64_t kMaxSpp = 1u << 30;
constexpr std::uint64_t kMaxRows = 256, kMaxKept = 65536;
constexpr std::size_t kPathsInJson = 8;  // of a group

Result<void> check_outputs(const PathsOptions& options) {
  if (options.output) CANDELA_TRY(check_output_path(*options.output, ".json", "--output"));
  if (options.ply) CANDELA_TRY(check_output_path(*options.ply, ".ply", "--ply"));
  if (options.overlay) CANDELA_TRY(check_output_path(*options.overlay, ".png", "--overlay"));
  return {};
}

// Reads the options that need no scene.
Result<PathsRequest> request_of(const PathsOptions& options) {
  PathsRequest request;
  constexpr std::array<std::string_view, 2> kinds = {"expression", "object"}, ends = {"eye", "light"};
  if (options.by) {
    CANDELA_ASSIGN(const std::string by, parse_choice(*options.by, "--by", kinds));
    request.by_object = by == "object";
  }
  if (options.from) {
    CANDELA_ASSIGN(const std::string from, parse_choice(*options.from, "--from", ends));
    request.from_light = from == "light";
  }
  CANDELA_TRY(set_if_given(request.rows, options.rows, "--clusters", parse_count, 1, kMaxRows));
  CANDELA_TRY(set_if_given(request.keep, options.keep, "--keep", parse_count, 1, kMaxKept));
  CANDELA_TRY(set_if_given(request.spp, options.spp, "--spp", parse_count, 1, kMaxSpp));
  return request;
}

std::string object_text(const inspect::KeyPath& path, const inspect::Session& session) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i + 1 < path.vertices.size(); ++i) {
    const std::string& name =
        session.object_name(path.vertices[i].object[static_cast<std::size_t>(path.channel)]);
    names.push_back(name.empty() ? "-" : printable(name));
  }
  return join(names, " > ");
}

Json point_json(Vec3d p) {
  return Json::array({p.x, p.y, p.z});
}
Json color_json(Spectrum s) {
  return Json::array({wire::finite(static_cast<double>(s.r)), wire::finite(static_cast<double>(s.g)),
                      wire::finite(static_cast<double>(s.b))});
}

Json path_json(const inspect::KeyPath& path, double samples, const inspect::Session& session) {
  Json vertices = Json::array();
  const auto channel = static_cast<std::size_t>(path.channel);
  for (const inspect::PathVertex& v : path.vertices) {
    const std::string& name = session.object_name(v.object[channel]);
    Json vertex = {{"letter", inspect::text_of({v.letter[channel], v.side}, session)},
                   {"object", name.empty() ? Json(nullptr) : Json(name)},
                   {"position", point_json(session.in_file(v.p))},
                   {"throughput", color_json(v.throughput)}};
    if (v.infinite) vertex["at_infinity"] = true;
    vertices.push_back(std::move(vertex));
  }
  return {{"contribution", color_json(path.value * static_cast<float>(1 / samples))},
          {"vertices", std::move(vertices)}};
}

std::string report_json(const PathsReport& report, const PathsRequest& request, const PathsOptions& options,
                        const inspect::Session& session) {
  const double samples = static_cast<double>(report.pixels) * static_cast<double>(report.spp);
  const auto count = [&](std::uint64_t n) { return report.counted ? Json(n) : Json(nullptr); };
  Json groups = Json::array();
  for (const PathGroup& group : report.groups) {
    Json mean_path = Json::array(), paths = Json::array();
    for (const Vec3& p : group.mean_path) mean_path.push_back(point_json(session.in_file(p)));
    for (std::size_t i = 0; i < std::min(group.key_paths.size(), kPathsInJson); ++i)
      paths.push_back(path_json(group.key_paths[i], samples, session));
    groups.push_back({{"expression", group.expression},
                      {"share", wire::finite(group.share.value)},
                      {"share_error", wire::finite(group.share.error)},
                      {"mean", point_json(group.mean)},
                      {"contributions", count(group.count)},
                      {"mean_path", std::move(mean_path)},
                      {"key_paths", std::move(paths)}});
  }
  const inspect::PixelRect& r = request.pixels;
  return wire::json_text(
      {{"pixels", {r.x0, r.y0, r.x1, r.y1}},
       {"spp", report.spp},
       {"seed", session.settings().seed},
       {"by", request.by_object ? "object" : "expression"},
       {"select", options.inspect.select ? Json(*options.inspect.select) : Json(nullptr)},
       {"mean", point_json(report.mean)},
       {"luminance", wire::finite(report.luminance.value)},
       {"luminance_error", wire::finite(report.luminance.error)},
       {"selected_share", wire::finite(report.selected.value)},
       {"selected_share_error", wire::finite(report.selected.error)},
       {"clusters", std::move(groups)},
       {"other", {{"share", wire::finite(report.other.value)}, {"contributions", count(report.other_count)}}},
       {"not_finite", report.not_finite}});
}

// "12.3" of 0.123; "-" if it is not known.
std::string percent(double value, int digits = 1) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", 100 * value, digits) : "-";
}

void print_report(std::ostream& out, const PathsReport& report, const PathsRequest& request,
                  const inspect::Session& session) {
  const inspect::PixelRect& r = request.pixels;
  out << fmt::format(
      "pixels {},{} to {},{}, {} spp: mean luminance {:.4g} +- {}", r.x0, r.y0, r.x1, r.y1, report.spp,
      report.luminance.value,
      std::isfinite(report.luminance.error) ? fmt::format("{:.1g}", report.luminance.error) : "-");
  if (session.selects())
    out << fmt::format("; selected {} % +- {}", percent(report.selected.value),
                       percent(report.selected.error, 2));
  if (report.not_finite > 0) out << fmt::format("; {} contributions not finite", report.not_finite);
  out << '\n';
  if (report.groups.empty() && report.other_count == 0) {
    out << "no light of this kind arrives\n";
    return;
  }
  std::size_t width = 10;
  for (const PathGroup& group : report.groups)
    width = std::max(width, std::min<std::size_t>(printable(group.expression).size(), 60));
  out << fmt::format("{:>7} {:>6}  {:<{}}  {}\n", "SHARE %", "+-", "EXPRESSION", width,
                     "OBJECTS OF A KEY PATH");
  for (const PathGroup& group : report.groups)
    out << fmt::format("{:>7} {:>6}  {:<{}}  {}\n", percent(group.share.value), percent(group.share.error, 2),
                       printable(group.expression), width,
                       group.key_paths.empty() ? "" : object_text(group.key_paths.front(), session));
  if (report.other_count > 0 || std::abs(report.other.value) > 1e-6)
    out << fmt::format("{:>7} {:>6}  {}\n", percent(report.other.value), percent(report.other.error, 2),
                       "(other)");
}

Result<int> run_paths(Context& context, const PathsOptions& options) {
  CANDELA_TRY(check_outputs(options));
  CANDELA_ASSIGN(PathsRequest request, request_of(options));
  std::optional<inspect::PixelRect> rect;
  CANDELA_TRY(set_if_given(rect, options.pixels, "--pixels", parse_pixel_rect));
  const bool has_spot =
      std::any_of(options.inspect.regions.begin(), options.inspect.regions.end(),
                  [](const std::string& text) { return text.find('=') == std::string::npos; });
  if (!rect && !has_spot)
    return usage_error("no place is given")
        .with_field("--pixels")
        .with_mend("give --pixels X0,Y0,X1,Y1, or --region box:x0,y0,z0,x1,y1,z1 or sphere:x,y,z,radius");
  LoadedScene loaded;
  CANDELA_ASSIGN(const OpenedScene opened, open_for_inspection(context, options.inspect, "bdpt", &loaded));
  if (options.overlay) CANDELA_TRY(check_projection(opened, "--overlay"));
  CANDELA_ASSIGN(request.pixels, pixels_on_film(rect, opened, "--pixels"));
  request.spot = opened.spot;
  request.threads = opened.threads;
  if (!options.spp) request.spp = usual_spp(request.pixels);
  const inspect::Session& session = *opened.session;
  const bool on_farm = options.farm.master.has_value();
  if (on_farm) CANDELA_TRY(check_rows(request.rows, opened));
  CANDELA_ASSIGN(PathsReport report,
                 inspect::inspect_paths(session, on_farm ? request_here(request) : request));
  if (on_farm) {
    CANDELA_ASSIGN(
        const int code,
        shares_on_farm(context, options.farm,
                       {fmt::format("paths of {}", scene_name(options.inspect.scene.scene)), options.quiet},
                       request, opened, std::move(loaded), report));
    if (code != 0) return code;
  }
  const std::string json =
      options.json || options.output ? report_json(report, request, options, session) : std::string();
  if (options.output) CANDELA_TRY(write_file_atomically(*options.output, json + '\n'));
  if (options.ply) CANDELA_TRY(write_file_atomically(*options.ply, paths_ply(session, report)));
  if (options.overlay) {
    CANDELA_ASSIGN(const std::string png,
                   image::encode_png(paths_overlay(session, report, request.pixels, opened.threads)));
    CANDELA_TRY(write_file_atomically(*options.overlay, png));
  }
  if (options.json)
    context.out << json << '\n';
  else
    print_report(context.out, report, request, session);
  return 0;
}

}  // namespace

void add_inspect_paths(CLI::App& inspect, Context& context) {
  auto options = std::make_shared<PathsOptions>();
  CLI::App* sub = inspect.add_subcommand("paths",
                                         "Show where the light of some pixels comes from: clusters of paths "
                                         "of bidirectional path tracing, with their shares of the light, "
                                         "here or on a farm with --master");
  add_inspect_options(*sub, options->inspect);
  add_text(*sub, "--pixels", options->pixels,
           "Rectangle of pixels, both corners included; default with --region: the film", "X0,Y0,X1,Y1");
  add_texts(*sub, "--region", options->inspect.regions,
            "Take only paths whose vertex next to the eye is within box:x0,y0,z0,x1,y1,z1 or "
            "sphere:x,y,z,radius; with NAME= in front, name a region for @NAME in --select; may be repeated",
            "REGION");
  add_spp_of_pixels(*sub, options->spp);
  add_text(*sub, "--by", options->by, "Cluster paths by expression (default) or by object", "KIND");
  add_text(*sub, "--from", options->from, "End at which clustering begins: eye (default) or light", "END");
  add_text(*sub, "--clusters", options->rows, "Split clusters up to this number (default 12)", "N");
  add_text(*sub, "--keep", options->keep, "Key paths to keep over all clusters (default 64)", "N");
  add_text(*sub, "-o,--output", options->output, "Write clusters and key paths as JSON", "FILE.json");
  add_text(*sub, "--ply", options->ply,
           "Write key paths and mean paths as arrows: a PLY of triangles with vertex colors", "FILE.ply");
  add_text(*sub, "--overlay", options->overlay, "Write a picture of the scene with key paths drawn over it",
           "FILE.png");
  sub->add_flag("--json", options->json, "Print JSON");
  sub->add_flag("--quiet", options->quiet, "Print no progress");
  add_farm_options(*sub, options->farm);
  set_command(*sub, context, run_paths, options);
}

}  // namespace candela::client
