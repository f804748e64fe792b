// The target of mmlt that mollifies paths which no technique can sample: a form for all scenes, compiled by
// itself.
#pragma once

#include <memory>

#include "worker/estimators/options.h"
#include "worker/integrators/integrator.h"
#include "worker/integrators/mmlt/lengths.h"
#include "worker/mcmc/primary_space.h"

namespace candela::integrators::mmlt {

// The options, techniques and lengths outlive the target.
std::unique_ptr<mcmc::PrimaryTarget> make_mollified_target(const UnitContext& context,
                                                           const estimators::PathOptions& options,
                                                           const estimators::Techniques& techniques,
                                                           const Lengths& lengths, double bandwidth,
                                                           film::SampleCounts& sample_counts);

}  // namespace candela::integrators::mmlt
