#include "client/jobs_of_words.h"

#include <fmt/chrono.h>

#include <algorithm>
#include <ostream>
#include <set>

#include "client/values.h"
#include "common/wire/wire.h"

namespace candela::client {
namespace {

constexpr std::string_view kIdCharacters = "abcdefghijkmnpqrstuvwxyz23456789";  // as the master makes ids
constexpr std::size_t kIdSize = 11;
constexpr int kMaxTold = 5;

// An id as it was printed: nobody need be asked whose it is.
bool is_whole_id(const std::string& word) {
  return word.size() == kIdSize && (word[0] == 'j' || word[0] == 'g') &&
         word.find_first_not_of(kIdCharacters) == std::string::npos;
}

std::string text_of(const v1::JobName& job) {
  return fmt::format("{} ({}{}, {}, {:%Y-%m-%d %H:%M}Z)", printable(job.short_id()),
                     job.group() ? "group " : "", printable(job.name()), wire::name(job.state()),
                     fmt::gmtime(static_cast<std::time_t>(job.submitted_unix_ms() / 1000)));
}

Result<v1::JobName> only_one(const v1::FoundJobs& found) {
  const std::string word = printable(found.word());
  if (found.jobs_size() == 0)
    return usage_error(fmt::format("there is no job '{}'", word))
        .with_mend("give an id, the beginning of one, or a name; `candela list` shows them");
  if (found.total() == 1) return found.jobs(0);
  std::vector<std::string> texts;
  for (int i = 0; i < std::min(found.jobs_size(), kMaxTold); ++i) texts.push_back(text_of(found.jobs(i)));
  if (found.total() > static_cast<std::uint32_t>(kMaxTold))
    texts.push_back(fmt::format("{} more", found.total() - static_cast<std::uint32_t>(kMaxTold)));
  return usage_error(fmt::format("'{}' may be {} jobs", word, found.total()))
      .with_mend(fmt::format("give the id of one: {}", join(texts, ", ")));
}

}  // namespace

Result<std::vector<v1::JobName>> jobs_of_words(FarmClient& farm, const std::vector<std::string>& words) {
  std::vector<std::string> asked;
  for (const std::string& word : words)
    if (!is_whole_id(word)) asked.push_back(word);
  v1::FindJobsResponse answer;
  if (!asked.empty()) {
    CANDELA_ASSIGN(answer, farm.find_jobs(asked));
  }
  std::vector<v1::JobName> out;
  std::set<std::string> ids;
  int next = 0;
  for (const std::string& word : words) {
    v1::JobName job;
    if (is_whole_id(word)) {
      job.set_id(word);
      job.set_group(word[0] == 'g');
    } else {
      if (next >= answer.found_size()) return internal_error("the master left out a word that was asked for");
      CANDELA_ASSIGN(job, only_one(answer.found(next++)));
    }
    if (ids.insert(job.id()).second) out.push_back(std::move(job));
  }
  return out;
}

Result<v1::JobName> job_of_word(FarmClient& farm, const std::string& word) {
  CANDELA_ASSIGN(std::vector<v1::JobName> jobs, jobs_of_words(farm, {word}));
  if (jobs.front().group())
    return usage_error(fmt::format("'{}' is a group of frames", printable(word)))
        .with_mend(fmt::format("give one of its frames; `candela list {}` shows them", shell_quote(word)));
  return std::move(jobs.front());
}

Result<int> for_each_job(Context& context, const std::vector<v1::JobName>& jobs,
                         const std::function<Result<void>(const v1::JobName&)>& what) {
  int code = 0;
  for (const v1::JobName& job : jobs) {
    const Result<void> done = what(job);
    if (done.ok()) continue;
    if (jobs.size() == 1) return done.error();
    context.err << fmt::format("candela: error: {}: {}\n", printable(job.id()),
                               printable(done.error().to_string()));
    if (code == 0) code = done.error().exit_code();
  }
  return code;
}

}  // namespace candela::client
