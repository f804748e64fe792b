// The relMSE of an image with an upper end that covers the truth, from what is merged (docs/error.md).
#pragma once

#include "common/stats/halves.h"
#include "common/stats/movement.h"

namespace candela::stats {

struct ErrorInterval {
  double relmse = 0;  // the estimate: noise + blur
  double upper = 0;   // of the 95 % interval
  double noise = 0;   // relMSE of the image's variance
  double blur = 0;    // relMSE of the bias of merging, as is expected of it; 0 where nothing merges
  double unseen = 0;  // what `upper` has for light that was found too rarely to be in the variance
  double rmse = 0;    // root of the mean variance
  double mean = 0;
  BlockMeans blocks;  // of the image
};

// Facts of a job that the estimate depends on beside its image.
struct ErrorContext {
  // The bias of merging goes as i^(alpha - 1) over the iterations. 1: nothing merges, or radii stay.
  double alpha = 1;
  // Bias of merging over noise that is expected before the image tells any: the mean of the prior.
  double expected_bias = 2.2;
  bool connects = false;               // connections find most light, merging the rest
  const Movement* movement = nullptr;  // of the image up to now
  // The bias by what photons within half of the radius bring (inner_merges.h), in place of the movement.
  // Null or empty: it is not measured.
  const Movement::Bias* measured = nullptr;
};

// NaN, but for the mean, unless both halves have iterations; 0 for a black image. A function of the halves
// and the context alone.
ErrorInterval error_interval(const Halves& halves, const ErrorContext& context = {});

}  // namespace candela::stats
