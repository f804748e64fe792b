// Messages as JSON text, for scripts and for the page; names and units stay. Numbers that are
// unknown (NaN) and limits that are not set are null; text that is not UTF-8 is mended, never an error.
#pragma once

#include <string>

#include "candela/v1/client.pb.h"
#include "common/base/result.h"

namespace candela::wire {

// An object with at least id, state, units_merged, iterations, error (the estimated relMSE, or null),
// error_upper (the upper end of its 95 % interval, or null) and message.
std::string job_json(const v1::JobStatus& status);
// {"jobs": [...], "groups": [...], "total", "next"}
std::string jobs_json(const v1::ListJobsResponse& response);
std::string group_json(const v1::GroupStatus& status);
std::string trust_json(const v1::TrustResponse& response);
std::string worker_json(const v1::WorkerStatus& status);
std::string workers_json(const v1::ListWorkersResponse& response);  // {"workers": [...], "wanted": {...}}
std::string events_json(const v1::ListEventsResponse& response);    // {"events": [...]}
// One line.
std::string report_json(const v1::JobReport& report);

// A submission as the HTTP API takes it, and back. Its settings have the names and types of a job's.
std::string submission_json(const v1::SubmitRequest& request);
Result<v1::SubmitRequest> parse_submission(const std::string& json);

// The same objects as job_json(), worker_json() and group_json(), compact, for a browser: every text is one
// printable line, and a plan has lines.
std::string page_json(const v1::JobStatus& status);
std::string page_json(const v1::WorkerStatus& status);
std::string page_json(const v1::GroupStatus& status);

}  // namespace candela::wire
