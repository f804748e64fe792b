// Estimates the work of a job from its limits, before the job begins.
#pragma once

#include <cstdint>

#include "common/job/job.h"

namespace candela {

struct Effort {
  std::uint64_t pixels = 1;
  std::uint64_t spp = 0;      // samples, or mutations, a pixel, if they are a limit; else 0
  std::uint64_t samples = 0;  // or mutations, in all: the least that the limits tell of
};

// spp: 0 if it is no limit; then an iteration of `stop` brings samples_per_iteration to a pixel. The number
// of samples of a time is that of one slow processor, since nobody knows how many there will be: so many of
// them come in any case, and the same time means the same everywhere. The number for a relMSE follows from
// that of a pixel's independent samples whose standard deviation is their mean. The least of all limits
// counts. Numbers that do not fit are the largest one.
Effort effort_of(std::uint64_t spp, const StopRule& stop, std::uint64_t pixels,
                 std::uint64_t samples_per_iteration);

}  // namespace candela
