#include "client/embedded/inspect_shares.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "client/embedded/inspect_farm.h"
#include "client/passing_folder.h"
#include "common/film/layout.h"
#include "common/job/tools.h"
#include "worker/inspect/path_groups.h"
#include "worker/integrators/shares/settings.h"

namespace candela::client {
namespace {

using inspect::PathGroup;
using inspect::PathsReport;

constexpr std::size_t kMostLayers = film::kMaxLayers - 1;

std::string group_name(std::size_t i) {
  return fmt::format("g{}", i);
}

// The settings of the job (worker/integrators/shares/settings.h).
JobSettings shares_settings(JobSettings job, const inspect::PathsRequest& request,
                            const inspect::Session& session, const std::vector<PathGroup>& groups) {
  job.integrator = tools::kShares;
  tools::set_camera_film(job);
  SettingsMap& settings = job.integrator_settings;
  for (const auto& [name, value] : {std::pair{"pixel_x0", request.pixels.x0},
                                    {"pixel_y0", request.pixels.y0},
                                    {"pixel_x1", request.pixels.x1},
                                    {"pixel_y1", request.pixels.y1}})
    settings[name] = std::to_string(value);
  if (request.spot) {
    const letters::Region& spot = *request.spot;
    settings["spot"] = spot.kind == letters::Region::Kind::box ? "box" : "sphere";
    constexpr std::array<const char*, 3> axes = {"x", "y", "z"};
    for (std::size_t a = 0; a < 3; ++a) {
      settings[fmt::format("low_{}", axes[a])] = fmt::format("{}", spot.low[a]);
      settings[fmt::format("high_{}", axes[a])] = fmt::format("{}", spot.high[a]);
    }
    settings["radius"] = fmt::format("{}", spot.radius);
  }
  settings["selects"] = session.selects() ? "true" : "false";
  letters::LayerRequest layers = session.request();
  if (!session.selects()) layers.layers.clear();
  for (std::size_t i = 0; i < groups.size(); ++i)
    layers.layers.push_back({group_name(i), groups[i].expression});
  job.layers = layers.layers.empty() ? std::string() : letters::text_of(layers);
  job.width = integrators::kShareBatches;
  job.height = 1;
  job.crop.reset();
  return job;
}

// Sums of one layer over the samples of the job.
struct Sums {
  std::vector<double> batches;  // luminance
  Vec3d color;
};
Result<Sums> sums_of(const image::Image& image, double iterations) {
  if (image.width != integrators::kShareBatches || image.height != 1)
    return failed_error(fmt::format("the farm's image of the job has {}x{} pixels, not {}x1", image.width,
                                    image.height, integrators::kShareBatches));
  Sums sums;
  for (std::size_t b = 0; b < integrators::kShareBatches; ++b) {
    const float* rgb = image.rgb.data() + 3 * b;
    sums.color += Vec3d(rgb[0], rgb[1], rgb[2]) * iterations;
    sums.batches.push_back(static_cast<double>(luminance({rgb[0], rgb[1], rgb[2]})) * iterations);
  }
  return sums;
}

}  // namespace

Result<void> check_rows(std::size_t rows, const OpenedScene& scene) {
  const std::size_t most = kMostLayers - (scene.session->selects() ? 1 : 0);
  if (rows <= most) return {};
  return usage_error(fmt::format("a job tells at most {} clusters apart", most))
      .with_field("--clusters")
      .with_mend("give fewer, or leave out --master");
}

inspect::PathsRequest request_here(const inspect::PathsRequest& request) {
  inspect::PathsRequest here = request;
  here.spp = std::min(request.spp, std::max<std::uint64_t>(1, usual_spp(request.pixels) / 4));
  return here;
}

Result<int> shares_on_farm(Context& context, const FarmOptions& farm, SharesJob job,
                           const inspect::PathsRequest& request, const OpenedScene& opened, LoadedScene scene,
                           PathsReport& report) {
  std::vector<PathGroup>& groups = report.groups;
  const inspect::Session& session = *opened.session;
  std::sort(groups.begin(), groups.end(), [&](const PathGroup& a, const PathGroup& b) {
    return inspect::is_narrower(a.common, b.common, session);
  });
  JobSettings settings = shares_settings(scene.job.settings, request, session, groups);
  // A master would refuse the job with the name of a setting that the user did not give.
  if (const auto layers = letters::parse_layer_request(settings.layers); !layers.ok())
    return usage_error(fmt::format("a job cannot tell these clusters apart: {}", layers.error().message))
        .with_field("--clusters")
        .with_mend("give fewer, or leave out --master");
  CANDELA_ASSIGN(const PassingFolder folder, PassingFolder::make());
  const std::string file = (folder.path() / "job.exr").string();
  InspectJob inspect_job{.name = std::move(job.name),
                         .settings = std::move(settings),
                         .iterations = request.spp,
                         .quiet = job.quiet};
  CANDELA_ASSIGN(const JobFile made,
                 run_job_to(context, farm, std::move(inspect_job), std::move(scene), file));
  if (made.code != 0) return made.code;
  const auto iterations = static_cast<double>(request.spp),
             pixels = static_cast<double>(request.pixels.count()), samples = iterations * pixels;
  CANDELA_ASSIGN(const image::Image whole, image::read_image(file));
  CANDELA_ASSIGN(const Sums all, sums_of(whole, iterations));
  report.spp = request.spp;
  report.counted = false;
  report.other_count = 0;
  report.not_finite = made.not_finite;
  report.mean = all.color * (1 / samples);
  std::vector<double> samples_in(all.batches.size());
  for (std::size_t b = 0; b < samples_in.size(); ++b)
    samples_in[b] =
        pixels * static_cast<double>((request.spp + samples_in.size() - 1 - b) / samples_in.size());
  if (request.spp < samples_in.size()) samples_in.resize(request.spp);
  const auto filled = [&](std::vector<double> batches) {
    batches.resize(samples_in.size());
    return batches;
  };
  const std::vector<double> totals = filled(all.batches);
  report.luminance = inspect::ratio_of(totals, samples_in);
  std::vector<double> selected = totals, other;
  if (session.selects()) {
    CANDELA_ASSIGN(const image::Image layer, image::read_layer(file, session.request().layers.front().name));
    CANDELA_ASSIGN(Sums sums, sums_of(layer, iterations));
    selected = filled(std::move(sums.batches));
  }
  other = selected;
  for (std::size_t i = 0; i < groups.size(); ++i) {
    CANDELA_ASSIGN(const image::Image layer, image::read_layer(file, group_name(i)));
    CANDELA_ASSIGN(const Sums sums, sums_of(layer, iterations));
    const std::vector<double> batches = filled(sums.batches);
    for (std::size_t b = 0; b < batches.size(); ++b) other[b] -= batches[b];
    groups[i].mean = sums.color * (1 / samples);
    groups[i].share = inspect::ratio_of(batches, totals);
  }
  report.selected = inspect::ratio_of(selected, totals);
  report.other = inspect::ratio_of(other, totals);
  std::stable_sort(groups.begin(), groups.end(),
                   [](const PathGroup& a, const PathGroup& b) { return a.share.value > b.share.value; });
  return 0;
}

}  // namespace candela::client
