// The master's own structures <-> messages of the services.
#pragma once

#include "candela/v1/client.pb.h"
#include "candela/v1/worker.pb.h"
#include "master/farm.h"

namespace candela::master {

v1::JobState to_message(JobState state);
v1::JobStatus to_message(const JobStatus& status);
v1::JobName to_message(const JobName& name);
v1::GroupStatus to_message(const GroupStatus& status);
v1::DistrustedWorker to_message(const DistrustRow& row);
v1::WorkerStatus to_message(const WorkerStatus& status);
v1::JobReport to_message(const JobReport& report);
v1::GetLedgerResponse to_message(const Ledger& ledger);
v1::DeltaVerdict to_message(DeltaVerdict verdict);

// Errors: the unit, the hash, the seconds.
Result<DeltaHeader> from_message(const v1::DeltaHeader& header);

}  // namespace candela::master
