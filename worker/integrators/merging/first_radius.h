// The merging radius of the first iteration.
#pragma once

#include "worker/integrators/integrator.h"

namespace candela::integrators::merging {

// pixels > 0: so many times the median, over a fixed grid of camera rays, of a pixel's width at what the ray
// meets (sqrt of its area, across the ray), in scene units; where none meets anything, or with pixels = 0,
// `fraction` of the radius of the scene's bounding sphere. Kept within what kernels can take. A pure function
// of the scene and the film's size.
double first_radius(const UnitContext& context, double fraction, double pixels);

// The median width of a pixel, as above; 0 where nothing is met.
double pixel_footprint(const UnitContext& context);

// Bounds of radii for DiscKernel and BallKernel.
inline constexpr double kMinRadius = 1e-12, kGreatestRadius = 1e12;
double clamped_radius(double radius);

}  // namespace candela::integrators::merging
