#include "worker/integrators/volume/volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/base/work_monitor.h"
#include "worker/integrators/bidirectional/plan.h"
#include "worker/integrators/parallel_tasks.h"
#include "worker/integrators/planned.h"
#include "worker/integrators/volume/cell_film.h"
#include "worker/integrators/volume/recorded_samples.h"

namespace candela::integrators {
namespace {

struct Cells {
  CellGrid grid;  // of the scene
  double unit;
  bool eye_edges;
};

// Splats the paths of one task.
class CellSplatter final : public PathConsumer {
 public:
  CellSplatter(const Cells& cells, const UnitContext& context, const RunContext& run, film::UnitFilm& film,
               film::SampleCounts& sample_counts)
      : cells_(cells), context_(context), run_(run), film_(film), sample_counts_(sample_counts) {}

  void add(const RecordedPath& path, Spectrum value, std::uint64_t key,
           const transport::ChannelLabels* labels) override {
    if (run_.fault != nullptr) run_.fault(key, &value.r);
    splat(0, path, value, key);
    if (labels == nullptr) return;
    const transport::PathLetters& letters = *context_.letters;
    for (std::uint32_t layer = 0; layer < letters.layer_count(); ++layer) {
      const auto part = [&](std::size_t c, float v) {
        return (letters.layer_bits((*labels)[c]) >> layer & 1) != 0 ? v : 0.0f;
      };
      const Spectrum selected(part(0, value.r), part(1, value.g), part(2, value.b));
      if (!selected.is_black()) splat(letters.first_layer() + layer, path, selected, key);
    }
  }

 private:
  void splat(std::uint32_t layer, const RecordedPath& path, Spectrum value, std::uint64_t key) {
    if (value.is_black()) return;
    // A contribution that the film refuses is refused as a whole, and counted once.
    if (!to_pixel(layer, cell_film_pixel(cells_.grid, CellFilmSum::light), value, key)) return;
    bool crosses = false;
    std::uint64_t number = 0;
    for_each_cell_of(cells_.grid, path, cells_.eye_edges, [&](std::uint64_t cell, double length) {
      crosses = true;
      to_pixel(layer, cell, value * static_cast<float>(length / cells_.unit), rng::combine(key, ++number));
    });
    if (crosses) to_pixel(layer, cell_film_pixel(cells_.grid, CellFilmSum::crossing), value, key);
  }

  bool to_pixel(std::uint32_t layer, std::uint64_t pixel, Spectrum value, std::uint64_t key) {
    return film_.splat(layer, static_cast<std::uint32_t>(pixel % context_.width),
                       static_cast<std::uint32_t>(pixel / context_.width), {value.r, value.g, value.b}, key,
                       sample_counts_, context_.filter.has_negative_lobes());
  }

  const Cells& cells_;
  const UnitContext& context_;
  const RunContext& run_;
  film::UnitFilm& film_;
  film::SampleCounts& sample_counts_;
};

// The size of what paths bring to a cell.
class CellLuminances final : public PathConsumer {
 public:
  explicit CellLuminances(const Cells& cells) : cells_(cells) {}

  void add(const RecordedPath& path, Spectrum value, std::uint64_t /*key*/,
           const transport::ChannelLabels* /*labels*/) override {
    const double light = static_cast<double>(std::fabs(luminance(value)));
    if (!std::isfinite(light)) return;
    double sum = 0;
    std::uint64_t count = 0;
    for_each_cell_of(cells_.grid, path, cells_.eye_edges, [&](std::uint64_t /*cell*/, double length) {
      sum += light * length / cells_.unit;
      ++count;
    });
    found_.push_back(static_cast<float>(count > 0 ? sum / static_cast<double>(count) : light));
  }
  std::vector<float> found() && { return std::move(found_); }

 private:
  const Cells& cells_;
  std::vector<float> found_;
};

class VolumeIntegrator final : public Integrator {
 public:
  VolumeIntegrator(const VolumeSettings& settings, const estimators::PathOptions& options, Planned planned)
      : settings_(settings), options_(options), planned_(std::move(planned)) {}

  Result<Decision> decide(const UnitContext& context, const RunContext& /*run*/) const override {
    CANDELA_TRY(check_film(context));
    return Decision{{}, planned_.plan};
  }

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                   UnitOutput& output, const RunContext& run_context) const override {
    CANDELA_TRY(check_film(context));
    film::UnitFilm& film = *output.film;
    const PixelRect rect = settings_.pixels();
    const Cells cells = cells_of(context);
    const RecordedLight light = light_of(context, context.letters);
    constexpr std::uint64_t kPixels = 64;  // of a task
    return for_each_task((rect.count() + kPixels - 1) / kPixels, film, run_context,
                         [&](std::uint64_t task, film::SampleCounts& sample_counts) {
                           CellSplatter splatter(cells, context, run_context, film, sample_counts);
                           RecordedSamples samples = samples_of(light, context, splatter);
                           const std::uint64_t begin = task * kPixels,
                                               end = std::min(begin + kPixels, rect.count());
                           for (std::uint64_t pixel = begin; pixel < end; ++pixel)
                             for (std::uint64_t index = unit.begin; index < unit.end; ++index) {
                               if (run_context.stopped()) return;
                               trace(samples, rect, pixel, unit.half, index);
                             }
                           sample_counts.eye_samples += (end - begin) * (unit.end - unit.begin);
                         });
  }

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    const PixelRect rect = settings_.pixels();
    const Cells cells = cells_of(context);
    const RecordedLight light = light_of(context, nullptr);
    CellLuminances luminances(cells);
    UnitContext pilot = context;
    pilot.seed = rng::key(context.seed, 0x70696c6f74ULL);  // "pilot"
    RecordedSamples samples = samples_of(light, pilot, luminances);
    for (std::uint32_t i = 0; i < count; ++i) {
      work_step();
      rng::Stream place(rng::key(context.seed, 0x706c616365ULL, i));  // "place"
      const auto pixel = static_cast<std::uint64_t>(place.next_double() * static_cast<double>(rect.count()));
      trace(samples, rect, pixel, 0, i);
    }
    return std::move(luminances).found();
  }

 private:
  // The film's size is the job's, which anybody may submit.
  Result<void> check_film(const UnitContext& context) const {
    const std::uint32_t width = cell_film_width(settings_.grid()),
                        height = cell_film_height(settings_.grid());
    if (context.width == width && context.height == height) return {};
    return usage_error(fmt::format("the grid has {} cells: its film has {} x {} pixels, not {} x {}",
                                   settings_.grid().count(), width, height, context.width, context.height))
        .with_field("width");
  }
  Cells cells_of(const UnitContext& context) const {
    Cells cells{settings_.grid(), cell_film_unit(settings_.grid()), settings_.eye_edges};
    cells.grid.low = cells.grid.low - context.scene.offset();
    cells.grid.high = cells.grid.high - context.scene.offset();
    return cells;
  }
  RecordedLight light_of(const UnitContext& context, const transport::PathLetters* letters) const {
    const PixelRect rect = settings_.pixels();
    return {context.scene,
            context.filter,
            rect,
            static_cast<double>(rect.count()),
            static_cast<float>(letters::kDefaultGlossyBelow),
            letters};
  }
  RecordedSamples samples_of(const RecordedLight& light, const UnitContext& context,
                             PathConsumer& paths) const {
    return {light,
            static_cast<std::uint32_t>(settings_.film_width),
            static_cast<double>(settings_.film_width) * settings_.film_height,
            options_,
            planned_.techniques,
            context.seed,
            paths};
  }
  static void trace(RecordedSamples& samples, const PixelRect& rect, std::uint64_t pixel, std::uint32_t half,
                    std::uint64_t index) {
    const std::uint64_t width = std::uint64_t{rect.x1} - rect.x0 + 1;
    samples.trace(static_cast<std::uint32_t>(rect.x0 + pixel % width),
                  static_cast<std::uint32_t>(rect.y0 + pixel / width), half, index);
  }

  const VolumeSettings settings_;
  const estimators::PathOptions options_;
  const Planned planned_;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_volume_integrator(const SettingsMap& settings,
                                                           const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const VolumeSettings parsed, parse_settings<VolumeSettings>(settings));
  const PixelRect rect = parsed.pixels();
  if (rect.x0 > rect.x1 || rect.y0 > rect.y1 || parsed.pixel_x1 >= parsed.film_width ||
      parsed.pixel_y1 >= parsed.film_height)
    return usage_error("the pixels are not on the film").with_field("pixel_x1");
  if (!(parsed.low_x < parsed.high_x) || !(parsed.low_y < parsed.high_y) || !(parsed.low_z < parsed.high_z))
    return usage_error("the box is empty").with_field("high_x");
  scene::SceneFeatures recorded = features;
  recorded.reads_letters = true;
  CANDELA_ASSIGN(const estimators::PathOptions options, recorded_options(parsed.bdpt));
  return std::unique_ptr<Integrator>(std::make_unique<VolumeIntegrator>(
      parsed, options, bidirectional::plan(options, recorded, parsed.bdpt.common.full_plan())));
}

}  // namespace candela::integrators
