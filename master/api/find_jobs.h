// Finds the jobs that a word means (client.proto, FindJobs).
#pragma once

#include "candela/v1/client.pb.h"
#include "common/base/result.h"

namespace candela::master {

class Farm;

// Errors (input): there are too many words.
Result<v1::FindJobsResponse> find_jobs(Farm& farm, const v1::FindJobsRequest& request);

}  // namespace candela::master
