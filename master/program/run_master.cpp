// Options come from the command line, else the environment, else the
// configuration files' [master] section.
#include "master/program/run_master.h"

#include <pthread.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <string>
#include <thread>

#include "common/base/config.h"
#include "common/base/log.h"
#include "common/base/parse_and_run.h"
#include "common/base/quantity.h"
#include "common/base/text.h"
#include "common/base/version.h"
#include "common/wire/grpc_settings.h"
#include "common/wire/wire.h"
#include "master/master.h"

namespace candela::master {
namespace {

// As written; empty where an option was not given.
struct Texts {
  std::string listen, data, http, tls_cert, tls_key, tls_ca, checkpoint_interval, lease_time, unit_time,
      merge_queue, log_level, log_format;
  bool insecure = false;
};

struct Chosen {
  std::string value, origin;
};

// The option, else the master's own setting, else (for what all programs share) the common one.
// $CANDELA_LISTEN is read, $CANDELA_MASTER is not: it names a master to call, not one to be.
Chosen choose(const Config& config, const std::string& option, const std::string& given,
              bool shared = false) {
  if (!given.empty()) return {given, "--" + option};
  for (const std::string& key : {"master." + option, option}) {
    if (key == option && !shared) break;
    if (auto value = config.get(key)) return {*value, config.origin(key)};
  }
  return {{}, "--" + option};
}

Error bad_value(const Chosen& chosen, const std::string& what) {
  return usage_error("'" + chosen.value.substr(0, 100) + "' is not " + what).with_field(chosen.origin);
}

// Seconds above 0.
Result<void> read_seconds(const Chosen& chosen, double& out) {
  if (chosen.value.empty()) return {};
  const auto seconds = parse_seconds(chosen.value);
  if (!seconds || *seconds == 0) return bad_value(chosen, "a time above 0 such as 2.5, 30s, 10m or 1h");
  out = *seconds;
  return {};
}

Result<void> read_size(const Chosen& chosen, std::uint64_t& out) {
  if (chosen.value.empty()) return {};
  const auto bytes = parse_bytes(chosen.value);
  if (!bytes) return bad_value(chosen, "a size in bytes such as 512M or 2G");
  out = *bytes;
  return {};
}

Result<MasterOptions> resolve(const Config& config, const Texts& texts) {
  CANDELA_TRY(config.check_shared());
  CANDELA_TRY(config.check_section(
      "master", {"listen", "data", "http", "tls-cert", "tls-key", "tls-ca", "insecure", "checkpoint-interval",
                 "lease-time", "unit-time", "merge-queue", "log-level", "log-format"}));
  MasterOptions options;
  if (const Chosen listen = choose(config, "listen", texts.listen, true); !listen.value.empty())
    options.listen = listen.value;
  options.data_dir = choose(config, "data", texts.data, true).value;
  if (options.data_dir.empty())
    return usage_error("no data folder is given").with_mend("use --data DIR or set $CANDELA_MASTER_DATA");
  options.http_listen = choose(config, "http", texts.http).value;
  options.tls_cert = choose(config, "tls-cert", texts.tls_cert, true).value;
  options.tls_key = choose(config, "tls-key", texts.tls_key, true).value;
  options.tls_ca = choose(config, "tls-ca", texts.tls_ca, true).value;
  options.insecure = texts.insecure;
  if (const Chosen insecure = choose(config, "insecure", "", true);
      !options.insecure && !insecure.value.empty()) {
    const std::string& v = insecure.value;
    if (v != "true" && v != "false" && v != "1" && v != "0") return bad_value(insecure, "true or false");
    options.insecure = v == "true" || v == "1";
  }
  CANDELA_TRY(read_seconds(choose(config, "checkpoint-interval", texts.checkpoint_interval),
                           options.checkpoint_seconds));
  CANDELA_TRY(read_seconds(choose(config, "lease-time", texts.lease_time), options.lease_seconds));
  CANDELA_TRY(read_seconds(choose(config, "unit-time", texts.unit_time), options.unit_seconds));
  CANDELA_TRY(read_size(choose(config, "merge-queue", texts.merge_queue), options.merge_queue_bytes));
  return options;
}

int report(const Error& error) {
  std::fprintf(stderr, "candela-master: %s\n", escape_unprintable(error.to_string()).c_str());
  return error.exit_code();
}

int run(const Texts& texts) {
  const auto config = Config::load();
  if (!config) return report(config.error());
  const std::string level = choose(*config, "log-level", texts.log_level, true).value;
  const std::string format = choose(*config, "log-format", texts.log_format, true).value;
  if (auto logging =
          log::initialise("candela-master", level.empty() ? "info" : level, format.empty() ? "text" : format);
      !logging)
    return report(logging.error());
  const auto options = resolve(*config, texts);
  if (!options) return report(options.error());

  // Signals are blocked in every thread and taken by this one when it waits for them: nothing runs in a
  // handler.
  sigset_t signals;
  sigemptyset(&signals);
  for (const int s : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals, s);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a file size limit is an error of the write, as a full disk is

  auto started = Master::start(*options);
  if (!started) return report(started.error());
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
    int number = 0;
    if (sigwait(&signals, &number) != 0) continue;
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
    started->reset();  // closes the store, which then needs no log of its own
    spdlog::default_logger()->flush();
    std::fflush(nullptr);
    std::_Exit(128 + number);  // the thread above waits for ever; everything is on disk
  }
}

}  // namespace

int run_master(int argc, char** argv) {
  if (const char* missing = missing_cpu_feature()) {
    std::fprintf(stderr, "candela-master: this CPU lacks %s, which this build needs\n", missing);
    return 1;
  }
  wire::configure_grpc();
  Texts texts;
  CLI::App app{"The master of a Candela farm: keeps jobs, leases work to workers, merges what they render."};
  app.set_version_flag("--version", "candela-master " + std::string(build_id()));
  app.add_option("--listen", texts.listen, "address to serve on; port 0 picks one (default 127.0.0.1:7070)")
      ->type_name("HOST:PORT");
  app.add_option("--data", texts.data, "folder of jobs, films and scene files")->type_name("DIR");
  app.add_option("--http", texts.http, "address of /healthz and /metrics (default: none)")
      ->type_name("HOST:PORT");
  app.add_option("--tls-cert", texts.tls_cert, "this master's certificate (PEM)")->type_name("FILE");
  app.add_option("--tls-key", texts.tls_key, "its private key (PEM)")->type_name("FILE");
  app.add_option("--tls-ca", texts.tls_ca,
                 "the authority that signed workers' and clients' certificates (PEM)")
      ->type_name("FILE");
  app.add_flag("--insecure", texts.insecure, "serve beyond this machine without TLS");
  app.add_option("--checkpoint-interval", texts.checkpoint_interval,
                 "at most this long from a merge to its checkpoint (default 10s)")
      ->type_name("TIME");
  app.add_option("--lease-time", texts.lease_time,
                 "a worker silent for this long loses its units (default 30s)")
      ->type_name("TIME");
  app.add_option("--unit-time", texts.unit_time, "what units are sized to (default 4s)")->type_name("TIME");
  app.add_option("--merge-queue", texts.merge_queue, "bytes of deltas that may be under way (default 512M)")
      ->type_name("SIZE");
  app.add_option("--log-level", texts.log_level, "trace, debug, info, warn, error, off (default info)")
      ->type_name("LEVEL");
  app.add_option("--log-format", texts.log_format, "text or json (default text)")->type_name("FORMAT");
  return parse_and_run("candela-master", app, argc, argv, [&] { return run(texts); });
}

}  // namespace candela::master
