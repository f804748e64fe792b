#include "worker/integrators/pilot/trial_runs.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "worker/integrators/film_scale.h"
#include "worker/scene/scene.h"

namespace candela::integrators::pilot {
namespace {

constexpr std::uint32_t kScaleSamples = 512;

UnitContext small_context(const UnitContext& context, const SmallFilm& film) {
  const double pixels = static_cast<double>(context.width) * context.height;
  const double shrink =
      std::max(1.0, std::sqrt(pixels / std::clamp(pixels / 4, film.min_pixels, film.max_pixels)));
  const auto side = [&](std::uint32_t whole) {
    return std::max(1U, static_cast<std::uint32_t>(std::lround(whole / shrink)));
  };
  UnitContext small{context.scene, context.filter,      samplers::SamplerKind::independent,
                    film.seed,     side(context.width), side(context.height)};
  small.camera_units = {static_cast<float>(context.width) / static_cast<float>(small.width),
                        static_cast<float>(context.height) / static_cast<float>(small.height)};
  return small;
}

}  // namespace

TrialRuns::TrialRuns(const Integrator& integrator, const UnitContext& context, const RunContext& run,
                     const SmallFilm& film, std::uint32_t layers)
    : small_(small_context(context, film)), quiet_(run), layout_{small_.width, small_.height, layers} {
  quiet_.progress = nullptr;
  quiet_.fault = nullptr;
  scale_ = film_scale_log2(integrator.pilot_luminances(small_, kScaleSamples),
                           context.scene.features().max_emitted_radiance);
}

Result<Trial> TrialRuns::run(const Render& render) const {
  Trial trial;
  UnitOutput output;
  for (std::size_t r = 0; r < kReplicates; ++r) {
    output.film = std::make_unique<film::UnitFilm>(layout_, scale_);
    CANDELA_TRY(render(small_, {Unit::Kind::iterations, 0, r, r + 1}, output, quiet_));
    const std::int64_t* sums = output.film->sums();
    std::vector<float> image(3 * layout_.pixel_count());
    for (std::size_t i = 0; i < image.size(); ++i)
      image[i] = static_cast<float>(std::ldexp(static_cast<double>(sums[i]), -scale_));
    trial.images[r] = means_of_squares(image, small_.width, small_.height);
  }
  return trial;
}

}  // namespace candela::integrators::pilot
