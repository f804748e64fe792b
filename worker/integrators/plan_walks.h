// Warnings of the plan about the walks of transport/walk.h, the same for every integrator that has them.
#pragma once

#include <cstdint>

#include "worker/integrators/plan.h"
#include "worker/scene/features.h"

namespace candela::integrators {

// Notes a medium in which Russian roulette multiplies the second moment of a walk more than tenfold: see
// "Hazards" in docs/integrators/transport.md. max_depth: edges of the longest path.
void note_lasting_media(const scene::SceneFeatures& features, std::uint32_t max_depth, std::uint32_t rr_depth,
                        Plan& plan);

// Says how shadow rays are shared between an environment and other emitters (scene/emitters/choice/choice.h),
// if there are both.
void plan_shadow_rays(const scene::SceneFeatures& features, Plan& plan);

}  // namespace candela::integrators
