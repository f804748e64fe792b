// candela show, events, pause, resume, cancel, priority, extend: looking at jobs and steering them.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <ostream>
#include <utility>

#include "client/commands/commands.h"
#include "client/commands/job_tables.h"
#include "client/context.h"
#include "client/jobs_of_words.h"
#include "client/progress.h"
#include "client/values.h"
#include "common/wire/job_figures.h"
#include "common/wire/json.h"
#include "common/wire/wire.h"

namespace candela::client {
namespace {

struct JobOptions {
  FarmOptions farm;
  std::vector<std::string> ids;
  bool json = false;
  std::optional<std::string> limit;                         // events
  std::optional<std::string> spp, iterations, time, until;  // extend
};

// Collects the JSON of a command on several jobs: one object for one job, or two lists for all.
class Answers {
 public:
  void add(const v1::JobStatus& job) { *all_.add_jobs() = job; }
  void add(const v1::GroupStatus& group) { *all_.add_groups() = group; }
  std::string json(std::size_t asked) const {
    if (asked > 1 || all_.jobs_size() + all_.groups_size() != 1) {
      v1::ListJobsResponse all = all_;
      all.set_total(static_cast<std::uint64_t>(all.jobs_size() + all.groups_size()));
      return wire::jobs_json(all);
    }
    return all_.jobs_size() == 1 ? wire::job_json(all_.jobs(0)) : wire::group_json(all_.groups(0));
  }

 private:
  v1::ListJobsResponse all_;
};

// Asks for each of the jobs and groups, and prints what came: by print(), or as JSON.
template <class OfJob, class OfGroup>
Result<int> run_each(Context& context, const JobOptions& options, FarmClient& farm, OfJob&& of_job,
                     OfGroup&& of_group) {
  CANDELA_ASSIGN(const std::vector<v1::JobName> jobs, jobs_of_words(farm, options.ids));
  Answers answers;
  Result<int> code = for_each_job(context, jobs, [&](const v1::JobName& job) -> Result<void> {
    if (job.group()) {
      CANDELA_ASSIGN(const v1::GroupStatus status, of_group(job.id()));
      answers.add(status);
    } else {
      CANDELA_ASSIGN(const v1::JobStatus status, of_job(job.id()));
      answers.add(status);
    }
    return {};
  });
  if (!code.ok()) return code;
  if (options.json) context.out << answers.json(jobs.size()) << '\n';
  return code;
}

Result<int> run_show(Context& context, const JobOptions& options) {
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  bool first = true;
  const auto next = [&] {
    if (!options.json && !std::exchange(first, false)) context.out << '\n';
  };
  return run_each(
      context, options, *farm,
      [&](const std::string& id) -> Result<v1::JobStatus> {
        CANDELA_ASSIGN(v1::JobStatus status, farm->get_job(id));
        next();
        if (!options.json) print_job(context.out, status);
        return status;
      },
      [&](const std::string& id) -> Result<v1::GroupStatus> {
        CANDELA_ASSIGN(v1::GroupStatus status, farm->get_group(id));
        next();
        if (options.json) return status;
        CANDELA_ASSIGN(const v1::ListJobsResponse frames, farm->list_jobs({.group_id = id}));
        print_group(context.out, status, frames);
        return status;
      });
}

Result<int> run_events(Context& context, const JobOptions& options) {
  std::uint64_t limit = 100;
  CANDELA_TRY(set_if_given(limit, options.limit, "--limit", parse_count, 1, 10000));
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  std::string id;
  if (!options.ids.empty()) {
    CANDELA_ASSIGN(const v1::JobName job, job_of_word(*farm, options.ids.front()));
    id = job.id();
  }
  CANDELA_ASSIGN(const v1::ListEventsResponse response,
                 farm->list_events(id, static_cast<std::uint32_t>(limit)));
  if (options.json) {
    context.out << wire::events_json(response) << '\n';
    return 0;
  }
  for (const auto& event : response.events())
    context.out << fmt::format("{}  {:<14} {:<14} {:<18} {}\n", time_text(event.unix_ms()),
                               event.job_id().empty() ? "-" : printable(event.job_id()),
                               event.worker_id().empty() ? "-" : printable(event.worker_id()),
                               printable(event.kind()), printable(event.message()));
  return 0;
}

std::string state_text(const auto& status) {
  return fmt::format("{}{}", wire::name(status.state()),
                     status.message().empty() ? "" : ": " + printable(status.message()));
}

// Pause, resume and cancel: one call for each, and the state it led to.
Result<int> run_steer(Context& context, const JobOptions& options, v1::SteerGroupRequest::Action action,
                      Result<v1::JobStatus> (FarmClient::*call)(const std::string&)) {
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  return run_each(
      context, options, *farm,
      [&](const std::string& id) -> Result<v1::JobStatus> {
        CANDELA_ASSIGN(v1::JobStatus status, (farm.get()->*call)(id));
        if (!options.json)
          context.err << fmt::format("job {} is {}\n", printable(status.id()), state_text(status));
        return status;
      },
      [&](const std::string& id) -> Result<v1::GroupStatus> {
        v1::SteerGroupRequest request;
        request.set_group_id(id);
        request.set_action(action);
        CANDELA_ASSIGN(v1::GroupStatus status, farm->steer_group(request));
        if (!options.json)
          context.err << fmt::format("group {} is {}; {}\n", printable(id), wire::name(status.state()),
                                     group_text(status));
        return status;
      });
}

Result<int> run_priority(Context& context, JobOptions options) {
  if (options.ids.size() < 2)
    return usage_error("a job and its new priority are needed")
        .with_field("ID... PRIORITY")
        .with_mend("candela priority ID 10");
  CANDELA_ASSIGN(const std::int64_t priority,
                 parse_integer(options.ids.back(), "priority", -1000000, 1000000));
  options.ids.pop_back();
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  return run_each(
      context, options, *farm,
      [&](const std::string& id) -> Result<v1::JobStatus> {
        CANDELA_ASSIGN(v1::JobStatus status, farm->set_priority(id, static_cast<std::int32_t>(priority)));
        if (!options.json)
          context.err << fmt::format("job {} has priority {}\n", printable(id), status.priority());
        return status;
      },
      [&](const std::string& id) -> Result<v1::GroupStatus> {
        v1::SteerGroupRequest request;
        request.set_group_id(id);
        request.set_action(v1::SteerGroupRequest::ACTION_PRIORITY);
        request.set_priority(static_cast<std::int32_t>(priority));
        CANDELA_ASSIGN(v1::GroupStatus status, farm->steer_group(request));
        if (!options.json)
          context.err << fmt::format("group {} has priority {}\n", printable(id), status.priority());
        return status;
      });
}

// The text after the plus of an addition. Without a plus "16" could mean sixteen in all.
Result<std::string_view> after_plus(std::string_view text, std::string_view option) {
  if (text.size() > 1 && text.starts_with('+')) return text.substr(1);
  return usage_error(fmt::format("'{}' does not say whether it is added or is a new limit", printable(text)))
      .with_field(std::string(option))
      .with_mend(fmt::format("write {} +{} for so much more", option, printable(text)));
}

Result<int> run_extend(Context& context, const JobOptions& options) {
  v1::ExtendJobRequest request;
  if (options.iterations) {
    CANDELA_ASSIGN(const std::string_view text, after_plus(*options.iterations, "--iterations"));
    CANDELA_ASSIGN(const std::uint64_t more, parse_count(text, "--iterations", 1, Limits::max_iterations));
    request.set_add_iterations(more);
  }
  if (options.time) {
    CANDELA_ASSIGN(const std::string_view text, after_plus(*options.time, "--time"));
    CANDELA_ASSIGN(const double more, parse_duration(text, "--time"));
    request.set_add_time_seconds(more);
  }
  if (options.until) {
    CANDELA_ASSIGN(const double target, parse_until(*options.until, "--until"));
    request.set_relmse(target);
  }
  if (!options.spp && !options.iterations && !options.time && !options.until)
    return usage_error("nothing to extend by")
        .with_mend("give --spp +N, --time +DURATION or --until relmse=X");
  if (options.spp && options.iterations)
    return usage_error("--spp and --iterations exclude each other").with_mend("give one of them");
  std::uint64_t spp = 0;
  if (options.spp) {
    CANDELA_ASSIGN(const std::string_view text, after_plus(*options.spp, "--spp"));
    CANDELA_ASSIGN(spp, parse_count(text, "--spp", 1, Limits::max_iterations));
  }
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  // --spp asks for the rounds that bring at least as many samples.
  const auto set_rounds = [&](const v1::JobStatus& job) -> Result<void> {
    const double each = wire::samples_per_iteration(job);
    if (!(each > 0))
      return usage_error("how many samples a round of this job brings is not known before its pilot")
          .with_field("--spp")
          .with_mend("try again when it renders, or give --iterations +N");
    request.set_add_iterations(static_cast<std::uint64_t>(std::ceil(static_cast<double>(spp) / each)));
    return {};
  };
  return run_each(
      context, options, *farm,
      [&](const std::string& id) -> Result<v1::JobStatus> {
        request.set_job_id(id);
        if (spp > 0) {
          CANDELA_ASSIGN(const v1::JobStatus job, farm->get_job(id));
          CANDELA_TRY(set_rounds(job));
        }
        CANDELA_ASSIGN(v1::JobStatus status, farm->extend_job(request));
        if (!options.json)
          context.err << fmt::format("job {} is {}: {}\n", printable(id), wire::name(status.state()),
                                     format_progress(status));
        return status;
      },
      [&](const std::string& id) -> Result<v1::GroupStatus> {
        v1::SteerGroupRequest steer;
        steer.set_group_id(id);
        steer.set_action(v1::SteerGroupRequest::ACTION_EXTEND);
        request.clear_job_id();
        if (spp > 0) {  // of the first frame: all have one integrator
          CANDELA_ASSIGN(const v1::ListJobsResponse frames, farm->list_jobs({.limit = 1, .group_id = id}));
          if (frames.jobs_size() == 0) return refused_error("the group has no frames");
          CANDELA_TRY(set_rounds(frames.jobs(0)));
        }
        *steer.mutable_extend() = request;
        CANDELA_ASSIGN(v1::GroupStatus status, farm->steer_group(steer));
        if (!options.json)
          context.err << fmt::format("group {} is {}; {}\n", printable(id), wire::name(status.state()),
                                     group_text(status));
        return status;
      });
}

CLI::App* add_job_command(CLI::App& app, const std::shared_ptr<JobOptions>& options, const char* name,
                          const char* doc) {
  CLI::App* sub = app.add_subcommand(name, doc);
  add_job_words(*sub, options->ids, "The jobs or groups: ids, their beginnings, or names");
  add_farm_options(*sub, options->farm);
  sub->add_flag("--json", options->json, "Print JSON");
  return sub;
}

void add_steer(CLI::App& app, Context& context, const char* name, const char* doc,
               v1::SteerGroupRequest::Action action,
               Result<v1::JobStatus> (FarmClient::*call)(const std::string&)) {
  auto options = std::make_shared<JobOptions>();
  CLI::App* sub = add_job_command(app, options, name, doc);
  set_command(*sub, context,
              [&context, options, action, call] { return run_steer(context, *options, action, call); });
}

}  // namespace

void add_show(CLI::App& app, Context& context) {
  auto options = std::make_shared<JobOptions>();
  CLI::App* sub = add_job_command(
      app, options, "show",
      "Show a job: state, progress, settings; or the frames of a group. 'at most' is the upper end of the 95 "
      "% interval of relMSE; --until stops by it. It leaves out light that no sample has found; if the plan "
      "expects such light, a line says so (docs/error.md)");
  set_command(*sub, context, run_show, options);
}

void add_events(CLI::App& app, Context& context) {
  auto options = std::make_shared<JobOptions>();
  CLI::App* sub = app.add_subcommand("events", "Print the events of the farm, or of a job");
  sub->add_option("id", options->ids, "Only events of this job: its id, the beginning, or its name")
      ->expected(1)
      ->type_name("ID");
  add_farm_options(*sub, options->farm);
  sub->add_flag("--json", options->json, "Print JSON");
  add_text(*sub, "--limit", options->limit, "At most the last N events (default 100)", "N");
  set_command(*sub, context, run_events, options);
}

void add_pause(CLI::App& app, Context& context) {
  add_steer(app, context, "pause", "Pause jobs", v1::SteerGroupRequest::ACTION_PAUSE, &FarmClient::pause_job);
}
void add_resume(CLI::App& app, Context& context) {
  add_steer(app, context, "resume",
            "Continue paused or failed jobs; a job that waits after failures tries again at once",
            v1::SteerGroupRequest::ACTION_RESUME, &FarmClient::resume_job);
}
void add_cancel(CLI::App& app, Context& context) {
  add_steer(app, context, "cancel", "End jobs; their partial images are kept",
            v1::SteerGroupRequest::ACTION_CANCEL, &FarmClient::cancel_job);
}

void add_priority(CLI::App& app, Context& context) {
  auto options = std::make_shared<JobOptions>();
  CLI::App* sub = app.add_subcommand(
      "priority",
      "Set the priority of jobs; jobs of higher priority run first, and cut units of lower priority short");
  sub->add_option("ids", options->ids,
                  "The jobs or groups, and their new priority, -1000000 to 1000000; default of jobs: 0")
      ->required()
      ->type_name("ID... PRIORITY");
  add_farm_options(*sub, options->farm);
  sub->add_flag("--json", options->json, "Print JSON");
  set_command(*sub, context, run_priority, options);
}

void add_extend(CLI::App& app, Context& context) {
  auto options = std::make_shared<JobOptions>();
  CLI::App* sub =
      add_job_command(app, options, "extend", "Add to the limits of jobs; a finished job continues");
  add_text(*sub, "--spp", options->spp, "Add N samples (Markov chains: mutations) per pixel", "+N");
  add_text(*sub, "--iterations", options->iterations, "Add N iterations", "+N");
  add_text(*sub, "--time", options->time, "Add this time", "+DURATION");
  add_text(*sub, "--until", options->until, "New target for the upper end of the estimated error",
           "relmse=X");
  set_command(*sub, context, run_extend, options);
}

}  // namespace candela::client
