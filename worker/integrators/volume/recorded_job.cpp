#include "worker/integrators/volume/recorded_job.h"

#include "worker/integrators/bidirectional/plan.h"

namespace candela::integrators {

Result<RecordedJob> RecordedJob::create(const RecordedSettings& settings,
                                        const scene::SceneFeatures& features) {
  const PixelRect rect = settings.pixels();
  if (rect.x0 > rect.x1 || rect.y0 > rect.y1 || settings.pixel_x1 >= settings.film_width ||
      settings.pixel_y1 >= settings.film_height)
    return usage_error("the pixels are not on the film").with_field("pixel_x1");
  scene::SceneFeatures recorded = features;
  recorded.reads_letters = true;
  CANDELA_ASSIGN(const estimators::PathOptions options, recorded_options(settings.bdpt));
  return RecordedJob(settings, options,
                     bidirectional::plan(options, recorded, settings.bdpt.common.full_plan()));
}

void RecordedJob::sample_some(const UnitContext& context, std::uint32_t count, PathConsumer& consumer) const {
  const PixelRect rect = settings_.pixels();
  const RecordedLight light = light_of(context, nullptr);
  UnitContext pilot = context;
  pilot.seed = rng::key(context.seed, 0x70696c6f74ULL);  // "pilot"
  RecordedSamples samples = samples_of(light, pilot, consumer);
  for (std::uint32_t i = 0; i < count; ++i) {
    work_step();
    rng::Stream place(rng::key(context.seed, 0x706c616365ULL, i));  // "place"
    const auto pixel = static_cast<std::uint64_t>(place.next_double() * static_cast<double>(rect.count()));
    trace(samples, rect, pixel, 0, i);
  }
}

RecordedLight RecordedJob::light_of(const UnitContext& context, const transport::PathLetters* letters) const {
  const PixelRect rect = settings_.pixels();
  return {context.scene,
          context.filter,
          rect,
          static_cast<double>(rect.count()),
          static_cast<float>(letters::kDefaultGlossyBelow),
          letters};
}

RecordedSamples RecordedJob::samples_of(const RecordedLight& light, const UnitContext& context,
                                        PathConsumer& paths) const {
  return {light,
          static_cast<std::uint32_t>(settings_.film_width),
          static_cast<double>(settings_.film_width) * settings_.film_height,
          options_,
          planned_.techniques,
          context.seed,
          paths};
}

void RecordedJob::trace(RecordedSamples& samples, const PixelRect& rect, std::uint64_t pixel,
                        std::uint32_t half, std::uint64_t index) {
  const std::uint64_t width = std::uint64_t{rect.x1} - rect.x0 + 1;
  samples.trace(static_cast<std::uint32_t>(rect.x0 + pixel % width),
                static_cast<std::uint32_t>(rect.y0 + pixel / width), half, index);
}

}  // namespace candela::integrators
