// candela slurm: a cluster of Slurm gives the workers.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <ostream>

#include "client/commands/commands.h"
#include "client/context.h"
#include "client/slurm/batch_script.h"
#include "client/values.h"
#include "common/base/config.h"
#include "common/base/files.h"
#include "common/wire/wire.h"

namespace candela::client {
namespace {

struct SlurmOptions {
  FarmOptions farm;
  SlurmJob job;
  std::string workers = "1", cpus = "1", notice = "60";
  std::optional<std::string> output;
  bool submit = false;
};

// Certificates are looked for where the job runs: there a relative path would mean another folder.
void make_absolute(std::string& path) {
  if (!path.empty()) path = std::filesystem::absolute(path).string();
}

Result<SlurmJob> read(const SlurmOptions& options) {
  SlurmJob job = options.job;
  CANDELA_ASSIGN(const auto workers, parse_count(options.workers, "--workers", 1, 1000000));
  CANDELA_ASSIGN(const auto cpus, parse_count(options.cpus, "--cpus", 1, 4096));
  CANDELA_ASSIGN(const auto notice, parse_count(options.notice, "--notice", 1, 65535));
  job.workers = static_cast<std::uint32_t>(workers);
  job.cpus = static_cast<std::uint32_t>(cpus);
  job.notice = static_cast<std::uint32_t>(notice);
  if (!job.give_up.empty()) CANDELA_TRY(parse_duration(job.give_up, "--give-up"));
  CANDELA_ASSIGN(const Config config, Config::load());
  CANDELA_ASSIGN(job.farm, resolve_connection(options.farm, config));
  for (std::string* path : {&job.farm.tls_cert, &job.farm.tls_key, &job.farm.tls_ca, &job.farm.token_file})
    make_absolute(*path);
  return job;
}

Result<int> run_slurm(Context& context, const SlurmOptions& options) {
  CANDELA_ASSIGN(const SlurmJob job, read(options));
  CANDELA_ASSIGN(const std::string script, batch_script(job));
  CANDELA_ASSIGN(const wire::Address master, wire::parse_address(job.farm.master, "--master"));
  if (master.loopback)
    context.err
        << "candela: warning: " << printable(master.text())
        << " is a loopback address: workers on other machines will look for the master there in vain\n";
  if (!job.logs.empty() && !std::filesystem::is_directory(job.logs))
    context.err << "candela: warning: the folder " << printable(job.logs)
                << " is not here; where it is absent on a node, Slurm starts no task\n";
  if (options.output) CANDELA_TRY(write_file_atomically(*options.output, script));
  if (options.submit) {
    CANDELA_TRY(submit_batch_script(script));
  } else if (!options.output) {
    context.out << script;
  }
  return 0;
}

void add_resources(CLI::App& sub, SlurmOptions& options) {
  SlurmJob& job = options.job;
  sub.add_option("--workers", options.workers, "Tasks of the array, one worker each; default: 1")
      ->type_name("N");
  sub.add_option("--cpus", options.cpus, "Processors of a worker, its threads; default: 1")->type_name("N");
  sub.add_option("--memory", job.memory, "Memory of a worker, such as 32G; default: the site's")
      ->type_name("SIZE");
  sub.add_option("--time", job.time, "Time limit, such as 8:00:00 or 2-0; default: the site's")
      ->type_name("TIME");
  sub.add_option("--notice", options.notice,
                 "Seconds before the limit at which a worker delivers and leaves; default: 60")
      ->type_name("SECONDS");
  sub.add_option("--partition", job.partition, "Partitions, with commas between")->type_name("NAME");
  sub.add_option("--account", job.account, "Account that pays for the time")->type_name("NAME");
  sub.add_option("--qos", job.qos, "Quality of service")->type_name("NAME");
  sub.add_option("--name", job.name, "The job's name; default: candela-worker")->type_name("NAME");
  sub.add_option("--logs", job.logs, "Folder of the tasks' output; default: where sbatch is called")
      ->type_name("DIR");
  add_texts(sub, "--sbatch", job.more,
            "A further option of sbatch, such as --sbatch=--constraint=avx2; repeatable", "OPTION");
}

}  // namespace

void add_slurm(CLI::App& app, Context& context) {
  auto options = std::make_shared<SlurmOptions>();
  CLI::App* sub =
      app.add_subcommand("slurm", "Write or submit a Slurm job whose tasks are workers of the farm");
  add_resources(*sub, *options);
  sub->add_option("--program", options->job.program,
                  "candela-worker on the nodes; default: the one in their PATH")
      ->type_name("FILE");
  sub->add_option("--cache", options->job.cache,
                  "Workers' folder for scene files; default: in $TMPDIR or /tmp")
      ->type_name("DIR");
  sub->add_option("--give-up", options->job.give_up,
                  "Workers end after this long without a master, such as 30m; default: never")
      ->type_name("TIME");
  add_text(*sub, "-o,--output", options->output, "Write the script here; default: print it", "FILE");
  sub->add_flag("--submit", options->submit, "Submit the script with sbatch");
  add_farm_options(*sub, options->farm);
  set_command(*sub, context, run_slurm, options);
}

}  // namespace candela::client
