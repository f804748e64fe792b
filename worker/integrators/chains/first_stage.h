// The first stage of two-stage Metropolis: a coarse image by bidirectional path tracing, whatever the chains
// follow, and the importance of the film that follows from it (mcmc/image_importance.h). The pilot decides it
// for the whole job.
#pragma once

#include <cstdint>

#include "worker/estimators/options.h"
#include "worker/integrators/decision_bytes.h"
#include "worker/integrators/integrator.h"
#include "worker/mcmc/image_importance.h"

namespace candela::integrators::chain_jobs {

// options: of all paths of the image. Adds a line to the plan. Fails only if it is stopped.
Result<mcmc::ImageImportance> first_stage(const UnitContext& context, const estimators::PathOptions& options,
                                          std::uint64_t samples, Plan& plan, const RunContext& run);

// Nothing is written if the importance is even.
void write(const mcmc::ImageImportance& importance, DecisionWriter& out);
// Even if there is nothing left to read.
mcmc::ImageImportance read_importance(std::uint32_t width, std::uint32_t height, DecisionReader& in);

}  // namespace candela::integrators::chain_jobs
