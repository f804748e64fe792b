#include "worker/integrators/chains/step_sizes.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "common/base/work_monitor.h"
#include "common/rng/stream.h"
#include "worker/integrators/parallel_tasks.h"
#include "worker/mcmc/chain.h"

namespace candela::integrators::chain_jobs {
namespace {

constexpr std::uint64_t kSteps = 0x7374657073ULL;  // "steps"
enum Purpose : std::uint64_t { sample, trial };
constexpr std::uint64_t kChunk = 256;
constexpr std::uint64_t kSamplesPerState = 50, kFewestStates = 16, kMostStates = 256;
constexpr std::uint64_t kStatesPerTask = 4;
constexpr std::uint32_t kProposals = 4;  // of a state and size
constexpr double kMaxSize = 1024;

std::uint64_t key_of(std::uint64_t seed, Purpose purpose, std::uint64_t i) {
  return rng::key(rng::combine(seed, kSteps), purpose, i);
}

std::uint64_t divide_up(std::uint64_t a, std::uint64_t b) {
  return (a + b - 1) / b;
}

// Of so many samples those at even distances along the sum of their contributions.
std::vector<std::uint64_t> states_of(const std::vector<double>& scalars, std::uint64_t count) {
  double total = 0;
  for (const double scalar : scalars) total += scalar;
  std::vector<std::uint64_t> out;
  if (!(total > 0)) return out;
  double sum = 0;
  for (std::uint64_t i = 0; i < scalars.size(); ++i) {
    sum += scalars[i];
    while (out.size() < count &&
           sum > (static_cast<double>(out.size()) + 0.5) / static_cast<double>(count) * total)
      out.push_back(i);
  }
  return out;
}

}  // namespace

Result<std::vector<mcmc::StepSize>> choose_step_sizes(const mcmc::MutatorContext& context,
                                                      std::span<const mcmc::MutatorShare> shares,
                                                      const mcmc::ImageImportance* importance,
                                                      std::uint64_t seed, std::uint64_t samples, Plan& plan,
                                                      const RunContext& run) {
  std::vector<double> scalars(samples);
  film::UnitFilm no_film({1, 1, 1}, 0);  // only counts
  RunContext quiet = run;
  quiet.progress = nullptr;
  CANDELA_TRY(for_each_task(divide_up(samples, kChunk), no_film, quiet,
                            [&](std::uint64_t chunk, film::SampleCounts& /*sample_counts*/) {
                              work_step();
                              mcmc::PathSpace space(context, shares);
                              mcmc::SplatList list(importance);
                              film::SampleCounts unused;
                              const std::uint64_t from = chunk * kChunk;
                              for (std::uint64_t i = from; i < std::min(from + kChunk, samples); ++i) {
                                if (run.stopped()) return;
                                space.start(key_of(seed, sample, i), list);
                                scalars[i] = mcmc::usable_scalar(list, unused);
                              }
                            }));
  const std::vector<std::uint64_t> states =
      states_of(scalars, std::clamp(samples / kSamplesPerState, kFewestStates, kMostStates));
  const std::size_t scores_each = mcmc::StepTrials(context, shares, importance).score_count();
  std::vector<std::vector<mcmc::StepScore>> found(states.size(), std::vector<mcmc::StepScore>(scores_each));
  CANDELA_TRY(for_each_task(
      divide_up(states.size(), kStatesPerTask), no_film, quiet,
      [&](std::uint64_t task, film::SampleCounts& /*sample_counts*/) {
        work_step();
        mcmc::StepTrials trials(context, shares, importance);
        const std::uint64_t from = task * kStatesPerTask;
        for (std::uint64_t i = from; i < std::min<std::uint64_t>(from + kStatesPerTask, states.size()); ++i) {
          if (run.stopped()) return;
          trials.run(key_of(seed, sample, states[i]), key_of(seed, trial, i), kProposals, found[i]);
        }
      }));
  std::vector<mcmc::StepScore> sums(scores_each);
  for (const auto& scores : found)
    for (std::size_t i = 0; i < scores_each; ++i) sums[i].add(scores[i]);
  std::vector<mcmc::StepSize> sizes = mcmc::best_sizes(shares, sums);
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const mcmc::MutatorEntry& entry = *shares[i].entry;
    if (!entry.has_image_step) continue;
    std::string line = fmt::format("step_trials: {:.3g} times the default on the film", sizes[i].image);
    if (entry.has_roughness_step)
      line += fmt::format(", {:.3g} times the roughness in slopes", sizes[i].roughness);
    plan.use(fmt::format("steps of {}", entry.name), line + fmt::format(", by {} states", states.size()));
  }
  return sizes;
}

std::vector<mcmc::MutatorShare> with_sizes(std::span<const mcmc::MutatorShare> shares,
                                           std::span<const mcmc::StepSize> sizes) {
  std::vector<mcmc::MutatorShare> out(shares.begin(), shares.end());
  for (std::size_t i = 0; i < sizes.size(); ++i) out[i].step = sizes[i];
  return out;
}

void write(std::span<const mcmc::StepSize> sizes, DecisionWriter& out) {
  out.count(sizes.size());
  for (const mcmc::StepSize& size : sizes) {
    out.real(size.image);
    out.real(size.roughness);
  }
}

std::vector<mcmc::StepSize> read_step_sizes(DecisionReader& in, std::size_t shares) {
  const std::uint64_t count = in.count(shares + 1);
  std::vector<mcmc::StepSize> out(count);
  for (mcmc::StepSize& size : out) {
    size.image = in.real(1 / kMaxSize, kMaxSize);
    size.roughness = in.real(1 / kMaxSize, kMaxSize);
  }
  if (count > 0 && count < shares)
    in.fail(fmt::format("it has {} step sizes for {} mutations", count, shares));
  return out;
}

}  // namespace candela::integrators::chain_jobs
