#include "worker/integrators/erpt/pilot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "common/base/work_monitor.h"
#include "common/rng/stream.h"
#include "worker/integrators/chains/first_stage.h"
#include "worker/integrators/chains/step_sizes.h"
#include "worker/integrators/decision_bytes.h"
#include "worker/integrators/parallel_tasks.h"
#include "worker/mcmc/chain.h"

namespace candela::integrators::erpt {
namespace {

constexpr std::string_view kKind = "erp3";
constexpr std::uint64_t kPilot = 0x6572707470696cULL;  // "erptpil"
constexpr std::uint64_t kChunk = 256;
constexpr std::uint64_t kMaxLength = 1 << 20;
constexpr double kMaxChosenLength = 1 << 16;
constexpr std::uint64_t kFewestLit = 100;

}  // namespace

double SeedStatistics::one_plus_variance() const {
  const double ratio = mean_square / (b0 * b0);
  return ratio >= 1 && std::isfinite(ratio) ? ratio : 1;
}

Result<SeedStatistics> seed_statistics(const MakeSpace& make_space, std::uint64_t seed, std::uint64_t samples,
                                       const RunContext& run, const mcmc::ImageImportance* importance) {
  std::vector<double> scalars(samples);
  film::UnitFilm no_film({1, 1, 1}, 0);  // only counts
  RunContext quiet = run;
  quiet.progress = nullptr;
  CANDELA_TRY(for_each_task((samples + kChunk - 1) / kChunk, no_film, quiet,
                            [&](std::uint64_t chunk, film::SampleCounts& sample_counts) {
                              work_step();
                              const auto space = make_space(sample_counts);
                              mcmc::SplatList list(importance);
                              const std::uint64_t from = chunk * kChunk;
                              for (std::uint64_t i = from; i < std::min(from + kChunk, samples); ++i) {
                                if (run.stopped()) return;
                                space->start(rng::key(seed, kPilot, i), list);
                                scalars[i] = mcmc::usable_scalar(list, sample_counts);
                              }
                            }));
  SeedStatistics result;
  result.samples = samples;
  for (const double scalar : scalars) {
    result.b0 += scalar / static_cast<double>(samples);
    result.mean_square += scalar * scalar / static_cast<double>(samples);
    if (scalar > 0) ++result.lit;
  }
  return result;
}

Energies choose_energies(const SeedStatistics& statistics, const ErptSettings& settings, Plan& plan) {
  const double k =
      settings.chains_per_seed > 0 ? 1 / settings.chains_per_seed : statistics.one_plus_variance() / 2;
  const double energy = k * statistics.b0;
  Energies result;
  // After dark seeds the least energy there is, by which a seed that carries light starts all its chains.
  const bool dark = !(energy > 0) || !std::isfinite(energy);
  result.energy =
      dark ? std::numeric_limits<double>::min() : std::max(energy, std::numeric_limits<double>::min());
  const double length =
      settings.chain_length > 0
          ? settings.chain_length
          : std::clamp(std::floor(settings.mutations_per_seed * k + 0.5), 1.0, kMaxChosenLength);
  result.mutations = static_cast<std::uint64_t>(length);
  plan.use(
      "energy redistribution",
      dark ? fmt::format("no seed of the pilot carries light: each that does starts {} chains of {} "
                         "mutations",
                         settings.max_chains, result.mutations)
           : fmt::format("{:.3g} chains a seed on average, of {} mutations each; the relative variance of {} "
                         "seeds is {:.3g}",
                         1 / k, result.mutations, statistics.samples, statistics.one_plus_variance() - 1));
  if (statistics.lit < kFewestLit)
    plan.note("seeds", fmt::format("only {} of the pilot's {} seeds carry light: the image is noisy; more "
                                   "seeds help, and so do vcm and mmlt",
                                   statistics.lit, statistics.samples));
  return result;
}

std::string to_bytes(const Decided& decided) {
  DecisionWriter out(kKind);
  out.real(decided.energies.energy);
  out.count(decided.energies.mutations);
  chain_jobs::write(decided.sizes, out);
  chain_jobs::write(decided.importance, out);
  return out.bytes();
}

Result<Decided> decided_of(std::string_view bytes, std::uint32_t width, std::uint32_t height,
                           std::size_t shares) {
  DecisionReader in(bytes, kKind);
  Decided result;
  Energies& energies = result.energies;
  energies.energy = in.real(std::numeric_limits<double>::min(), std::numeric_limits<double>::max());
  energies.mutations = in.count(kMaxLength + 1);
  result.sizes = chain_jobs::read_step_sizes(in, shares);
  result.importance = chain_jobs::read_importance(width, height, in);
  CANDELA_TRY(in.done());
  energies.mutations = std::max<std::uint64_t>(energies.mutations, 1);
  return result;
}

}  // namespace candela::integrators::erpt
