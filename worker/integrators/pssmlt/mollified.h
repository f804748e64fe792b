// The targets of pssmlt that mollify paths which their estimator cannot sample: forms for all scenes,
// compiled by themselves.
#pragma once

#include <memory>

#include "worker/estimators/options.h"
#include "worker/integrators/integrator.h"
#include "worker/mcmc/primary_space.h"

namespace candela::integrators::pssmlt {

// over_path: path tracing, else bidirectional. The options and techniques outlive the target.
std::unique_ptr<mcmc::PrimaryTarget> make_mollified_target(bool over_path, const UnitContext& context,
                                                           const estimators::PathOptions& options,
                                                           const estimators::Techniques& techniques,
                                                           double bandwidth,
                                                           film::SampleCounts& sample_counts);

}  // namespace candela::integrators::pssmlt
