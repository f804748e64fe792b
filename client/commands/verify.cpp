// candela verify and repair: whether the farm's files bear out what it tells of its jobs, and what to do if
// not.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <ostream>

#include "client/commands/commands.h"
#include "client/commands/waiting.h"
#include "client/context.h"
#include "client/jobs_of_words.h"
#include "client/values.h"
#include "common/wire/json.h"
#include "common/wire/wire.h"

namespace candela::client {
namespace {

struct VerifyOptions {
  FarmOptions farm;
  std::string id;
  bool json = false, wait = false, quiet = false;
};

void print_report(std::ostream& out, const v1::JobReport& report) {
  const bool of_job = !report.job_id().empty();
  if (of_job || report.findings_size() > 0)
    out << fmt::format("{:<14} {:<10} {:<8} {}\n", of_job ? printable(report.job_id()) : "-",
                       of_job ? wire::name(report.state()) : "",
                       report.findings_size() == 0 ? "whole" : "DAMAGED",
                       of_job ? printable(report.name()) : "no job of the store");
  for (const v1::Finding& f : report.findings())
    out << fmt::format("  {}: {}{}\n", printable(f.part()), printable(f.text()),
                       f.mend().empty() ? "" : "; " + printable(f.mend()));
  out.flush();
}

Result<int> run_verify(Context& context, const VerifyOptions& options) {
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  std::string id;
  if (!options.id.empty()) {
    CANDELA_ASSIGN(const v1::JobName job, job_of_word(*farm, options.id));
    id = job.id();
  }
  std::size_t jobs = 0, damaged = 0;
  CANDELA_TRY(farm->verify_jobs(id, [&](const v1::JobReport& report) {
    jobs += report.job_id().empty() ? 0 : 1;
    damaged += report.findings_size() > 0 ? 1 : 0;
    if (options.json)
      context.out << wire::report_json(report) << std::endl;
    else
      print_report(context.out, report);
  }));
  if (damaged == 0) {
    if (!options.json) context.err << fmt::format("candela: {} job(s) verified, all whole\n", jobs);
    return 0;
  }
  return failed_error(fmt::format("{} job(s) verified, damage in {} report(s)", jobs, damaged))
      .with_mend("each report says what to do");
}

Result<int> run_repair(Context& context, const VerifyOptions& options) {
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  // The job may be one that the store does not know: then the word is its id.
  std::string id = options.id;
  if (const auto job = job_of_word(*farm, options.id); job.ok())
    id = job->id();
  else if (job.error().kind != ErrorKind::refused)
    return job.error();
  CANDELA_ASSIGN(const v1::JobStatus status, farm->repair_job(id));
  if (options.json && !options.wait)
    context.out << wire::job_json(status) << '\n';
  else if (status.repairing())
    context.err << fmt::format("job {} renders again what it has lost: {} {}\n", printable(status.id()),
                               status.lost(), status.chains().has_plan() ? "chain segments" : "iterations");
  else
    context.err << fmt::format("job {} is {}, nothing is lost\n", printable(status.id()),
                               wire::name(status.state()));
  if (!options.wait) return 0;
  return wait_for_job(context, *farm, id, {options.quiet, options.json});
}

}  // namespace

void add_verify(CLI::App& app, Context& context) {
  auto options = std::make_shared<VerifyOptions>();
  CLI::App* sub = app.add_subcommand("verify",
                                     "Check the files of a job, or of all jobs, on the master for lost or "
                                     "damaged data; exits with 1 if there is any");
  sub->add_option("id", options->id, "Only this job: its id, the beginning, or its name")->type_name("ID");
  add_farm_options(*sub, options->farm);
  sub->add_flag("--json", options->json, "Print a line of JSON for each job");
  set_command(*sub, context, run_verify, options);
}

void add_repair(CLI::App& app, Context& context) {
  auto options = std::make_shared<VerifyOptions>();
  CLI::App* sub = app.add_subcommand("repair",
                                     "Render again the samples that an ended job has lost, or add a job "
                                     "again that the master's store has lost");
  sub->add_option("id", options->id, "The job: its id, the beginning, or its name")
      ->required()
      ->type_name("ID");
  add_farm_options(*sub, options->farm);
  sub->add_flag("--wait", options->wait, "Wait until the job has ended again; exits with its result");
  sub->add_flag("--quiet", options->quiet, "With --wait: print no progress");
  sub->add_flag("--json", options->json, "Print JSON");
  set_command(*sub, context, run_repair, options);
}

}  // namespace candela::client
