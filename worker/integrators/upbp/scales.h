// The scales of an iteration of upbp: radii and kernels on surfaces and in each medium, and the numbers of
// samples that weights count merges with.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/estimators/options.h"
#include "worker/integrators/merging/rules.h"
#include "worker/integrators/upbp/hits.h"
#include "worker/integrators/upbp/rules.h"
#include "worker/scene/scene.h"
#include "worker/transport/merge_scale.h"
#include "worker/transport/technique/merge_medium.h"

namespace candela::integrators::upbp {

struct IterationScales {
  // Scale of merging on surfaces. In media vertices hold eta (mis/beam_balance.h), whose factor is 1.
  transport::ConstantScale surfaces;
  // By the number of the medium.
  std::vector<transport::MediumKernels> kernels;
  std::vector<transport::MediumMerges> eta;
  std::vector<float> ball_radii, beam_radii;
};

// first: merging radius in the first iteration; one that was chosen for surfaces (merge.is_automatic()) has
// no part in media, which then begin with the fall-back. paths: light paths of an iteration; beam_paths: the
// expected number of those that leave beams. hits: expected in the first iteration.
IterationScales iteration_scales(const MediumRules& rules, const merging::MergeRules& merge,
                                 const estimators::Techniques& techniques, const scene::Scene& scene,
                                 double first, std::uint64_t iteration, double paths, double beam_paths,
                                 const ExpectedHits& hits);

}  // namespace candela::integrators::upbp
