// The integrator of the jobs of `candela inspect paths`: light by the groups of its paths. An iteration is a
// sample of each pixel whose light is taken. The film has a pixel for each batch of iterations, from whose
// spread the errors follow. A contribution is in the image, and in one layer at most: the first one, after
// the layer that selects, whose expression its path matches.
#pragma once

#include "worker/integrators/integrator.h"
#include "worker/integrators/shares/settings.h"

namespace candela::integrators {

// Pixels of the film, which has one row. Iteration i of the job is in batch i mod kShareBatches.
inline constexpr std::uint32_t kShareBatches = 32;

Result<std::unique_ptr<Integrator>> make_shares_integrator(const SettingsMap& settings,
                                                           const scene::SceneFeatures& features);

}  // namespace candela::integrators
