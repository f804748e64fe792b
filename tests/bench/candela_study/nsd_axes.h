// Normalised standard deviations of estimators that meet light in a medium at points or along beams, in
// closed form: one light ray and one eye ray at a right angle in a homogeneous medium, kernels that are
// products of boxes, distances sampled in proportion to transmittance. The offset of the rays is uniform.
#pragma once

#include <string>
#include <vector>

namespace candela::study {

// The sample of one side along its own ray: a point at the sampled distance; or a beam, short (the beam ends
// at the sampled distance) or long, not blurred along itself or blurred.
enum class AxisKind { point, short_beam, long_beam, blurred_short_beam, blurred_long_beam };

struct NsdEstimator {
  std::string name;  // as in [Jarosz 2011], light first
  AxisKind light, eye;
};
// All 25.
const std::vector<NsdEstimator>& nsd_estimators();

// The place where the rays cross. u: the kernel's full width in mean free paths.
struct Crossing {
  bool fixed;  // at `depth`, on both rays; else uniform over an interval that begins half a width before the
               // ray
  double depth;  // mean free paths; else the interval's length
};

// The mean along one axis over the transmittance e^-depth (a fixed crossing) or over 1 / depth (uniform).
double axis_mean(AxisKind kind, const Crossing& crossing, double u);
// Second moment over squared mean. A fixed crossing must be at least u / 2 deep.
double axis_ratio(AxisKind kind, const Crossing& crossing, double u);
// sqrt(R_light R_eye D / u - 1) for offsets uniform over D mean free paths.
double nsd(const NsdEstimator& estimator, const Crossing& crossing, double u, double offsets);
// The same of the mean of `paths` light paths that one eye path meets: it does not fall below sqrt(R_eye -
// 1).
double nsd_of_many(const NsdEstimator& estimator, const Crossing& crossing, double u, double offsets,
                   double paths);

}  // namespace candela::study
