// Pages of the list of jobs (client.proto, ListJobs).
#pragma once

#include <string>

#include "candela/v1/client.pb.h"
#include "common/base/result.h"

namespace candela::master {

class Farm;

// Errors (input): the page token is none of ours.
// `certificate`: the caller's name; empty without TLS.
Result<v1::ListJobsResponse> list_jobs(Farm& farm, const v1::ListJobsRequest& request,
                                       const std::string& certificate);

}  // namespace candela::master
