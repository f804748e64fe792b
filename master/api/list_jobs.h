// Pages of the list of jobs (client.proto, ListJobs).
#pragma once

#include "candela/v1/client.pb.h"
#include "common/base/result.h"

namespace candela::master {

class Farm;

// Errors (input): the page token is none of ours.
Result<v1::ListJobsResponse> list_jobs(Farm& farm, const v1::ListJobsRequest& request);

}  // namespace candela::master
