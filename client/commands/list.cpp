// candela list: the jobs of a farm, a group of frames in one row, or the frames of one group.
#include <fmt/chrono.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <ostream>

#include "client/commands/commands.h"
#include "client/commands/job_tables.h"
#include "client/context.h"
#include "client/jobs_of_words.h"
#include "client/values.h"
#include "common/wire/json.h"
#include "common/wire/peer.h"
#include "common/wire/token.h"
#include "common/wire/wire.h"

namespace candela::client {
namespace {

struct ListOptions {
  FarmOptions farm;
  std::optional<std::string> group, limit, state, after, name;
  bool mine = false, unfold = false, json = false;
};

// "running,queued"
Result<std::vector<v1::JobState>> parse_states(std::string_view text) {
  static constexpr std::array<std::string_view, 6> kNames = {"queued", "running", "paused",
                                                             "done",   "failed",  "cancelled"};
  std::vector<v1::JobState> states;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    CANDELA_ASSIGN(const std::string word, parse_choice(text.substr(at, comma - at), "--state", kNames));
    const auto place = std::find(kNames.begin(), kNames.end(), word) - kNames.begin();
    states.push_back(static_cast<v1::JobState>(v1::JOB_STATE_QUEUED + place));
    at = comma + 1;
  }
  return states;
}

Result<int> run_list(Context& context, const ListOptions& options) {
  FarmClient::JobQuery query;
  if (!options.json) query.limit = 100;
  CANDELA_TRY(set_if_given(query.limit, options.limit, "--limit", parse_count, 1, 1000000));
  if (options.state) {
    CANDELA_ASSIGN(query.states, parse_states(*options.state));
  }
  query.page_token = options.after.value_or("");
  query.name = options.name.value_or("");
  if (options.name && options.name->empty())
    return usage_error("the pattern is empty").with_field("--name").with_mend("give one such as 'seq010*'");
  if (options.mine) query.submitter = wire::user_at_host();
  query.fold = !options.unfold && !options.group;
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  if (options.group) {
    CANDELA_ASSIGN(const std::vector<v1::JobName> found, jobs_of_words(*farm, {*options.group}));
    if (!found.front().group())
      return usage_error(fmt::format("'{}' is a job, not a group of frames", printable(*options.group)))
          .with_mend(fmt::format("candela show {}", shell_quote(*options.group)));
    query.group_id = found.front().id();
  }
  CANDELA_ASSIGN(v1::ListJobsResponse response, farm->list_jobs(query));
  std::reverse(response.mutable_jobs()->begin(), response.mutable_jobs()->end());  // the newest last
  std::reverse(response.mutable_groups()->begin(), response.mutable_groups()->end());
  if (options.json) {
    context.out << wire::jobs_json(response) << '\n';
    return 0;
  }
  const int rows = response.jobs_size() + response.groups_size();
  if (rows == 0) {
    context.err << "no jobs\n";
    return 0;
  }
  context.out << job_table(response);
  if (!response.next_page_token().empty())
    context.err << fmt::format("{} of {} jobs; older ones: --after {}, or all with --limit {}\n", rows,
                               response.total(), printable(response.next_page_token()), response.total());
  return 0;
}

}  // namespace

void add_list(CLI::App& app, Context& context) {
  auto options = std::make_shared<ListOptions>();
  CLI::App* sub = app.add_subcommand("list", "List the farm's jobs; a group of frames is one row");
  add_positional(*sub, "group", options->group, "List the frames of this group", "GROUP");
  sub->add_flag("--mine", options->mine, "Jobs that this user has submitted, from any machine");
  add_text(*sub, "--name", options->name,
           "Jobs whose name matches this pattern of a shell, such as 'seq010*'", "PATTERN");
  add_text(*sub, "--state", options->state,
           "Jobs in one of these: queued, running, paused, done, failed, cancelled", "STATE[,STATE]");
  sub->add_flag("--unfold", options->unfold, "List the frames of all groups, not the groups");
  add_text(*sub, "--limit", options->limit, "At most the newest N jobs (default 100; all with --json)", "N");
  add_text(*sub, "--after", options->after,
           "Continue a list: only jobs older than PLACE, the value that the previous list printed", "PLACE");
  add_farm_options(*sub, options->farm);
  sub->add_flag("--json", options->json, "Print JSON");
  set_command(*sub, context, run_list, options);
}

}  // namespace candela::client
