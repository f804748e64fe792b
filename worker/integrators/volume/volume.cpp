// The integrator of the jobs of `candela inspect volume`: each path of bidirectional path tracing brings its
// contribution to the cells of a box that its edges cross [Kaplanyan 2017, 9.1.1.4]. An iteration is a sample
// of each pixel whose light is taken. The film (cell_film.h) has sum(contribution * length) of each cell.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "worker/integrators/makers.h"
#include "worker/integrators/volume/cell_film.h"
#include "worker/integrators/volume/recorded_job.h"
#include "worker/integrators/volume/settings.h"

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

  void start(std::uint32_t /*half*/, std::uint64_t /*index*/) {}
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
  VolumeIntegrator(const VolumeSettings& settings, RecordedJob job)
      : settings_(settings), job_(std::move(job)) {}

  Result<Decision> decide(const UnitContext& context, const RunContext& /*run*/) const override {
    CANDELA_TRY(check_film(context));
    return Decision{{}, job_.plan()};
  }

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                   UnitOutput& output, const RunContext& run_context) const override {
    CANDELA_TRY(check_film(context));
    film::UnitFilm& film = *output.film;
    const Cells cells = cells_of(context);
    return job_.run(context, unit, film, run_context, [&](film::SampleCounts& sample_counts) {
      return CellSplatter(cells, context, run_context, film, sample_counts);
    });
  }

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    const Cells cells = cells_of(context);
    CellLuminances luminances(cells);
    job_.sample_some(context, count, luminances);
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

  const VolumeSettings settings_;
  const RecordedJob job_;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_volume_integrator(const SettingsMap& settings,
                                                           const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const VolumeSettings parsed, parse_settings<VolumeSettings>(settings));
  CANDELA_ASSIGN(RecordedJob job, RecordedJob::create(parsed.recorded, features));
  if (!(parsed.low_x < parsed.high_x) || !(parsed.low_y < parsed.high_y) || !(parsed.low_z < parsed.high_z))
    return usage_error("the box is empty").with_field("high_x");
  return std::unique_ptr<Integrator>(std::make_unique<VolumeIntegrator>(parsed, std::move(job)));
}

}  // namespace candela::integrators
