// The integrator of the jobs of `candela inspect paths`: light by the groups of its paths. An iteration is a
// sample of each pixel whose light is taken. The film has a pixel for each batch of iterations, from whose
// spread the errors follow. A contribution is in the image, and in one layer at most: the first one, after
// the layer that selects, whose expression its path matches.
#include <fmt/format.h>

#include <array>
#include <cmath>

#include "worker/integrators/makers.h"
#include "worker/integrators/shares/settings.h"
#include "worker/integrators/volume/recorded_job.h"
#include "worker/transport/letters/vertex_letter.h"

namespace candela::integrators {
namespace {

class ShareSplatter final : public PathConsumer {
 public:
  ShareSplatter(const SharesSettings& settings, const UnitContext& context, const RunContext& run,
                film::UnitFilm& film, film::SampleCounts& sample_counts)
      : spot_(settings.region()),
        selects_(settings.selects),
        context_(context),
        run_(run),
        film_(film),
        sample_counts_(sample_counts) {}

  void start(std::uint32_t half, std::uint64_t index) {
    batch_ = static_cast<std::uint32_t>(global_iteration(half, index) % kShareBatches);
  }

  void add(const RecordedPath& path, Spectrum value, std::uint64_t key,
           const transport::ChannelLabels* labels) override {
    if (run_.fault != nullptr) run_.fault(key, &value.r);
    if (value.is_black()) return;
    const PathVertex& seen = path[path.size() - 2];
    if (spot_ && (seen.infinite || !transport::is_inside(*spot_, Vec3d(seen.p) + context_.scene.offset())))
      return;
    // A contribution that the film refuses is refused as a whole, and counted once.
    if (!to_batch(0, value, key) || labels == nullptr) return;
    std::array<std::uint64_t, transport::kColors> layers;
    std::uint64_t all = 0;
    for (std::size_t c = 0; c < layers.size(); ++c) {
      const std::uint64_t matched = context_.letters->layer_bits((*labels)[c]);
      if (selects_) {
        const std::uint64_t rest = matched & ~std::uint64_t{1};
        layers[c] = (matched & 1) != 0 ? 1 | (rest & -rest) : 0;
      } else {
        layers[c] = matched & -matched;
      }
      all |= layers[c];
    }
    const std::uint32_t first = context_.letters->first_layer();
    for (std::uint32_t layer = 0; layer < context_.letters->layer_count(); ++layer) {
      if ((all >> layer & 1) == 0) continue;
      const auto part = [&](std::size_t c, float v) { return (layers[c] >> layer & 1) != 0 ? v : 0.0f; };
      to_batch(first + layer, {part(0, value.r), part(1, value.g), part(2, value.b)}, key);
    }
  }

 private:
  bool to_batch(std::uint32_t layer, Spectrum value, std::uint64_t key) {
    return film_.splat(layer, batch_, 0, {value.r, value.g, value.b}, key, sample_counts_,
                       context_.filter.has_negative_lobes());
  }

  const std::optional<letters::Region> spot_;
  const bool selects_;
  const UnitContext& context_;
  const RunContext& run_;
  film::UnitFilm& film_;
  film::SampleCounts& sample_counts_;
  std::uint32_t batch_ = 0;
};

class Luminances final : public PathConsumer {
 public:
  void add(const RecordedPath& /*path*/, Spectrum value, std::uint64_t /*key*/,
           const transport::ChannelLabels* /*labels*/) override {
    const float light = std::fabs(luminance(value));
    if (std::isfinite(light)) found_.push_back(light);
  }
  std::vector<float> found() && { return std::move(found_); }

 private:
  std::vector<float> found_;
};

class SharesIntegrator final : public Integrator {
 public:
  SharesIntegrator(const SharesSettings& settings, RecordedJob job)
      : settings_(settings), job_(std::move(job)) {}

  Result<Decision> decide(const UnitContext& context, const RunContext& /*run*/) const override {
    CANDELA_TRY(check_film(context));
    return Decision{{}, job_.plan()};
  }

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                   UnitOutput& output, const RunContext& run_context) const override {
    CANDELA_TRY(check_film(context));
    film::UnitFilm& film = *output.film;
    return job_.run(context, unit, film, run_context, [&](film::SampleCounts& sample_counts) {
      return ShareSplatter(settings_, context, run_context, film, sample_counts);
    });
  }

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    Luminances luminances;
    job_.sample_some(context, count, luminances);
    return std::move(luminances).found();
  }

 private:
  // The film's size is the job's, which anybody may submit.
  static Result<void> check_film(const UnitContext& context) {
    if (context.width == kShareBatches && context.height == 1) return {};
    return usage_error(fmt::format("the film of a job of inspect paths has {} x 1 pixels, not {} x {}",
                                   kShareBatches, context.width, context.height))
        .with_field("width");
  }

  const SharesSettings settings_;
  const RecordedJob job_;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_shares_integrator(const SettingsMap& settings,
                                                           const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const SharesSettings parsed, parse_settings<SharesSettings>(settings));
  CANDELA_ASSIGN(RecordedJob job, RecordedJob::create(parsed.recorded, features));
  return std::unique_ptr<Integrator>(std::make_unique<SharesIntegrator>(parsed, std::move(job)));
}

}  // namespace candela::integrators
