// candela workers and drain: the machines of a farm.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <ostream>

#include "client/commands/commands.h"
#include "client/context.h"
#include "client/signals.h"
#include "client/table.h"
#include "client/values.h"
#include "client/worker_choice.h"
#include "common/wire/json.h"

namespace candela::client {
namespace {

struct FleetOptions {
  FarmOptions farm;
  std::string action, id;
  bool wait = false, json = false, wanted = false;
};

std::string age_text(std::int64_t unix_ms) {
  const auto now = std::chrono::duration_cast<std::chrono::milliseconds>(
      std::chrono::system_clock::now().time_since_epoch());
  return format_duration(std::max<double>(0, static_cast<double>(now.count() - unix_ms) / 1000)) + " ago";
}

// "cornell (j3k2x) of ann@desk", of each job that it has units of.
std::string work_text(const v1::WorkerStatus& worker) {
  std::vector<std::string> jobs;
  for (const v1::JobName& job : worker.work())
    jobs.push_back(fmt::format("{} ({}){}", printable(job.name()), printable(job.short_id()),
                               job.submitter().empty() ? "" : " of " + printable(job.submitter())));
  return jobs.empty() ? "-" : fmt::format("{}", join(jobs, ", "));
}

// One worker's new state, as the command was asked to print it.
void print_state(Context& context, const FleetOptions& options, const v1::WorkerStatus& status) {
  if (options.json)
    context.out << wire::worker_json(status) << '\n';
  else
    context.err << fmt::format("worker {} is {}\n", printable(status.id()), printable(status.state()));
}

Result<int> run_action(Context& context, const FleetOptions& options) {
  const bool trusts = options.action == "trust" || options.action == "distrust";
  if (options.action != "pause" && options.action != "resume" && !trusts)
    return usage_error(fmt::format("'{}' is nothing that workers can be told", options.action))
        .with_field("ACTION")
        .with_mend("there is pause, resume, distrust, trust; to let a worker leave: candela drain WORKER");
  if (options.id.empty())
    return usage_error("no worker is given")
        .with_field("WORKER")
        .with_mend(fmt::format("candela workers {} WORKER", options.action));
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  CANDELA_ASSIGN(const v1::ListWorkersResponse present, farm->list_workers());
  const bool absent = options.action == "trust";  // it need not be there, and the master knows its name
  CANDELA_ASSIGN(const std::string id,
                 absent ? Result<std::string>(options.id) : choose_worker(present, options.id));
  if (trusts) {
    CANDELA_ASSIGN(const v1::TrustResponse answer,
                   absent ? farm->trust_worker(id) : farm->distrust_worker(id));
    if (options.json)
      context.out << wire::trust_json(answer) << '\n';
    else
      context.err << fmt::format("worker {} is {}\n", printable(answer.worker().worker()),
                                 absent ? "trusted again" : "distrusted");
    return 0;
  }
  CANDELA_ASSIGN(const v1::WorkerStatus status,
                 options.action == "pause" ? farm->pause_worker(id) : farm->resume_worker(id));
  print_state(context, options, status);
  return 0;
}

Result<int> run_workers(Context& context, const FleetOptions& options) {
  if (!options.action.empty()) return run_action(context, options);
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  CANDELA_ASSIGN(const v1::ListWorkersResponse response, farm->list_workers());
  if (options.json) {
    context.out << wire::workers_json(response) << '\n';
    return 0;
  }
  if (options.wanted) {
    context.out << fmt::format("{} threads, {} workers\n", response.wanted().threads(),
                               response.wanted().workers());
    return 0;
  }
  const auto print_distrusted = [&] {
    for (const auto& d : response.distrusted())
      context.out << fmt::format("distrusted: {}, {}: {} (candela workers trust {})\n", printable(d.worker()),
                                 age_text(d.since_unix_ms()), printable(d.reason()), printable(d.worker()));
    return 0;
  };
  if (response.workers_size() == 0) {
    context.err << "no workers\n";
    return print_distrusted();
  }
  Table table({"ID", "STATE", ">THREADS", ">MERGED", ">FAILED", "SEEN", "HOST", "NAME", "JOB"});
  for (const auto& w : response.workers())
    table.add({printable(w.id()), printable(w.state()), fmt::format("{}", w.threads()),
               fmt::format("{}", w.units_merged()), fmt::format("{}", w.units_failed()),
               age_text(w.last_seen_unix_ms()), printable(w.host()), printable(w.name()),
               work_text(w) + (w.message().empty() ? "" : "  (" + printable(w.message()) + ")")});
  context.out << table.text();
  return print_distrusted();
}

bool is_drained(const v1::WorkerStatus& w) {
  return w.state() == "drained" || w.state() == "lost";
}

Result<int> run_drain(Context& context, const FleetOptions& options) {
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  CANDELA_ASSIGN(const v1::ListWorkersResponse present, farm->list_workers());
  CANDELA_ASSIGN(const std::string id, choose_worker(present, options.id));
  CANDELA_ASSIGN(v1::WorkerStatus status, farm->drain_worker(id));
  if (options.wait) {
    const StopSignals signals;
    while (!is_drained(status)) {
      if (signals.wait_for(std::chrono::milliseconds(500))) {
        context.err << "candela: the worker goes on draining\n";
        return 128 + signals.pending();
      }
      CANDELA_ASSIGN(const v1::ListWorkersResponse response, farm->list_workers());
      bool found = false;
      for (const auto& worker : response.workers()) {
        if (worker.id() != status.id()) continue;
        status = worker;
        found = true;
        break;
      }
      if (!found) status.set_state("drained");  // it has left, and the master has forgotten it
    }
  }
  print_state(context, options, status);
  return 0;
}

}  // namespace

void add_workers(CLI::App& app, Context& context) {
  auto options = std::make_shared<FleetOptions>();
  CLI::App* sub = app.add_subcommand("workers",
                                     "List the farm's workers, or change one: pause (it gets no work), "
                                     "resume, distrust (its samples are false), trust");
  sub->add_option("action", options->action, "`pause`, `resume`, `distrust` or `trust`; default: list them")
      ->type_name("ACTION");
  sub->add_option("worker", options->id,
                  "The worker's id or unique name; to distrust or trust one that has left, NAME or HOST/NAME")
      ->type_name("WORKER");
  add_farm_options(*sub, options->farm);
  sub->add_flag("--wanted", options->wanted,
                "Print the number of threads and workers that the open jobs could use now");
  sub->add_flag("--json", options->json, "Print JSON");
  set_command(*sub, context, run_workers, options);
}

void add_drain(CLI::App& app, Context& context) {
  auto options = std::make_shared<FleetOptions>();
  CLI::App* sub = app.add_subcommand("drain", "Let a worker finish and leave");
  sub->add_option("worker", options->id, "The worker's id or unique name")->required()->type_name("WORKER");
  sub->add_flag("--wait", options->wait, "Return when its last unit is delivered");
  add_farm_options(*sub, options->farm);
  sub->add_flag("--json", options->json, "Print JSON");
  set_command(*sub, context, run_drain, options);
}

}  // namespace candela::client
