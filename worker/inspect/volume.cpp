#include "worker/inspect/volume.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/base/memory_limit.h"
#include "worker/inspect/parallel.h"
#include "worker/inspect/path_sampling.h"
#include "worker/inspect/path_selection.h"
#include "worker/integrators/volume/cell_film.h"

namespace candela::inspect {
namespace {

Vec3d as_double(Spectrum s) {
  return {static_cast<double>(s.r), static_cast<double>(s.g), static_cast<double>(s.b)};
}

// Sums of one task beside those of the cells.
struct TaskSums {
  Vec3d mean, crossing;
  std::uint64_t paths = 0, not_finite = 0, too_large = 0;
};

// Adds the paths of one task to the cells.
class CellConsumer final : public PathConsumer {
 public:
  // factor: of a contribution times a length.
  CellConsumer(const Session& session, const CellGrid& grid, double factor, bool eye_edges, CellSums& cells)
      : session_(session), grid_(grid), factor_(factor), eye_edges_(eye_edges), cells_(cells) {}

  void add(const RecordedPath& path, Spectrum value, std::uint64_t /*key*/,
           const transport::ChannelLabels* /*labels*/) override {
    const Vec3d all = as_double(value);
    if (!std::isfinite(all.x) || !std::isfinite(all.y) || !std::isfinite(all.z)) {
      ++sums_.not_finite;
      return;
    }
    Vec3d light = all;
    if (all.x != 0 && !is_selected(session_, path, 0)) light.x = 0;
    if (all.y != 0 && !is_selected(session_, path, 1)) light.y = 0;
    if (all.z != 0 && !is_selected(session_, path, 2)) light.z = 0;
    if (light == Vec3d()) return;
    sums_.mean += light;
    bool crosses = false, fits = true;
    integrators::for_each_cell_of(grid_, path, eye_edges_, [&](std::uint64_t cell, double length) {
      crosses = true;
      fits &= add_to(cell, light * (length * factor_));
    });
    if (!crosses) return;
    sums_.crossing += light;
    ++sums_.paths;
    if (!fits) ++sums_.too_large;
  }

  const TaskSums& sums() const { return sums_; }

 private:
  bool add_to(std::uint64_t cell, Vec3d light) {
    bool fits = true;
    const std::array<double, 3> channels = {light.x, light.y, light.z};
    for (std::size_t c = 0; c < 3; ++c)
      if (channels[c] != 0) fits &= cells_.add(3 * cell + c, channels[c]);
    return fits;
  }

  const Session& session_;
  const CellGrid& grid_;
  const double factor_;
  const bool eye_edges_;
  CellSums& cells_;
  TaskSums sums_;
};

// Mean brightness of a contribution, over all light.
class MeanContribution final : public PathConsumer {
 public:
  void add(const RecordedPath& /*path*/, Spectrum value, std::uint64_t /*key*/,
           const transport::ChannelLabels* /*labels*/) override {
    const Vec3d v = as_double(value);
    const double size = std::abs(v.x) + std::abs(v.y) + std::abs(v.z);
    if (!(size > 0) || !std::isfinite(size)) return;
    sum_ += size;
    ++count_;
  }
  // The power of two that makes the mean 1 to 2; 0 if there is no light.
  int scale_log2() const { return count_ == 0 ? 0 : -std::ilogb(sum_ / static_cast<double>(count_)); }

 private:
  double sum_ = 0;
  std::uint64_t count_ = 0;
};

}  // namespace

std::uint64_t volume_bytes(const CellGrid& grid) {
  // The sums beside the values; later the values beside OpenVDB's trees and two copies of the file's bytes.
  constexpr std::uint64_t with_sums = 3 * (CellSums::kBytesPerSum + sizeof(float)),
                          with_file = 3 * sizeof(float) + 4 * 4 * sizeof(float),
                          each = std::max(with_sums, with_file);
  const std::uint64_t cells = grid.count();
  return cells > std::numeric_limits<std::uint64_t>::max() / each ? std::numeric_limits<std::uint64_t>::max()
                                                                  : cells * each;
}

Result<VolumeReport> inspect_volume(const Session& session, const VolumeRequest& request) {
  CANDELA_ASSIGN(const PathSampling sampling, PathSampling::create(session, request.pixels, request.spp));
  return within_memory("there is no room for the grid", [&]() -> Result<VolumeReport> {
    CellGrid grid = request.grid;
    grid.low = grid.low - session.scene().offset();
    grid.high = grid.high - session.scene().offset();
    VolumeReport report{.sums = CellSums(3 * grid.count()),
                        .unit = integrators::cell_film_unit(request.grid)};
    MeanContribution mean;
    sampling.run(0, mean);
    report.scale_log2 = mean.scale_log2();
    const double factor = std::ldexp(1 / report.unit, report.scale_log2);
    for_each_in_order(
        sampling.task_count(), request.threads,
        [&](std::uint64_t task) {
          CellConsumer consumer(session, grid, factor, request.eye_edges, report.sums);
          sampling.run(task, consumer);
          return consumer.sums();
        },
        [&](std::uint64_t /*task*/, TaskSums&& part) {
          report.mean += part.mean;
          report.crossing += part.crossing;
          report.paths += part.paths;
          report.not_finite += part.not_finite;
          report.too_large += part.too_large;
        });
    const double samples = static_cast<double>(request.pixels.count()) * static_cast<double>(request.spp);
    report.mean = report.mean * (1 / samples);
    report.crossing = report.crossing * (1 / samples);
    return report;
  });
}

Result<loaders::VolumeData> volume_data(const VolumeRequest& request, VolumeReport& report) {
  return within_memory("there is no room for the grid", [&]() -> Result<loaders::VolumeData> {
    const CellGrid& grid = request.grid;
    const Vec3d cell = grid.cell();
    const double samples = static_cast<double>(request.pixels.count()) * static_cast<double>(request.spp);
    const double each = std::ldexp(report.unit, -report.scale_log2) / cell.x / cell.y / cell.z / samples;
    loaders::VolumeData data;
    data.size = grid.size;
    data.channels = 3;
    data.low = Vec3(grid.low);
    data.high = Vec3(grid.high);
    data.values.resize(3 * grid.count());
    for (std::size_t i = 0; i < data.values.size(); ++i) {
      data.values[i] = static_cast<float>(report.sums.value(i) * each);
      if (!std::isfinite(data.values[i]))
        return usage_error("a value of the grid is too large to store")
            .with_field("--box")
            .with_mend("choose a larger box, or fewer cells");
    }
    report.sums = CellSums(0);
    return data;
  });
}

}  // namespace candela::inspect
