// What scripts read: messages as JSON text, with names and units that stay. Numbers that are unknown (NaN)
// and limits that are not set are null; text that is not UTF-8 is mended, never an error.
#pragma once

#include <string>

#include "candela/v1/client.pb.h"
#include "common/stats/image_difference.h"

namespace candela::client {

// An object with at least id, state, units_merged, iterations, error (the estimated relMSE, or null),
// error_upper (the upper end of its 95 % interval, or null) and message.
std::string job_json(const v1::JobStatus& status);
std::string jobs_json(const v1::ListJobsResponse& response);  // {"jobs": [...], "total", "next"}
std::string trust_json(const v1::TrustResponse& response);
std::string worker_json(const v1::WorkerStatus& status);
std::string workers_json(const v1::ListWorkersResponse& response);  // {"workers": [...], "wanted": {...}}
std::string events_json(const v1::ListEventsResponse& response);    // {"events": [...]}
// One line.
std::string report_json(const v1::JobReport& report);
std::string submitted_json(const std::string& id, bool existed, std::uint64_t uploaded_bytes);
// `difference`: null where neither file has variances.
std::string comparison_json(const stats::ImageComparison& comparison,
                            const stats::ImageDifference* difference, bool has_variance,
                            bool reference_has_variance);
std::string version_json();
std::string plan_json(const std::string& integrator, const std::map<std::string, std::string>& settings,
                      const std::string& plan);

}  // namespace candela::client
