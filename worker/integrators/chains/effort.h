// Derives settings of a job of Markov chains from its effort: the length of segments, the number of chains,
// and the share of the bootstrap in the work.
#pragma once

#include "common/job/effort.h"
#include "worker/integrators/chains/settings.h"

namespace candela::integrators::chain_jobs {

// `mutations`, `direct_samples`, `chains` and `bootstrap`. A job of few samples a pixel has short segments,
// so that it is whole rounds. A small one has a bootstrap of a sixteenth of its mutations and a chain for
// each hundred samples of it, a tenth of the default numbers of chains at least; the bootstrap is never fewer
// than kOfEachChain samples for each chain.
inline constexpr std::uint64_t kOfEachChain = 4;
// defaults: the integrator's; its ratio of direct_samples to mutations is kept.
SettingsMap settings_of_effort(const Effort& effort, const ChainSettings& defaults);

}  // namespace candela::integrators::chain_jobs
