#include "worker/inspect/path_sampling.h"

#include "worker/integrators/bdpt/settings.h"
#include "worker/integrators/bidirectional/plan.h"

namespace candela::inspect {
namespace {

constexpr std::uint64_t kBatches = 32, kSamplesPerTask = 8192;

}  // namespace

Result<PathSampling> PathSampling::create(const Session& session, const PixelRect& pixels,
                                          std::uint64_t spp) {
  CANDELA_ASSIGN(
      const integrators::BdptSettings settings,
      integrators::parse_settings<integrators::BdptSettings>(session.settings().integrator_settings));
  CANDELA_ASSIGN(const estimators::PathOptions options, integrators::recorded_options(settings));
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
  // A path from the eye and one from the light for each sample of these pixels.
  const integrators::RecordedLight light{session.scene(), session.filter(), rect,
                                         static_cast<double>(rect.count()), session.glossy_below()};
  integrators::RecordedSamples samples(light, job.width, static_cast<double>(job.width) * job.height,
                                       options_, techniques_, job.seed, paths);
  const std::uint64_t first = task / batches_ * pixels_each_,
                      last = std::min(first + pixels_each_, rect.count());
  const std::uint64_t width = std::uint64_t{rect.x1} - rect.x0 + 1;
  for (std::uint64_t pixel = first; pixel < last; ++pixel) {
    const auto x = static_cast<std::uint32_t>(rect.x0 + pixel % width),
               y = static_cast<std::uint32_t>(rect.y0 + pixel / width);
    for (std::uint64_t i = batch_of(task); i < spp_; i += batches_)
      samples.trace(x, y, static_cast<std::uint32_t>(i % 2), i / 2);
  }
}

}  // namespace candela::inspect
