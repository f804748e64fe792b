// Jobs and groups as text for people: rows of a table, and all of one.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <string>

#include "candela/v1/client.pb.h"

namespace candela::client {

// "2026-11-27 09:55:12Z", or "-".
std::string time_text(std::int64_t unix_ms);
// "shot: frames 1 to 240, 12 done, 2 running, 226 queued"
std::string group_text(const v1::GroupStatus& group);
// The rows of both in one order, by submission; frames of one group by their numbers.
std::string job_table(const v1::ListJobsResponse& jobs);

void print_job(std::ostream& out, const v1::JobStatus& job);
// With a row for each of its frames.
void print_group(std::ostream& out, const v1::GroupStatus& group, const v1::ListJobsResponse& frames);

}  // namespace candela::client
