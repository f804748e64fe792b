#include "worker/inspect/paths.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "worker/estimators/bidirectional.h"
#include "worker/inspect/parallel.h"
#include "worker/inspect/path_groups.h"
#include "worker/inspect/recording_sink.h"
#include "worker/integrators/bdpt/settings.h"
#include "worker/integrators/bidirectional/plan.h"

namespace candela::inspect {
namespace {

// One form for all scenes.
struct RecordingConfig {
  static constexpr transport::Between kBetween = transport::Between::media;
  static constexpr bool kLists = false;
  using Mis = transport::Balance;
  using Sampler = samplers::Sampler;
  using Sink = RecordingSink;
  using Choice = estimators::EveryTechnique;
};

constexpr std::uint64_t kBatches = 32, kSamplesPerTask = 8192;

// Sample i is of batch i mod count. A task is a stretch of the pixels, row by row, in one batch.
struct Tasks {
  std::uint64_t batches, pixels_each, stretches;

  Tasks(std::uint64_t pixels, std::uint64_t spp) : batches(std::min(kBatches, spp)) {
    const std::uint64_t samples = (spp + batches - 1) / batches;
    pixels_each = std::clamp<std::uint64_t>(kSamplesPerTask / samples, 1, pixels);
    stretches = (pixels + pixels_each - 1) / pixels_each;
  }
  std::uint64_t count() const { return batches * stretches; }
};

class PathsRun {
 public:
  PathsRun(const Session& session, const PathsRequest& request, const integrators::BdptSettings& settings)
      : session_(session),
        request_(request),
        tasks_(request.pixels.count(), request.spp),
        options_(settings.common.path_options()) {
    scene::SceneFeatures features = session.scene().features();
    features.reads_letters = true;
    techniques_ =
        integrators::bidirectional::plan(options_, features, settings.common.full_plan()).techniques;
    rules_.by_object = request.by_object;
    rules_.spot = request.spot;
    rules_.keep = request.keep;
  }

  PathsReport run() const {
    PathSums all(session_, rules_, tasks_.batches);
    for_each_in_order(
        tasks_.count(), request_.threads, [&](std::uint64_t task) { return sums_of(task); },
        [&](std::uint64_t task, PathSums&& part) { all.merge(std::move(part), task % tasks_.batches); });
    return report(all);
  }

 private:
  PathSums sums_of(std::uint64_t task) const {
    const JobSettings& job = session_.settings();
    const PixelRect& rect = request_.pixels;
    PathSums sums(session_, rules_, 1);
    // A path from the eye and one from the light for each sample of these pixels; the density of eye paths is
    // that over the film.
    const auto light_paths = static_cast<double>(rect.count());
    const estimators::PathCounts counts{static_cast<double>(job.width) * job.height, light_paths,
                                        static_cast<float>(session_.filter().radius())};
    film::Tallies tallies;
    RecordingSink sink(session_, rect, light_paths, sums);
    estimators::Bidirectional<RecordingConfig> estimator(session_.scene(), options_, techniques_, counts,
                                                         sink, tallies);
    // Samples of a sequence are not independent, which the errors need.
    samplers::Sampler eye(samplers::SamplerKind::independent, job.seed),
        light(samplers::SamplerKind::independent, job.seed);
    const std::uint64_t first = task / tasks_.batches * tasks_.pixels_each,
                        last = std::min(first + tasks_.pixels_each, rect.count());
    const std::uint64_t width = std::uint64_t{rect.x1} - rect.x0 + 1;
    for (std::uint64_t pixel = first; pixel < last; ++pixel) {
      const auto x = static_cast<std::uint32_t>(rect.x0 + pixel % width),
                 y = static_cast<std::uint32_t>(rect.y0 + pixel / width);
      for (std::uint64_t i = task % tasks_.batches; i < request_.spp; i += tasks_.batches) {
        if (techniques_.light_paths) {
          light.start_light(0, i, std::uint64_t{y} * job.width + x);
          estimator.trace_light(light);
        }
        trace_eye(x, y, i, eye, sink, estimator);
      }
    }
    return sums;
  }

  template <class Estimator>
  void trace_eye(std::uint32_t x, std::uint32_t y, std::uint64_t index, samplers::Sampler& sampler,
                 RecordingSink& sink, Estimator& estimator) const {
    sampler.start(0, index, x, y);
    sampler.set_dimension(0);
    float filter_weight = 1, response = 1;
    const Vec2 offset = session_.filter().sample(sampler.next_2d(), filter_weight);
    const scene::Scene& scene = session_.scene();
    const Ray ray =
        scene.camera_ray(static_cast<float>(x) + 0.5f + offset.x, static_cast<float>(y) + 0.5f + offset.y,
                         scene.reads_lens() ? sampler.next_2d() : Vec2{0.5f, 0.5f}, response);
    sink.start_eye(ray, filter_weight * response, sampler.sample_key());
    estimator.trace_eye(ray, sampler);
  }

  std::uint64_t samples_in(std::size_t batch) const {
    return (request_.spp - batch + tasks_.batches - 1) / tasks_.batches;
  }

  // The share of a sum's luminance in that of all light.
  Estimate share(const std::vector<double>& batches, const std::vector<double>& totals) const {
    double part = 0, total = 0;
    for (const double v : batches) part += v;
    for (const double v : totals) total += v;
    constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
    if (total == 0) return {unknown, unknown};
    const double ratio = part / total;
    const std::size_t n = batches.size();
    if (n < 2) return {ratio, unknown};
    double residuals = 0;
    for (std::size_t b = 0; b < n; ++b) {
      const double residual = batches[b] - ratio * totals[b];
      residuals += residual * residual;
    }
    const auto count = static_cast<double>(n);
    return {ratio, std::sqrt(residuals * count / (count - 1)) / std::abs(total)};
  }

  Estimate mean_luminance(const std::vector<double>& totals) const {
    const auto pixels = static_cast<double>(request_.pixels.count());
    double sum = 0;
    for (const double v : totals) sum += v;
    const double mean = sum / (pixels * static_cast<double>(request_.spp));
    const std::size_t n = totals.size();
    if (n < 2) return {mean, std::numeric_limits<double>::quiet_NaN()};
    double squares = 0;
    for (std::size_t b = 0; b < n; ++b) {
      const auto samples = static_cast<double>(samples_in(b));
      const double residual = totals[b] - mean * pixels * samples;
      squares += residual * residual;
    }
    const auto count = static_cast<double>(n);
    return {mean, std::sqrt(squares * count / (count - 1)) / (pixels * static_cast<double>(request_.spp))};
  }

  PathsReport report(const PathSums& sums) const {
    PathsReport out;
    out.pixels = request_.pixels.count();
    out.spp = request_.spp;
    const double samples = static_cast<double>(out.pixels) * static_cast<double>(out.spp);
    out.mean = sums.total() * (1 / samples);
    out.luminance = mean_luminance(sums.totals());
    out.other = share(sums.other().batches, sums.totals());
    out.other_count = sums.other().count;
    out.not_finite = sums.not_finite();
    std::vector<double> selected = sums.other().batches;
    for (const StringGroup& group : group_strings(sums.clusters(), request_.from_light, request_.rows))
      out.groups.push_back(group_of(group, sums, samples, selected));
    out.selected = share(selected, sums.totals());
    return out;
  }

  PathGroup group_of(const StringGroup& strings, const PathSums& sums, double samples,
                     std::vector<double>& selected) const {
    PathGroup out;
    out.expression = expression_of(strings, request_.from_light, session_);
    std::vector<double> batches(selected.size());
    const Cluster* brightest = nullptr;
    for (const auto* member : strings.members) {
      const Cluster& cluster = member->second;
      out.mean += cluster.sum * (1 / samples);
      out.count += cluster.count;
      for (std::size_t b = 0; b < batches.size(); ++b) batches[b] += cluster.batches[b];
      if (brightest == nullptr || cluster.weight > brightest->weight) brightest = &cluster;
      for (const KeyPath& path : sums.kept())
        if (path.string == member->first) out.key_paths.push_back(path);
    }
    for (std::size_t b = 0; b < batches.size(); ++b) selected[b] += batches[b];
    out.share = share(batches, sums.totals());
    for (const Vec3d& place : brightest->places)
      out.mean_path.push_back(Vec3(place * (1 / std::max(brightest->weight, 1e-300))));
    // One at least, of the string with most light.
    if (out.key_paths.empty() && request_.keep > 0) out.key_paths.push_back(*brightest->best);
    std::sort(out.key_paths.begin(), out.key_paths.end(),
              [](const KeyPath& a, const KeyPath& b) { return a.rank > b.rank; });
    return out;
  }

  const Session& session_;
  const PathsRequest& request_;
  const Tasks tasks_;
  const estimators::PathOptions options_;
  estimators::Techniques techniques_;
  SumRules rules_;
};

}  // namespace

Result<PathsReport> inspect_paths(const Session& session, const PathsRequest& request) {
  CANDELA_ASSIGN(
      const integrators::BdptSettings settings,
      integrators::parse_settings<integrators::BdptSettings>(session.settings().integrator_settings));
  if (settings.regularise.on())
    return usage_error("mollified connections are in no report of paths")
        .with_field("regularise")
        .with_mend("leave out regularise=on: the report has the paths that bdpt samples");
  return PathsRun(session, request, settings).run();
}

}  // namespace candela::inspect
