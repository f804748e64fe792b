// Step sizes of mutations, which the pilot decides by trials (mcmc/step_trials.h) for the whole job. The sums
// of trials are in the order of their numbers, so that threads and machines do not change the choice.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "worker/integrators/decision_bytes.h"
#include "worker/integrators/integrator.h"
#include "worker/mcmc/step_trials.h"

namespace candela::integrators::chain_jobs {

// samples: independent paths, from which the states of the trials are drawn by their contribution. Adds a
// line to the plan for each mutation. Fails only if it is stopped.
Result<std::vector<mcmc::StepSize>> choose_step_sizes(const mcmc::MutatorContext& context,
                                                      std::span<const mcmc::MutatorShare> shares,
                                                      const mcmc::ImageImportance* importance,
                                                      std::uint64_t seed, std::uint64_t samples, Plan& plan,
                                                      const RunContext& run);

// The shares with these sizes; with their own if there are none.
std::vector<mcmc::MutatorShare> with_sizes(std::span<const mcmc::MutatorShare> shares,
                                           std::span<const mcmc::StepSize> sizes);

void write(std::span<const mcmc::StepSize> sizes, DecisionWriter& out);
// shares: so many sizes, or none. Other numbers are a fault of the reader.
std::vector<mcmc::StepSize> read_step_sizes(DecisionReader& in, std::size_t shares);

}  // namespace candela::integrators::chain_jobs
