#include "worker/integrators/chains/first_stage.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "common/base/work_monitor.h"
#include "common/job/integrator_words.h"
#include "common/rng/stream.h"
#include "worker/integrators/bidirectional/plan.h"
#include "worker/integrators/chains/bdpt_target.h"
#include "worker/integrators/parallel_tasks.h"

namespace candela::integrators::chain_jobs {
namespace {

constexpr std::uint64_t kFirstStage = 0x7374616765ULL;  // "stage"
constexpr std::uint64_t kChunk = 1024;
constexpr std::size_t kLevelsPerWord = 8;
// One splat counts as at most so many times the mean of all samples: a firefly would darken its cell's part
// of the film for the whole job.
constexpr double kMaxSplat = 32;

struct CellSplat {
  std::uint32_t cell;
  double luminance;
};

}  // namespace

Result<mcmc::ImageImportance> first_stage(const UnitContext& context, const estimators::PathOptions& options,
                                          std::uint64_t samples, Plan& plan, const RunContext& run) {
  UnitContext plain = context;
  plain.letters = nullptr;
  estimators::PathOptions of_bdpt = options;
  of_bdpt.rr_depth = static_cast<std::uint32_t>(integrator_words::kBdpt.rr_depth);
  const Planned planned = bidirectional::plan(of_bdpt, context.scene.features(), false);
  const mcmc::CoarseGrid grid(context.width, context.height);
  const std::uint64_t chunks = (samples + kChunk - 1) / kChunk;
  std::vector<std::vector<CellSplat>> found(chunks);
  film::UnitFilm no_film({1, 1, 1}, 0);  // only counts
  RunContext quiet = run;
  quiet.progress = nullptr;
  CANDELA_TRY(
      for_each_task(chunks, no_film, quiet, [&](std::uint64_t chunk, film::SampleCounts& sample_counts) {
        work_step();
        // The form for media is right for all scenes.
        BdptTarget<transport::EdgeContent::media> target(plain, of_bdpt, planned.techniques, sample_counts);
        mcmc::PrimarySpace space(target, {});
        mcmc::SplatList list;
        for (std::uint64_t i = chunk * kChunk; i < std::min((chunk + 1) * kChunk, samples); ++i) {
          if (run.stopped()) return;
          space.start(rng::key(context.seed, kFirstStage, i), list);
          if (list.fault()) continue;
          for (const mcmc::Splat& splat : list.splats())
            found[chunk].push_back({grid.cell_of(splat.at), static_cast<double>(luminance(splat.value))});
        }
      }));
  double mean = 0;
  for (const auto& splats : found)
    for (const CellSplat& splat : splats) mean += splat.luminance / static_cast<double>(samples);
  std::vector<double> cells(grid.cells());
  for (const auto& splats : found)
    for (const CellSplat& splat : splats) cells[splat.cell] += std::min(splat.luminance, kMaxSplat * mean);
  for (std::uint32_t i = 0; i < grid.cells(); ++i) cells[i] /= grid.pixels_of(i);
  mcmc::ImageImportance importance = mcmc::importance_of(grid, cells, samples, mean);
  if (importance.even())
    plan.skip("two stages", fmt::format("two_stage: no light in {} samples of the first stage", samples));
  else
    plan.use("two stages",
             fmt::format("two_stage: chains follow light over the brightness of {} by {} cells, "
                         "from {} samples of bdpt",
                         grid.columns, grid.rows, samples));
  return importance;
}

void write(const mcmc::ImageImportance& importance, DecisionWriter& out) {
  const auto levels = importance.levels();
  if (!levels.empty()) out.real(importance.max_scalar());
  for (std::size_t i = 0; i < levels.size(); i += kLevelsPerWord) {
    std::uint64_t word = 0;
    for (std::size_t j = i; j < std::min(i + kLevelsPerWord, levels.size()); ++j)
      word |= std::uint64_t{levels[j]} << (8 * (j - i));
    out.count(word);
  }
}

mcmc::ImageImportance read_importance(std::uint32_t width, std::uint32_t height, DecisionReader& in) {
  if (!in.more()) return {};
  const mcmc::CoarseGrid grid(width, height);
  const double max_scalar = in.real(0, std::numeric_limits<double>::infinity());
  std::vector<std::uint8_t> levels(grid.cells());
  std::uint64_t word = 0;
  for (std::size_t i = 0; i < levels.size(); ++i) {
    if (i % kLevelsPerWord == 0) word = in.count(~std::uint64_t{0});
    levels[i] = std::min(static_cast<std::uint8_t>(word & 0xff), mcmc::ImageImportance::kMaxLevel);
    word >>= 8;
  }
  return {grid, std::move(levels), max_scalar};
}

}  // namespace candela::integrators::chain_jobs
