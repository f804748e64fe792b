// What of a job its error's estimate depends on beside its film: how its image has moved
// (jobs/ID/movement.bin). The file is no part of the truth: without it the bias of merging is known again
// after some doublings of the iterations.
#pragma once

#include <filesystem>

#include "common/stats/movement.h"

namespace candela::master {

// Nothing in it where there is none, or none that can be read.
stats::Movement read_movement(const std::filesystem::path& job_folder);
// A write that fails is passed over.
void write_movement(const std::filesystem::path& job_folder, const stats::Movement& movement);

}  // namespace candela::master
