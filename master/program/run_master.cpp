// Options come from the command line, else the environment, else the configuration files' [master] section.
#include "master/program/run_master.h"

#include <fmt/format.h>
#include <malloc.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

#include "common/base/daemon.h"
#include "common/base/log.h"
#include "common/base/memory_limit.h"
#include "common/base/parse_and_run.h"
#include "common/base/version.h"
#include "common/wire/address.h"
#include "common/wire/grpc_settings.h"
#include "master/master.h"
#include "master/store/backup.h"

namespace candela::master {
namespace {

// Options as written; empty if not given.
struct Texts {
  std::string listen, data, http, page_token_file, notify, notify_secret_file, tls_cert, tls_key, tls_ca,
      checkpoint_interval, lease_time, unit_time, stuck_after, merge_queue, memory, statistics_memory,
      keep_finished, audit, log_level, log_format;
  bool insecure = false;
};

// A third of the weight of the threads that answer calls: a merge on a busy machine takes longer, a lease
// does not.
constexpr int kBulkNiceness = 5;

constexpr double kAuditShare = 0.01;

constexpr const char* kProgram = "candela-master";

// Memory for leases, rows and messages when the system gives no more: some seconds of a large farm.
constexpr std::size_t kReserveBytes = 32 << 20;

// A connection is a file, and the limit that processes start with is often 1024: a thousand workers reach it.
void allow_many_files() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur == limit.rlim_max) return;
  limit.rlim_cur = limit.rlim_max;
  if (::setrlimit(RLIMIT_NOFILE, &limit) != 0) log::warn("the limit of open files could not be raised");
}

Result<MasterOptions> resolve(const DaemonSettings& settings, const Texts& texts) {
  CANDELA_TRY(settings.check_names({"listen",
                                    "data",
                                    "http",
                                    "page-token-file",
                                    "notify",
                                    "notify-secret-file",
                                    "tls-cert",
                                    "tls-key",
                                    "tls-ca",
                                    "insecure",
                                    "checkpoint-interval",
                                    "lease-time",
                                    "unit-time",
                                    "stuck-after",
                                    "merge-queue",
                                    "memory",
                                    "statistics-memory",
                                    "keep-finished",
                                    "audit",
                                    "log-level",
                                    "log-format"}));
  // $CANDELA_LISTEN is read, $CANDELA_MASTER is not: it names a master to call, not one to be.
  const auto choose_shared = [&](const std::string& option, const std::string& given) {
    return settings.choose(option, given, DaemonSettings::Scope::shared);
  };
  const auto choose = [&](const std::string& option, const std::string& given) {
    return settings.choose(option, given, DaemonSettings::Scope::section);
  };
  MasterOptions options;
  if (const Chosen listen = choose_shared("listen", texts.listen); !listen.empty())
    options.listen = listen.value;
  options.data_dir = choose_shared("data", texts.data).value;
  if (options.data_dir.empty())
    return usage_error("no data folder is given").with_mend("use --data DIR or set $CANDELA_MASTER_DATA");
  options.http_listen = choose("http", texts.http).value;
  options.page_token_file = choose("page-token-file", texts.page_token_file).value;
  options.notify = choose("notify", texts.notify).value;
  options.notify_secret_file = choose("notify-secret-file", texts.notify_secret_file).value;
  options.tls_cert = choose_shared("tls-cert", texts.tls_cert).value;
  options.tls_key = choose_shared("tls-key", texts.tls_key).value;
  options.tls_ca = choose_shared("tls-ca", texts.tls_ca).value;
  options.insecure = texts.insecure;
  if (!options.insecure) CANDELA_TRY(read_flag(choose_shared("insecure", ""), options.insecure));
  CANDELA_TRY(read_positive_seconds(choose("checkpoint-interval", texts.checkpoint_interval),
                                    options.checkpoint_seconds));
  CANDELA_TRY(read_positive_seconds(choose("lease-time", texts.lease_time), options.lease_seconds));
  CANDELA_TRY(read_positive_seconds(choose("unit-time", texts.unit_time), options.unit_seconds));
  CANDELA_TRY(read_positive_seconds(choose("stuck-after", texts.stuck_after), options.stuck_seconds));
  options.bulk_niceness = kBulkNiceness;
  CANDELA_TRY(read_bytes(choose("merge-queue", texts.merge_queue), options.merge_queue_bytes));
  CANDELA_TRY(read_bytes(choose("memory", texts.memory), options.memory_bytes));
  CANDELA_TRY(read_bytes(choose("statistics-memory", texts.statistics_memory), options.statistics_bytes));
  CANDELA_TRY(
      read_positive_seconds(choose("keep-finished", texts.keep_finished), options.keep_finished_seconds));
  options.audit_share = kAuditShare;
  CANDELA_TRY(read_share(choose("audit", texts.audit), options.audit_share));
  return options;
}

// Deltas and checkpoints come and go by megabytes, on any of the server's threads. glibc would keep their
// memory, in the arena of each thread. A fixed threshold of mmap lets it trim an arena to 128 KiB after each
// delta, which then costs more than the merge: an arena keeps what a delta needs (docs/lab/scale.md).
void bound_freed_memory() {
  ::mallopt(M_MMAP_THRESHOLD, 256 << 10);
  ::mallopt(M_TRIM_THRESHOLD, 64 << 20);
  // Few arenas bound the memory. Fewer still let threads wait for one that the system stopped inside malloc,
  // even the one that holds the scheduler's lock.
  ::mallopt(M_ARENA_MAX, 8);
}

int run(const Texts& texts, const SchedulerObserver& observer) {
  const auto settings = DaemonSettings::load(kProgram, "master");
  if (!settings) return report(kProgram, settings.error());
  if (auto log = settings->start_log(texts.log_level, texts.log_format); !log)
    return report(kProgram, log.error());
  auto options = resolve(*settings, texts);
  if (!options) return report(kProgram, options.error());
  options->observer = observer;
  options->publish_token = true;

  allow_many_files();
  MemoryReserve reserve(kReserveBytes);
  const sigset_t signals = block_signals({SIGINT, SIGTERM, SIGHUP});
  auto started = Master::start(*options);
  if (!started) return report(kProgram, started.error());
  Master& m = **started;
  // The names people gave, with the ports the system chose.
  const auto place = [](const std::string& listen, int port) {
    auto address = wire::parse_address(listen, "--listen");
    if (!address) return listen;
    address->port = port;
    return address->text();
  };
  std::printf("listening on %s\n", place(options->listen, m.port()).c_str());
  if (m.http_port() != 0) std::printf("http on %s\n", place(options->http_listen, m.http_port()).c_str());
  std::fflush(stdout);

  for (;;) {
    constexpr timespec kPause{1, 0};
    const int number = sigtimedwait(&signals, nullptr, &kPause);
    if (number < 0) {
      if (reserve.refill())
        log::warn(
            "the system gave no more memory, and small work took the reserve: run fewer jobs at a time, or "
            "give a smaller --memory");
      continue;
    }
    if (number == SIGHUP) {
      log::info("SIGHUP: writing checkpoints and images");
      m.flush_images();
      continue;
    }
    log::info(number == SIGTERM ? "SIGTERM: stopping" : "SIGINT: stopping");
    // A second signal ends at once; the newest checkpoints serve.
    std::thread([&signals] {
      int second = 0;
      do sigwait(&signals, &second);
      while (second == SIGHUP);
      std::_Exit(128 + second);
    }).detach();
    m.stop();
    started->reset();           // closes the store, which then needs no log of its own
    end_process(128 + number);  // the thread above waits for ever; everything is on disk
  }
}

int run_backup(const Texts& texts, const std::string& target, const std::string& base) {
  const auto settings = DaemonSettings::load(kProgram, "master");
  if (!settings) return report(kProgram, settings.error());
  const auto options = resolve(*settings, texts);
  if (!options) return report(kProgram, options.error());
  block_signals({});  // a limit of file sizes is an error, as a full disk is
  const auto backup = back_up({options->data_dir, target, base});
  if (!backup) return report(kProgram, backup.error());
  std::printf("%s: %llu jobs, %llu files of %.1f MB, %llu of them with %.1f MB as links\n", target.c_str(),
              static_cast<unsigned long long>(backup->jobs), static_cast<unsigned long long>(backup->files),
              static_cast<double>(backup->bytes) * 1e-6,
              static_cast<unsigned long long>(backup->linked_files),
              static_cast<double>(backup->linked_bytes) * 1e-6);
  return 0;
}

}  // namespace

int run_master(int argc, char** argv, const SchedulerObserver& observer) {
  bound_freed_memory();
  ::umask(077);  // what the master and its backups write is for its user alone
  wire::configure_grpc();
  Texts texts;
  CLI::App app{"The master of a Candela farm: keeps jobs, leases work to workers, merges what they render."};
  app.set_version_flag("--version", fmt::format("candela-master {} (build {})", version(), build_id()));
  app.add_option("--listen", texts.listen, "address to serve on; port 0 picks one (default 127.0.0.1:7070)")
      ->type_name("HOST:PORT");
  app.add_option("--data", texts.data, "folder of jobs, films and scene files")->type_name("DIR");
  app.add_option("--http", texts.http, "address of the page, /healthz and /metrics (default: none)")
      ->type_name("HOST:PORT");
  app.add_option("--page-token-file", texts.page_token_file,
                 "file with the token that lets the page change jobs (default: the page is read-only)")
      ->type_name("FILE");
  app.add_option("--notify", texts.notify,
                 "POST a notice here when a job or group has ended, a worker is lost, work waits without a "
                 "worker, or the disk is nearly full (default: none)")
      ->type_name("URL");
  app.add_option("--notify-secret-file", texts.notify_secret_file,
                 "file with the secret that signs notices (default: notify-secret in the data folder, made "
                 "at the first start)")
      ->type_name("FILE");
  app.add_option("--tls-cert", texts.tls_cert, "certificate of this master (PEM)")->type_name("FILE");
  app.add_option("--tls-key", texts.tls_key, "private key of that certificate (PEM)")->type_name("FILE");
  app.add_option("--tls-ca", texts.tls_ca,
                 "certificate of the authority that signed the certificates of workers and clients (PEM)")
      ->type_name("FILE");
  app.add_flag("--insecure", texts.insecure, "serve beyond this machine without TLS");
  app.add_option("--checkpoint-interval", texts.checkpoint_interval,
                 "maximum time between a merge and its checkpoint (default 10s)")
      ->type_name("TIME");
  app.add_option("--lease-time", texts.lease_time,
                 "a worker that is silent for this long loses its units (default 30s)")
      ->type_name("TIME");
  app.add_option("--unit-time", texts.unit_time, "intended time of a unit (default 4s)")->type_name("TIME");
  app.add_option("--stuck-after", texts.stuck_after,
                 "a worker without progress for this long loses its unit; after a second such worker the job "
                 "fails (default 10m)")
      ->type_name("TIME");
  app.add_option("--merge-queue", texts.merge_queue, "maximum bytes of deltas in flight (default 512M)")
      ->type_name("SIZE");
  app.add_option(
         "--memory", texts.memory,
         "maximum bytes of films, statistics, chains, checkpoints and images of all jobs; further jobs wait "
         "(default: three quarters of what this machine, its control group and the limit of the "
         "address space allow)")
      ->type_name("SIZE");
  app.add_option("--statistics-memory", texts.statistics_memory,
                 "part of --memory for the statistics of all jobs (default: a third)")
      ->type_name("SIZE");
  app.add_option("--keep-finished", texts.keep_finished,
                 "remove jobs that ended longer ago than this, such as 30d (default: keep them)")
      ->type_name("TIME");
  app.add_option(
         "--audit", texts.audit,
         "share of units that a second worker also renders, to compare both results; the first units of "
         "each worker come on top; 0: none (default 1%)")
      ->type_name("SHARE");
  app.add_option("--log-level", texts.log_level, "trace, debug, info, warn, error, off (default info)")
      ->type_name("LEVEL");
  app.add_option("--log-format", texts.log_format, "text or json (default text)")->type_name("FORMAT");
  std::string target, base;
  CLI::App* backup =
      app.add_subcommand("backup",
                         "Copy the data folder, also while a master works in it; to restore, start "
                         "a master with a copy of the backup as its --data");
  backup->fallthrough();  // `--data` may come after it
  backup->add_option("target", target, "the backup's folder, which must not exist")
      ->required()
      ->type_name("DIR");
  backup->add_option("--base", base, "an earlier backup: files that are the same are linked, not copied")
      ->type_name("DIR");
  return parse_and_run(kProgram, app, argc, argv, [&] {
    return backup->parsed() ? run_backup(texts, target, base) : run(texts, observer);
  });
}

}  // namespace candela::master
