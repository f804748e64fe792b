#include "worker/inspect/path_sampling.h"

#include "worker/estimators/bidirectional.h"
#include "worker/inspect/recording_sink.h"
#include "worker/integrators/bdpt/settings.h"
#include "worker/integrators/bidirectional/plan.h"

namespace candela::inspect {
namespace {

// One form for all scenes.
using RecordingConfig =
    estimators::BidirectionalConfig<transport::Between::media, transport::Balance, RecordingSink>;

constexpr std::uint64_t kBatches = 32, kSamplesPerTask = 8192;

void trace_eye(const Session& session, std::uint32_t x, std::uint32_t y, std::uint64_t index,
               samplers::Sampler& sampler, RecordingSink& sink,
               estimators::Bidirectional<RecordingConfig>& estimator) {
  sampler.start(0, index, x, y);
  sampler.set_dimension(0);
  float filter_weight = 1, response = 1;
  const Vec2 offset = session.filter().sample(sampler.next_2d(), filter_weight);
  const scene::Scene& scene = session.scene();
  const Ray ray =
      scene.camera_ray(static_cast<float>(x) + 0.5f + offset.x, static_cast<float>(y) + 0.5f + offset.y,
                       scene.reads_lens() ? sampler.next_2d() : Vec2{0.5f, 0.5f}, response);
  sink.start_eye(ray, filter_weight * response, sampler.sample_key());
  estimator.trace_eye(ray, sampler);
}

}  // namespace

Result<PathSampling> PathSampling::create(const Session& session, const PixelRect& pixels,
                                          std::uint64_t spp) {
  CANDELA_ASSIGN(
      const integrators::BdptSettings settings,
      integrators::parse_settings<integrators::BdptSettings>(session.settings().integrator_settings));
  if (settings.regularise.on())
    return usage_error("mollified connections are in no report of paths")
        .with_field("regularise")
        .with_mend("leave out regularise=on: the report has the paths that bdpt samples");
  const estimators::PathOptions options = settings.common.path_options();
  scene::SceneFeatures features = session.scene().features();
  features.reads_letters = true;
  return PathSampling(
      session, pixels, spp, options,
      integrators::bidirectional::plan(options, features, settings.common.full_plan()).techniques);
}

PathSampling::PathSampling(const Session& session, const PixelRect& pixels, std::uint64_t spp,
                           const estimators::PathOptions& options, const estimators::Techniques& techniques)
    : session_(&session),
      pixels_(pixels),
      spp_(spp),
      batches_(std::min(kBatches, spp)),
      options_(options),
      techniques_(techniques) {
  const std::uint64_t samples = (spp + batches_ - 1) / batches_;
  pixels_each_ = std::clamp<std::uint64_t>(kSamplesPerTask / samples, 1, pixels.count());
  stretches_ = (pixels.count() + pixels_each_ - 1) / pixels_each_;
}

void PathSampling::run(std::uint64_t task, PathConsumer& paths) const {
  const Session& session = *session_;
  const JobSettings& job = session.settings();
  const PixelRect& rect = pixels_;
  // A path from the eye and one from the light for each sample of these pixels; the density of eye paths is
  // that over the film.
  const auto light_paths = static_cast<double>(rect.count());
  const estimators::PathCounts counts{static_cast<double>(job.width) * job.height, light_paths,
                                      static_cast<float>(session.filter().radius())};
  film::Tallies tallies;
  RecordingSink sink(session, rect, light_paths, paths);
  estimators::Bidirectional<RecordingConfig> estimator(session.scene(), options_, techniques_, counts, sink,
                                                       tallies);
  // Samples of a sequence are not independent, which the errors need.
  samplers::Sampler eye(samplers::SamplerKind::independent, job.seed),
      light(samplers::SamplerKind::independent, job.seed);
  const std::uint64_t first = task / batches_ * pixels_each_,
                      last = std::min(first + pixels_each_, rect.count());
  const std::uint64_t width = std::uint64_t{rect.x1} - rect.x0 + 1;
  for (std::uint64_t pixel = first; pixel < last; ++pixel) {
    const auto x = static_cast<std::uint32_t>(rect.x0 + pixel % width),
               y = static_cast<std::uint32_t>(rect.y0 + pixel / width);
    for (std::uint64_t i = batch_of(task); i < spp_; i += batches_) {
      if (techniques_.light_paths) {
        light.start_light(0, i, std::uint64_t{y} * job.width + x);
        estimator.trace_light(light);
      }
      trace_eye(session, x, y, i, eye, sink, estimator);
    }
  }
}

}  // namespace candela::inspect
