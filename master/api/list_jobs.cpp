// The order is that of submission, the newest first; jobs of one millisecond are ordered by id. A page token
// is the last job of its page, "MILLISECONDS-ID", and the next page begins after that place in the order, so
// a job that was removed in the meantime does no harm.
#include "master/api/list_jobs.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
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

struct Entry {
  ListPlace place;
  bool group = false;
  bool operator<(const Entry& other) const { return place < other.place; }
};

// Returns USER of USER@HOST.
std::string_view user_of(std::string_view submitter) {
  return submitter.substr(0, submitter.find('@'));
}

struct Filter {
  std::set<JobState> states;  // empty: all
  std::string name;           // a pattern; empty: all
  std::string submitter;      // empty: all
  bool by_certificate = false;
  std::string group_id;  // empty: all

  bool takes(JobState state, const std::string& of_name, const std::string& of_submitter) const {
    return (states.empty() || states.contains(state)) &&
           (name.empty() || ::fnmatch(name.c_str(), of_name.c_str(), 0) == 0) &&
           (submitter.empty() ||
            (by_certificate ? submitter == of_submitter : user_of(submitter) == user_of(of_submitter)));
  }
  bool takes(const Job& job) const {
    const JobRow& row = job.row;
    return takes(row.state, row.name, row.submitter) &&
           (group_id.empty() || (row.frame && row.frame->group_id == group_id));
  }
  bool takes(const JobName& group) const { return takes(group.state, group.name, group.submitter); }
};

Result<Filter> filter_of(const v1::ListJobsRequest& request, const std::string& certificate) {
  Filter out;
  for (const int state : request.states()) {
    if (state < v1::JOB_STATE_QUEUED || state > v1::JOB_STATE_CANCELLED)
      return input_error("there is no such state").with_field("states");
    out.states.insert(static_cast<JobState>(state - v1::JOB_STATE_QUEUED));
  }
  if (request.name().size() > Limits::max_name_bytes)
    return input_error(fmt::format("longer than {} bytes", Limits::max_name_bytes)).with_field("name");
  out.name = request.name();
  out.submitter = request.submitter();
  out.by_certificate = !out.submitter.empty() && !certificate.empty();
  if (out.by_certificate) out.submitter = certificate;
  out.group_id = request.group_id();
  return out;
}

std::vector<Entry> entries(const Scheduler& s, const Filter& filter, bool fold) {
  std::vector<Entry> out;
  for (const auto& [id, job] : s.jobs())
    if (!(fold && job.group != nullptr) && filter.takes(job))
      out.push_back({list_place(job.row.submitted_unix_ms, id), false});
  for (const auto& [id, group] : s.groups())
    if (fold && filter.takes(name_of_group(s, id)))
      out.push_back({list_place(group.submitted_unix_ms, id), true});
  return out;
}

}  // namespace

Result<v1::ListJobsResponse> list_jobs(Farm& farm, const v1::ListJobsRequest& request,
                                       const std::string& certificate) {
  CANDELA_ASSIGN(const Filter filter, filter_of(request, certificate));
  std::vector<Entry> order =
      farm.with_scheduler([&](Scheduler& s) { return entries(s, filter, request.fold()); });
  std::sort(order.begin(), order.end());
  v1::ListJobsResponse out;
  out.set_total(order.size());
  auto next = order.begin();
  if (!request.page_token().empty()) {
    CANDELA_ASSIGN(const ListPlace last, parse_token(request.page_token()));
    next = std::upper_bound(order.begin(), order.end(), Entry{last, false},
                            [](const Entry& a, const Entry& b) { return a.place < b.place; });
  }
  const std::size_t size =
      request.page_size() == 0 ? kMaxPage : std::min<std::size_t>(request.page_size(), kMaxPage);
  const auto end = next + std::min<std::ptrdiff_t>(order.end() - next, static_cast<std::ptrdiff_t>(size));
  std::size_t bytes = 0;
  while (next != end && bytes < kMaxPageBytes) {
    farm.with_scheduler([&](Scheduler& s) {
      const Now t = farm.now();
      for (std::size_t work = 0; work < kJobsUnderLock && next != end; ++next) {
        const std::string& id = next->place.second;
        if (next->group) {
          const auto group = s.groups().find(id);
          if (group == s.groups().end() || !filter.takes(name_of_group(s, id))) continue;
          v1::GroupStatus status = to_message(status_of_group(s, id, t));
          bytes += status.ByteSizeLong() + 8;
          *out.add_groups() = std::move(status);
          work += 1 + group->second.jobs.size() / 10;
          continue;
        }
        const Job* job = s.job(id);
        ++work;
        if (job == nullptr || !filter.takes(*job)) continue;
        v1::JobStatus status = to_message(status_of(s, *job, t));
        status.clear_plan();  // long, and the same for like jobs; GetJob has it
        bytes += status.ByteSizeLong() + 8;
        if (bytes >= kMaxPageBytes && out.jobs_size() > 0) return;
        *out.add_jobs() = std::move(status);
      }
    });
  }
  if (next != order.end() && next != order.begin()) {
    const auto& [minus_ms, id] = std::prev(next)->place;
    out.set_next_page_token(fmt::format("{}-{}", -minus_ms, id));
  }
  return out;
}

}  // namespace candela::master
