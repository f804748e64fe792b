// The status of jobs and workers, as clients are told.
#pragma once

#include "candela/v1/job.pb.h"
#include "candela/v1/worker.pb.h"
#include "master/scheduler/scheduler.h"

namespace candela::master {

// Precondition of these: the lock of `scheduler` is held.
v1::JobStatus status_of(const Scheduler& scheduler, const Job& job, Now t);
v1::WorkerStatus status_of(const Scheduler& scheduler, const WorkerState& worker, Now t);

}  // namespace candela::master
