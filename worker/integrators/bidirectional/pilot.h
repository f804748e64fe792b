// The pilot of the bidirectional family: it measures the film's scale by the eye's walk alone.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/integrators/bidirectional/eye_radiance.h"
#include "worker/integrators/eye_samples.h"

namespace candela::integrators::bidirectional {

// Integrator::pilot_luminances of the family.
inline std::vector<float> pilot(const UnitContext& context, std::uint32_t count, std::uint32_t max_depth,
                                std::uint32_t rr_depth, bool choose_emitter, bool hide_emitters) {
  transport::WalkRules rules;
  rules.max_edges = max_depth;
  rules.rr_depth = rr_depth;
  return pilot_eye_samples(context, count,
                           [&](const Ray& ray, samplers::Sampler& sampler, film::Tallies& tallies) {
                             return eye_radiance<transport::Between::media>(
                                 context.scene, rules, choose_emitter, hide_emitters, ray, sampler, tallies);
                           });
}

}  // namespace candela::integrators::bidirectional
