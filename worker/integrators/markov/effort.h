// Derives two settings of a job of Markov chains from an effort in samples a pixel: the length of segments,
// and the share of the bootstrap in the work.
#pragma once

#include <cstdint>

#include "common/job/job.h"

namespace candela::integrators::markov {

// `mutations`, `direct_samples` and `bootstrap` for `spp` mutations a pixel in all, on a film of `pixels`.
// A job of few samples has short segments, so that it is whole rounds; a small one a bootstrap of a sixteenth
// of its mutations, which is never fewer than four samples for each chain of the default number.
SettingsMap settings_of_effort(std::uint64_t spp, std::uint64_t pixels);

}  // namespace candela::integrators::markov
