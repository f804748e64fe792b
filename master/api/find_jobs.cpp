#include "master/api/find_jobs.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "master/api/messages.h"
#include "master/farm.h"

namespace candela::master {
namespace {

constexpr int kMaxWords = 1000;
constexpr int kMaxCandidates = 20;
constexpr std::size_t kMinPrefix = 2;

v1::FoundJobs find(const Scheduler& s, const std::string& word) {
  v1::FoundJobs out;
  out.set_word(word);
  const auto name = [&](const std::string& id) {
    const auto job = s.jobs().find(id);
    return job != s.jobs().end() ? name_of(s, job->second) : name_of_group(s, id);
  };
  if (s.jobs().contains(word) || s.groups().contains(word)) {
    *out.add_jobs() = to_message(name(word));
    out.set_total(1);
    return out;
  }
  std::map<std::string, std::int64_t> ids;  // and when they were submitted
  const auto add_prefixed = [&](const auto& map, const auto& submitted) {
    if (word.size() < kMinPrefix) return;
    for (auto it = map.lower_bound(word); it != map.end() && it->first.starts_with(word); ++it)
      ids.emplace(it->first, submitted(it->second));
  };
  const auto of_job = [](const Job& job) { return job.row.submitted_unix_ms; };
  const auto of_group = [](const GroupState& group) { return group.submitted_unix_ms; };
  add_prefixed(s.jobs(), of_job);
  add_prefixed(s.groups(), of_group);
  for (const auto& [id, job] : s.jobs())
    if (job.row.name == word) ids.emplace(id, of_job(job));
  for (const auto& [id, group] : s.groups())
    if (s.job(*group.jobs.begin())->row.frame->group_name == word) ids.emplace(id, of_group(group));
  std::vector<std::pair<std::int64_t, std::string>> newest;
  for (const auto& [id, submitted] : ids) newest.emplace_back(-submitted, id);
  std::sort(newest.begin(), newest.end());
  out.set_total(static_cast<std::uint32_t>(newest.size()));
  for (const auto& [submitted, id] : newest)
    if (out.jobs_size() < kMaxCandidates) *out.add_jobs() = to_message(name(id));
  return out;
}

}  // namespace

Result<v1::FindJobsResponse> find_jobs(Farm& farm, const v1::FindJobsRequest& request) {
  if (request.words_size() > kMaxWords)
    return input_error(fmt::format("more than {} words", kMaxWords)).with_field("words");
  v1::FindJobsResponse out;
  for (const std::string& word : request.words())
    *out.add_found() = farm.with_scheduler([&](Scheduler& s) { return find(s, word); });
  return out;
}

}  // namespace candela::master
