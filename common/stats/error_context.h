// Facts of a job that the estimate of its error depends on.
#pragma once

#include <string_view>

#include "common/job/job.h"
#include "common/stats/error_interval.h"

namespace candela::stats {

// By a job's complete settings and its plan's text; without the movement.
//
// Squared radii go as i^(alpha - 1), those that statistics decide about as ppm's. Where photons alone make
// the image, most of the bias lies along edges and goes as the radius itself; where connections make what has
// edges, it goes as the radius squared.
//
// Squared bias and noise of photons fall at one rate [Knaus 2011], so that a ratio of the order of one is
// expected at any time: less if radii balance the two (appm), more if they stay until a test finds bias
// (fppm, cppm, vcmplus); connections leave merging little light. The numbers were chosen with the parameters
// of error_interval.cpp.
ErrorContext context_of(const SettingsMap& settings, std::string_view plan);

}  // namespace candela::stats
