// A submission, by whatever door it came: checked, and made a job.
#pragma once

#include <string>

#include "candela/v1/client.pb.h"
#include "master/farm.h"

namespace candela::master {

struct SubmittedJob {
  std::string job_id;
  bool existed = false;
  std::string group_id;  // empty: of none
};
// `certificate`: the caller's name, which then stands in place of the submitter; empty: it has none. Errors
// as SubmitRequest says. ErrorKind::refused with the field idempotency_token: the token was used for another
// job.
Result<SubmittedJob> submit_job(Farm& farm, const v1::SubmitRequest& request, const std::string& certificate);

}  // namespace candela::master
