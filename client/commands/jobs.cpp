// candela list, show, events, pause, resume, cancel, priority, extend: looking at jobs and steering them.
#include <fmt/chrono.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <ostream>

#include "client/commands/commands.h"
#include "client/context.h"
#include "client/progress.h"
#include "client/values.h"
#include "common/wire/job_figures.h"
#include "common/wire/json.h"
#include "common/wire/wire.h"

namespace candela::client {
namespace {

constexpr std::size_t kMostIndexBytes = 120;  // of a set of indices that `show` prints

struct JobOptions {
  FarmOptions farm;
  std::string id;
  bool json = false;
  std::optional<std::string> limit;         // list, events
  std::optional<std::string> state, after;  // list
  std::string priority;
  std::optional<std::string> spp, iterations, time, until;  // extend
};

std::string time_text(std::int64_t unix_ms) {
  if (unix_ms <= 0) return "-";
  return fmt::format("{:%Y-%m-%d %H:%M:%S}Z", fmt::gmtime(static_cast<std::time_t>(unix_ms / 1000)));
}

std::string error_text(const v1::JobStatus& s) {
  return s.iterations() > 0 && std::isfinite(s.relmse_estimate()) ? fmt::format("{:.2e}", s.relmse_estimate())
                                                                  : "-";
}

std::string submitter_text(const v1::JobStatus& s) {
  return s.submitter().empty() ? "-" : printable(s.submitter());
}

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

Result<int> run_list(Context& context, const JobOptions& options) {
  FarmClient::JobQuery query;
  if (!options.json) query.limit = 100;
  if (options.limit) {
    CANDELA_ASSIGN(query.limit, parse_count(*options.limit, "--limit", 1, 1000000));
  }
  if (options.state) {
    CANDELA_ASSIGN(query.states, parse_states(*options.state));
  }
  query.page_token = options.after.value_or("");
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  CANDELA_ASSIGN(v1::ListJobsResponse response, farm->list_jobs(query));
  std::reverse(response.mutable_jobs()->begin(), response.mutable_jobs()->end());  // the newest last
  if (options.json) {
    context.out << wire::jobs_json(response) << '\n';
    return 0;
  }
  if (response.jobs_size() == 0) {
    context.err << "no jobs\n";
    return 0;
  }
  context.out << fmt::format("{:<14} {:<10} {:>4}  {:>12} {:>10} {:>8}  {:<16}  {}\n", "ID", "STATE", "DONE",
                             "ITERATIONS", "RELMSE", "PRIORITY", "SUBMITTER", "NAME");
  for (const auto& s : response.jobs())
    context.out << fmt::format(
        "{:<14} {:<10} {:>3.0f}%  {:>12} {:>10} {:>8}  {:<16}  {}\n", printable(s.id()),
        wire::name(s.state()), std::floor(100 * (s.state() == v1::JOB_STATE_DONE ? 1 : fraction_done(s))),
        s.iterations(), error_text(s), s.priority(), submitter_text(s), printable(s.name()));
  if (!response.next_page_token().empty())
    context.err << fmt::format("{} of {} jobs; older ones: --after {}, or all with --limit {}\n",
                               response.jobs_size(), response.total(), printable(response.next_page_token()),
                               response.total());
  return 0;
}

std::string percent(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? "-"
                    : fmt::format("{:.1f} %", 100 * static_cast<double>(part) / static_cast<double>(whole));
}

// "3 by place, 1 by network"
template <class Failures>
std::string failures_text(const Failures& failures) {
  std::vector<std::string> parts;
  for (const auto& f : failures)
    parts.push_back(fmt::format("{} by {}", f.count(), name(wire::from_proto(f.cause()))));
  return join(parts, ", ");
}

template <class Line>
void print_chains(Line&& line, const v1::JobStatus& s) {
  const v1::ChainStatus& c = s.chains();
  line("chains", fmt::format("{}, {} mutations a segment", c.plan().chains(), c.plan().segment_mutations()));
  if (!s.has_named_state()) {
    line("bootstrap", fmt::format("{} of {} samples", c.bootstrap_done(), c.plan().bootstrap_samples()));
    return;
  }
  line("bootstrap", fmt::format("b0 = {:.6g} from {} samples", s.named_state().bootstrap_b(),
                                c.plan().bootstrap_samples()));
  line("b", fmt::format("{:.6g} +- {:.2g} (standard error) from {} samples", c.b(), c.b_standard_error(),
                        c.b_samples()));
  for (int i = 0; i < c.groups_size(); ++i) {
    const v1::ChainGroupStatus& g = c.groups(i);
    if (g.mutations() == 0) continue;
    line(fmt::format("  group {}", i),
         fmt::format(
             "{} mutations, {} accepted; {} large, {} of them accepted; longest stay {} at {:.0f}, {:.0f}",
             g.mutations(), percent(g.accepted(), g.mutations()), percent(g.large_steps(), g.mutations()),
             percent(g.large_accepted(), g.large_steps()), g.longest_stay(), std::floor(g.stay_x()),
             std::floor(g.stay_y())));
  }
}

template <class Line>
void print_epochs(Line&& line, const v1::EpochStatus& e) {
  line("epoch", fmt::format("{}: iterations {} to {}", e.epoch(), e.first_iteration(),
                            e.first_iteration() + e.iterations() - 1));
  for (const v1::Figure& figure : e.figures())
    line("  " + figure.name(), fmt::format(" {:.6g}", figure.value()));
  line("statistics", fmt::format("{:.1f} MB in the master's memory, {:.1f} MB received",
                                 static_cast<double>(e.statistics_bytes()) * 1e-6,
                                 static_cast<double>(e.received_bytes()) * 1e-6));
}

void print_job(std::ostream& out, const v1::JobStatus& s) {
  const auto line = [&](std::string_view name, const std::string& value) {
    out << fmt::format("{:<14}{}\n", name, printable(value));
  };
  line("id", s.id());
  line("name", s.name());
  line("submitter", submitter_text(s));
  line("state", std::string(wire::name(s.state())));
  if (!s.message().empty()) line("message", s.message());
  if (s.failures_size() > 0) line("failures", failures_text(s.failures()));
  line("progress", format_progress(s));
  line("effort", effort_text(s, s.iterations()));
  line("iterations",
       fmt::format("{} in {} units, {} more leased", s.iterations(), s.units_merged(), s.units_leased()));
  for (const v1::Taint& taint : s.taints())
    line("false?", fmt::format("worker {}, distrusted since {}, delivered {} of this job: render it again",
                               printable(taint.worker()), time_text(taint.since_unix_ms()),
                               taint.units() > 0 ? fmt::format("{} units", taint.units())
                                                 : std::string("the pilot or a part of the bootstrap")));
  if (s.lost() > 0)
    line("lost", fmt::format("{} {}, {}", s.lost(), s.has_chains() ? "chain segments" : "iterations",
                             s.repairing() ? "being rendered again" : "see message"));
  line("samples", fmt::format("{}", s.samples()));
  if (s.light_paths() > 0) line("light paths", fmt::format("{}", s.light_paths()));
  line("rays", fmt::format("{}", s.rays()));
  line("relMSE", s.iterations() > 0 && s.relmse_upper() > 0
                     ? fmt::format("{}; at most {:.2e} (95 %)", error_text(s), s.relmse_upper())
                     : error_text(s));
  for (const std::string& light : lucky_light(s)) line("  light", light);
  std::vector<std::string> limits;
  if (s.stop().iterations() > 0) limits.push_back(effort_text(s, s.stop().iterations()));
  if (s.stop().time_seconds() > 0) limits.push_back(format_duration(s.stop().time_seconds()));
  if (s.stop().relmse() > 0) limits.push_back(fmt::format("relMSE at most {}", s.stop().relmse()));
  if (const std::string indices = wire::indices_text(s); !indices.empty())
    limits.push_back(indices.size() <= kMostIndexBytes ? "exactly the indices " + indices
                                                       : effort_text(s, wire::iterations_asked(s)) +
                                                             " at exact indices, which --json tells");
  line("stops at", fmt::format("{}", join(limits, " or ")));
  line("time", fmt::format("{} running, {} of workers", format_duration(s.elapsed_seconds()),
                           format_duration(s.worker_seconds())));
  const v1::JobSettings& settings = s.settings();
  line("image",
       fmt::format("{}x{}, filter {}, sampler {}, seed {}, isa {}", settings.width(), settings.height(),
                   settings.filter(), settings.sampler(), settings.seed(), settings.isa()));
  std::map<std::string, std::string> sorted(settings.integrator_settings().begin(),
                                            settings.integrator_settings().end());
  std::string integrator = settings.integrator();
  for (const auto& [key, value] : sorted) integrator += fmt::format(" {}={}", key, value);
  line("integrator", integrator);
  if (!settings.aovs().empty()) line("AOVs", settings.aovs());
  if (!settings.layers().empty()) line("expressions", settings.layers());
  if (s.layers_size() > 0) line("layers", join(s.layers(), " "));
  if (s.has_chains()) print_chains(line, s);
  if (s.has_epochs()) print_epochs(line, s.epochs());
  for (const std::string& warning : {repeats_warning(s), bounded_walks_warning(s)})
    if (!warning.empty()) line("warning", warning);
  line("priority", fmt::format("{}, share {}", s.priority(), s.share()));
  if (!s.scene_path().empty()) line("scene", s.scene_path());
  line("bundle", s.bundle_sha256());
  line("checkpoint",
       fmt::format("generation {} with {} iterations", s.checkpoint_generation(), s.checkpoint_iterations()));
  line("submitted", time_text(s.submitted_unix_ms()));
  line("finished", time_text(s.finished_unix_ms()));
  for (const auto& rejected : s.rejected())
    if (rejected.count() > 0) line("rejected", rejected_text(rejected));
}

Result<int> run_show(Context& context, const JobOptions& options) {
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  CANDELA_ASSIGN(const v1::JobStatus status, farm->get_job(options.id));
  if (options.json)
    context.out << wire::job_json(status) << '\n';
  else
    print_job(context.out, status);
  return 0;
}

Result<int> run_events(Context& context, const JobOptions& options) {
  std::uint64_t limit = 100;
  if (options.limit) {
    CANDELA_ASSIGN(limit, parse_count(*options.limit, "--limit", 1, 10000));
  }
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  CANDELA_ASSIGN(const v1::ListEventsResponse response,
                 farm->list_events(options.id, static_cast<std::uint32_t>(limit)));
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

// Pause, resume and cancel: one call, and the state it led to.
Result<int> run_steer(Context& context, const JobOptions& options,
                      Result<v1::JobStatus> (FarmClient::*call)(const std::string&)) {
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  CANDELA_ASSIGN(const v1::JobStatus status, (farm.get()->*call)(options.id));
  if (options.json)
    context.out << wire::job_json(status) << '\n';
  else
    context.err << fmt::format("job {} is {}{}\n", printable(status.id()), wire::name(status.state()),
                               status.message().empty() ? "" : ": " + printable(status.message()));
  return 0;
}

Result<int> run_priority(Context& context, const JobOptions& options) {
  CANDELA_ASSIGN(const std::int64_t priority, parse_integer(options.priority, "priority", -1000000, 1000000));
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  CANDELA_ASSIGN(const v1::JobStatus status,
                 farm->set_priority(options.id, static_cast<std::int32_t>(priority)));
  if (options.json)
    context.out << wire::job_json(status) << '\n';
  else
    context.err << fmt::format("job {} has priority {}\n", printable(status.id()), status.priority());
  return 0;
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
  request.set_job_id(options.id);
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
  if (spp > 0) {
    CANDELA_ASSIGN(const v1::JobStatus job, farm->get_job(options.id));
    const double each = wire::samples_per_iteration(job);
    if (!(each > 0))
      return usage_error("how many samples a round of this job brings is not known before its pilot")
          .with_field("--spp")
          .with_mend("try again when it renders, or give --iterations +N");
    request.set_add_iterations(static_cast<std::uint64_t>(std::ceil(static_cast<double>(spp) / each)));
  }
  CANDELA_ASSIGN(const v1::JobStatus status, farm->extend_job(request));
  if (options.json)
    context.out << wire::job_json(status) << '\n';
  else
    context.err << fmt::format("job {} is {}: {}\n", printable(status.id()), wire::name(status.state()),
                               format_progress(status));
  return 0;
}

CLI::App* add_job_command(CLI::App& app, const std::shared_ptr<JobOptions>& options, const char* name,
                          const char* doc, bool id_required) {
  CLI::App* sub = app.add_subcommand(name, doc);
  CLI::Option* id = sub->add_option("id", options->id, id_required ? "The job" : "Only events of this job")
                        ->type_name("ID");
  if (id_required) id->required();
  add_farm_options(*sub, options->farm);
  sub->add_flag("--json", options->json, "Print JSON");
  return sub;
}

void add_steer(CLI::App& app, Context& context, const char* name, const char* doc,
               Result<v1::JobStatus> (FarmClient::*call)(const std::string&)) {
  auto options = std::make_shared<JobOptions>();
  CLI::App* sub = add_job_command(app, options, name, doc, true);
  sub->callback([&context, options, call] {
    context.command = [&context, options, call] { return run_steer(context, *options, call); };
  });
}

}  // namespace

void add_list(CLI::App& app, Context& context) {
  auto options = std::make_shared<JobOptions>();
  CLI::App* sub = app.add_subcommand("list", "List the farm's jobs");
  add_text(*sub, "--state", options->state,
           "Jobs in one of these: queued, running, paused, done, failed, cancelled", "STATE[,STATE]");
  add_text(*sub, "--limit", options->limit, "At most the newest N jobs (default 100; all with --json)", "N");
  add_text(*sub, "--after", options->after,
           "Continue a list: only jobs older than PLACE, the value that the list before printed", "PLACE");
  add_farm_options(*sub, options->farm);
  sub->add_flag("--json", options->json, "Print JSON");
  sub->callback(
      [&context, options] { context.command = [&context, options] { return run_list(context, *options); }; });
}

void add_show(CLI::App& app, Context& context) {
  auto options = std::make_shared<JobOptions>();
  CLI::App* sub =
      add_job_command(app, options, "show",
                      "Show a job: state, progress, settings. relMSE is estimated from the job's two halves. "
                      "'at most' is the upper end of its 95 % interval; --until stops by it. No estimate "
                      "knows of light that no sample has found: if the plan expects such light, a line names "
                      "it and an integrator that finds it (docs/error.md)",
                      true);
  sub->callback(
      [&context, options] { context.command = [&context, options] { return run_show(context, *options); }; });
}

void add_events(CLI::App& app, Context& context) {
  auto options = std::make_shared<JobOptions>();
  CLI::App* sub = add_job_command(app, options, "events", "Print the events of the farm, or of a job", false);
  add_text(*sub, "--limit", options->limit, "At most the last N events (default 100)", "N");
  sub->callback([&context, options] {
    context.command = [&context, options] { return run_events(context, *options); };
  });
}

void add_pause(CLI::App& app, Context& context) {
  add_steer(app, context, "pause", "Pause a job", &FarmClient::pause_job);
}
void add_resume(CLI::App& app, Context& context) {
  add_steer(app, context, "resume",
            "Continue a paused or failed job; a job that waits after failures tries again at once",
            &FarmClient::resume_job);
}
void add_cancel(CLI::App& app, Context& context) {
  add_steer(app, context, "cancel", "End a job; its partial image is kept", &FarmClient::cancel_job);
}

void add_priority(CLI::App& app, Context& context) {
  auto options = std::make_shared<JobOptions>();
  CLI::App* sub = add_job_command(
      app, options, "priority",
      "Set a job's priority; jobs of higher priority run first, and cut units of lower priority short", true);
  sub->add_option("priority", options->priority,
                  "The new one, -1000000 to 1000000; jobs have 0 unless told otherwise")
      ->required()
      ->type_name("PRIORITY");
  sub->callback([&context, options] {
    context.command = [&context, options] { return run_priority(context, *options); };
  });
}

void add_extend(CLI::App& app, Context& context) {
  auto options = std::make_shared<JobOptions>();
  CLI::App* sub =
      add_job_command(app, options, "extend", "Add to a job's limits; a finished job goes on", true);
  add_text(*sub, "--spp", options->spp, "Add N samples (Markov chains: mutations) per pixel", "+N");
  add_text(*sub, "--iterations", options->iterations, "Add N iterations", "+N");
  add_text(*sub, "--time", options->time, "Add this time", "+DURATION");
  add_text(*sub, "--until", options->until, "New target for the upper end of the estimated error",
           "relmse=X");
  sub->callback([&context, options] {
    context.command = [&context, options] { return run_extend(context, *options); };
  });
}

}  // namespace candela::client
