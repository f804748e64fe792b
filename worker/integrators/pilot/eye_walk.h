// The pilot of the bidirectional family: it measures the film's scale by the eye's walk alone.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/estimators/options.h"
#include "worker/integrators/integrator.h"

namespace candela::integrators {

// Integrator::pilot_luminances of the family.
std::vector<float> pilot_by_eye_walk(const UnitContext& context, std::uint32_t count,
                                     const estimators::PathOptions& options);

}  // namespace candela::integrators
