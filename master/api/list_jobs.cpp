// The order is that of submission, the newest first; jobs of one millisecond are ordered by id. A page token
// is the last job of its page, "MILLISECONDS-ID", and the next page begins after that place in the order, so
// a job that was removed in the meantime does no harm.
#include "master/api/list_jobs.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "master/api/messages.h"
#include "master/farm.h"

namespace candela::master {
namespace {

constexpr std::size_t kMaxPage = 1000;
constexpr std::size_t kJobsUnderLock = 50;       // so that no lease waits for a list
constexpr std::size_t kMaxPageBytes = 7U << 20;  // one message is at most 8 MiB

// Ascending order is the newest first.
using ListPlace = std::pair<std::int64_t, std::string>;
ListPlace list_place(std::int64_t submitted_unix_ms, const std::string& id) {
  return {-submitted_unix_ms, id};
}

Result<ListPlace> parse_token(const std::string& token) {
  const char* end = token.data() + token.size();
  std::int64_t ms = 0;
  const auto [at, error] = std::from_chars(token.data(), end, ms);
  if (error != std::errc() || at == end || *at != '-' || at + 1 == end || ms < 0)
    return input_error("no answer of a list gave this token").with_field("page_token");
  return list_place(ms, std::string(at + 1, end));
}

}  // namespace

Result<v1::ListJobsResponse> list_jobs(Farm& farm, const v1::ListJobsRequest& request) {
  std::set<JobState> states;
  for (const int state : request.states()) {
    if (state < v1::JOB_STATE_QUEUED || state > v1::JOB_STATE_CANCELLED)
      return input_error("there is no such state").with_field("states");
    states.insert(static_cast<JobState>(state - v1::JOB_STATE_QUEUED));
  }
  std::vector<ListPlace> order = farm.with_scheduler([&](Scheduler& s) {
    std::vector<ListPlace> out;
    for (const auto& [id, job] : s.jobs())
      if (states.empty() || states.contains(job.row.state))
        out.push_back(list_place(job.row.submitted_unix_ms, id));
    return out;
  });
  std::sort(order.begin(), order.end());
  v1::ListJobsResponse out;
  out.set_total(order.size());
  auto next = order.begin();
  if (!request.page_token().empty()) {
    CANDELA_ASSIGN(const ListPlace last, parse_token(request.page_token()));
    next = std::upper_bound(order.begin(), order.end(), last);
  }
  const std::size_t size =
      request.page_size() == 0 ? kMaxPage : std::min<std::size_t>(request.page_size(), kMaxPage);
  const auto end = next + std::min<std::ptrdiff_t>(order.end() - next, static_cast<std::ptrdiff_t>(size));
  std::size_t bytes = 0;
  while (next != end && bytes < kMaxPageBytes) {
    farm.with_scheduler([&](Scheduler& s) {
      const Now t = farm.now();
      for (std::size_t i = 0; i < kJobsUnderLock && next != end; ++i) {
        const Job* job = s.job(next->second);
        if (job != nullptr && (states.empty() || states.contains(job->row.state))) {
          v1::JobStatus status = to_message(status_of(s, *job, t));
          status.clear_plan();  // long, and the same for like jobs; GetJob has it
          bytes += status.ByteSizeLong() + 8;
          if (bytes >= kMaxPageBytes && out.jobs_size() > 0) return;
          *out.add_jobs() = std::move(status);
        }
        ++next;
      }
    });
  }
  if (next != order.end() && next != order.begin()) {
    const auto& [minus_ms, id] = *std::prev(next);
    out.set_next_page_token(fmt::format("{}-{}", -minus_ms, id));
  }
  return out;
}

}  // namespace candela::master
