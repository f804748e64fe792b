// What an effort in samples a pixel decides of a job of Markov chains: how long its segments are, and how
// much of the work goes into the bootstrap.
#pragma once

#include <cstdint>

#include "common/job/job.h"

namespace candela::integrators::markov {

// `mutations`, `direct_samples` and `bootstrap` for `spp` mutations a pixel in all, on a film of `pixels`.
// A job of few samples has short segments, so that it is whole rounds; a small one a bootstrap of a sixteenth
// of its mutations, which is never fewer than four samples for each chain of the default number.
SettingsMap settings_of_effort(std::uint64_t spp, std::uint64_t pixels);

}  // namespace candela::integrators::markov
