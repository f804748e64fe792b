// Figures that follow from what a job's status says.
#pragma once

#include <cstdint>
#include <string>

#include "candela/v1/job.pb.h"

namespace candela::wire {

// Samples, or mutations, that one iteration of the job brings to each pixel; 0 where no pilot has told it
// yet.
double samples_per_iteration(const v1::JobStatus& status);
// Iterations that the job ends with: those of its limit, or of the exact indices that it was asked for. 0:
// neither is set.
std::uint64_t iterations_asked(const v1::JobStatus& status);
// The exact indices of both halves that the job was asked for ("0-31/0-29"); empty: it was asked for none.
std::string indices_text(const v1::JobStatus& status);

}  // namespace candela::wire
