// Options come from the command line, else the environment, else the configuration files' [worker] section.
#include "worker/program/run_worker.h"

#include <sys/stat.h>

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <optional>
#include <string>
#include <thread>

#include "common/base/daemon.h"
#include "common/base/log.h"
#include "common/base/parse_and_run.h"
#include "common/base/set_back_watch.h"
#include "common/base/version.h"
#include "common/image/codec.h"
#include "common/wire/grpc_settings.h"
#include "worker/service/worker_service.h"

namespace candela::worker {
namespace {

// Options as written; empty if not given.
struct Texts {
  std::string master, cache, cache_size, texture_memory, scene_memory, scratch, threads, name, tls_cert,
      tls_key, tls_ca, token_file, give_up, log_level, log_format;
  bool insecure = false;
};

constexpr const char* kProgram = "candela-worker";
constexpr std::chrono::seconds kSetBack{5};     // of the wall clock, that may be waited for
constexpr std::chrono::seconds kFarewells{30};  // of a drain whose calls may never end

// Reasons that end the worker while it works.
struct Ends {
  std::atomic<bool> wanted{false};    // a signal asked for it
  std::atomic<bool> set_back{false};  // the wall clock was set back: gRPC works again in a new process only
};

Result<void> read_threads(const Chosen& chosen, unsigned& out) {
  if (chosen.empty()) return {};
  unsigned number = 0;
  const char* const end = chosen.value.data() + chosen.value.size();
  const auto [rest, code] = std::from_chars(chosen.value.data(), end, number);
  if (code != std::errc() || rest != end || number > 4096)
    return bad_value(chosen, "a number of threads from 0 (all cores) to 4096");
  out = number;
  return {};
}

Result<WorkerOptions> resolve(const DaemonSettings& settings, const Texts& texts) {
  CANDELA_TRY(settings.check_names({"master", "cache", "cache-size", "texture-memory", "scene-memory",
                                    "scratch", "threads", "name", "tls-cert", "tls-key", "tls-ca",
                                    "token-file", "insecure", "give-up", "log-level", "log-format"}));
  const auto choose = [&](const std::string& option, const std::string& given) {
    return settings.choose(option, given, DaemonSettings::Scope::shared);
  };
  WorkerOptions options;
  options.master = choose("master", texts.master).value;
  if (options.master.empty())
    return usage_error("no master is given").with_mend("use --master HOST:PORT or set $CANDELA_MASTER");
  options.cache_dir = choose("cache", texts.cache).value;
  if (options.cache_dir.empty()) {
    CANDELA_ASSIGN(options.cache_dir, default_cache_folder());
  }
  CANDELA_TRY(read_bytes(choose("cache-size", texts.cache_size), options.cache_limit_bytes));
  CANDELA_TRY(read_bytes(choose("texture-memory", texts.texture_memory), options.texture_memory_bytes));
  CANDELA_TRY(read_bytes(choose("scene-memory", texts.scene_memory), options.reading_memory_bytes));
  options.scratch_dir = choose("scratch", texts.scratch).value;
  CANDELA_TRY(read_threads(choose("threads", texts.threads), options.threads));
  CANDELA_TRY(read_seconds(choose("give-up", texts.give_up), options.give_up_seconds));
  options.name = choose("name", texts.name).value;
  options.tls_cert = choose("tls-cert", texts.tls_cert).value;
  options.tls_key = choose("tls-key", texts.tls_key).value;
  options.tls_ca = choose("tls-ca", texts.tls_ca).value;
  options.token_file = choose("token-file", texts.token_file).value;
  options.insecure = texts.insecure;
  if (!options.insecure) CANDELA_TRY(read_flag(choose("insecure", ""), options.insecure));
  return options;
}

int run(const Texts& texts, const sigset_t& signals, char** argv) {
  const auto settings = DaemonSettings::load(kProgram, "worker");
  if (!settings) return report(kProgram, settings.error());
  if (auto log = settings->start_log(texts.log_level, texts.log_format); !log)
    return report(kProgram, log.error());
  const auto options = resolve(*settings, texts);
  if (!options) return report(kProgram, options.error());
  if (const auto images = image::check_image_module(); !images) return report(kProgram, images.error());

  auto worker = Worker::start(*options, nullptr);
  if (!worker) return report(kProgram, worker.error());
  Ends ends;
  std::thread([&ends, &worker, argv] {
    SetBackWatch watch(kSetBack);
    std::optional<SetBackWatch::Seconds> back;
    while (!(back = watch.look())) std::this_thread::sleep_for(std::chrono::seconds(1));
    log::warn(fmt::format("the wall clock was set back by {:.0f} s; the worker delivers and begins again",
                          back->count()));
    ends.set_back = true;
    (*worker)->drain();
    std::this_thread::sleep_for(kFarewells);
    if (!ends.wanted) begin_again(argv);
  }).detach();
  std::thread([&signals, &worker, &ends] {
    int number = 0;
    sigwait(&signals, &number);
    ends.wanted = true;
    log::info(number == SIGTERM ? "SIGTERM: draining; a second signal ends at once"
                                : "SIGINT: draining; a second signal ends at once");
    (*worker)->drain();
    sigwait(&signals, &number);
    std::_Exit(128 + number);
  }).detach();

  const Result<void> end = (*worker)->wait();
  int code = end ? 0 : report(kProgram, end.error());
  const bool is_stuck = (*worker)->must_begin_again();
  if (is_stuck || (ends.set_back && !ends.wanted)) {
    begin_again(argv);
    code = report(kProgram, failed_error(fmt::format(
                                "{}, and the program cannot be started anew",
                                is_stuck ? "the renderer does not stop" : "the wall clock was set back")));
  }
  // Without destructors: the master knows already.
  end_process(code);
}

}  // namespace

int run_worker(int argc, char** argv) {
  // First of all: a batch system may send SIGTERM as soon as the process exists.
  const sigset_t signals = block_signals({SIGINT, SIGTERM});
  ::umask(077);  // the cache has scenes, which are for this user alone
  wire::configure_grpc();
  Texts texts;
  CLI::App app("A render worker: leases units of work from a master, renders them and delivers the results.");
  app.set_version_flag("--version", fmt::format("candela-worker {} (build {})", version(), build_id()));
  app.add_option("--master", texts.master, "The master's HOST:PORT; default: $CANDELA_MASTER");
  app.add_option("--cache", texts.cache, "Folder for scene files; default: ~/.cache/candela")
      ->type_name("DIR");
  app.add_option("--cache-size", texts.cache_size, "Maximum bytes of the cache, such as 20G (the default)")
      ->type_name("SIZE");
  app.add_option(
         "--texture-memory", texts.texture_memory,
         "Memory for decoded textures of a scene; further ones lie in a file; default: a quarter of the "
         "memory")
      ->type_name("SIZE");
  app.add_option(
         "--scene-memory", texts.scene_memory,
         "Maximum memory for reading a scene; a scene that needs more fails its job; default: half of "
         "the memory")
      ->type_name("SIZE");
  app.add_option("--scratch", texts.scratch,
                 "Folder of the file of --texture-memory, on a disk; default: the cache")
      ->type_name("DIR");
  app.add_option("--threads", texts.threads, "Render threads; default: all cores that this process may use")
      ->type_name("N");
  app.add_option("--name", texts.name, "Name of the worker in lists; default: the name of the host")
      ->type_name("NAME");
  app.add_option("--tls-cert", texts.tls_cert, "Certificate of this worker (PEM)")->type_name("FILE");
  app.add_option("--tls-key", texts.tls_key, "Private key of that certificate (PEM)")->type_name("FILE");
  app.add_option("--tls-ca", texts.tls_ca,
                 "Certificate of the authority that signed the master's certificate (PEM)")
      ->type_name("FILE");
  app.add_option(
         "--token-file", texts.token_file,
         "File with the token of a master without TLS; default: the file that this user's master made")
      ->type_name("FILE");
  app.add_flag("--insecure", texts.insecure, "Allow a master beyond loopback without TLS");
  app.add_option("--give-up", texts.give_up,
                 "End if the master cannot be reached for this time, such as 10m; default: never")
      ->type_name("TIME");
  app.add_option("--log-level", texts.log_level, "trace, debug, info, warn, error or off; default: info")
      ->type_name("LEVEL");
  app.add_option("--log-format", texts.log_format, "text or json; default: text")->type_name("FORMAT");
  return parse_and_run(kProgram, app, argc, argv, [&] { return run(texts, signals, argv); });
}

}  // namespace candela::worker
