// Options come from the command line, else the environment, else the
// configuration files' [worker] section.
#include "worker/program/run_worker.h"

#include <pthread.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <new>
#include <optional>
#include <string>
#include <thread>

#include "common/base/config.h"
#include "common/base/log.h"
#include "common/base/parse_and_run.h"
#include "common/base/quantity.h"
#include "common/base/text.h"
#include "common/base/version.h"
#include "common/wire/grpc_settings.h"
#include "worker/service/worker_service.h"

namespace candela::worker {
namespace {

// As written; empty where an option was not given.
struct Texts {
  std::string master, cache, cache_size, texture_memory, scratch, threads, name, tls_cert, tls_key, tls_ca,
      give_up, log_level, log_format;
  bool insecure = false;
};

// A value with the place it came from, for error messages.
struct Chosen {
  std::string value, origin;
};

// The option, else the worker's own setting, else the one all programs share (such as $CANDELA_MASTER).
Chosen choose(const Config& config, const std::string& option, const std::string& given) {
  if (!given.empty()) return {given, "--" + option};
  for (const std::string& key : {"worker." + option, option})
    if (auto value = config.get(key)) return {*value, config.origin(key)};
  return {{}, "--" + option};
}

Error bad_value(const Chosen& chosen, const std::string& what) {
  return usage_error("'" + chosen.value.substr(0, 100) + "' is not " + what).with_field(chosen.origin);
}

Result<std::uint64_t> read_size(const Chosen& chosen) {
  if (const auto bytes = parse_bytes(chosen.value)) return *bytes;
  return bad_value(chosen, "a size in bytes such as 500M, 20G or 1T");
}

Result<double> read_seconds(const Chosen& chosen) {
  if (const auto seconds = parse_seconds(chosen.value)) return *seconds;
  return bad_value(chosen, "a time such as 90s, 10m or 2h");
}

Result<unsigned> parse_threads(const Chosen& chosen) {
  unsigned number = 0;
  const char* const end = chosen.value.data() + chosen.value.size();
  const auto [rest, code] = std::from_chars(chosen.value.data(), end, number);
  if (code != std::errc() || rest != end || number > 4096)
    return bad_value(chosen, "a number of threads from 0 (all cores) to 4096");
  return number;
}

Result<std::filesystem::path> default_cache() {
  const auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return std::string(value != nullptr ? value : "");
  };
  // The XDG specification says to ignore a relative path.
  if (const std::string xdg = variable("XDG_CACHE_HOME"); xdg.starts_with('/'))
    return std::filesystem::path(xdg) / "candela";
  if (const std::string home = variable("HOME"); !home.empty())
    return std::filesystem::path(home) / ".cache" / "candela";
  return usage_error("no folder is given, and there is neither $XDG_CACHE_HOME nor $HOME")
      .with_field("--cache");
}

Result<WorkerOptions> resolve(const Config& config, const Texts& texts) {
  CANDELA_TRY(config.check_shared());
  CANDELA_TRY(config.check_section(
      "worker", {"master", "cache", "cache-size", "texture-memory", "scratch", "threads", "name", "tls-cert",
                 "tls-key", "tls-ca", "insecure", "give-up", "log-level", "log-format"}));
  WorkerOptions options;
  options.master = choose(config, "master", texts.master).value;
  if (options.master.empty())
    return usage_error("no master is given").with_mend("use --master HOST:PORT or set $CANDELA_MASTER");
  options.cache_dir = choose(config, "cache", texts.cache).value;
  if (options.cache_dir.empty()) {
    CANDELA_ASSIGN(options.cache_dir, default_cache());
  }
  if (const Chosen size = choose(config, "cache-size", texts.cache_size); !size.value.empty()) {
    CANDELA_ASSIGN(options.cache_limit_bytes, read_size(size));
  }
  if (const Chosen size = choose(config, "texture-memory", texts.texture_memory); !size.value.empty()) {
    CANDELA_ASSIGN(options.texture_memory_bytes, read_size(size));
  }
  options.scratch_dir = choose(config, "scratch", texts.scratch).value;
  if (const Chosen threads = choose(config, "threads", texts.threads); !threads.value.empty()) {
    CANDELA_ASSIGN(options.threads, parse_threads(threads));
  }
  if (const Chosen give_up = choose(config, "give-up", texts.give_up); !give_up.value.empty()) {
    CANDELA_ASSIGN(options.give_up_seconds, read_seconds(give_up));
  }
  options.name = choose(config, "name", texts.name).value;
  options.tls_cert = choose(config, "tls-cert", texts.tls_cert).value;
  options.tls_key = choose(config, "tls-key", texts.tls_key).value;
  options.tls_ca = choose(config, "tls-ca", texts.tls_ca).value;
  options.insecure = texts.insecure;
  if (const Chosen insecure = choose(config, "insecure", ""); !options.insecure && !insecure.value.empty()) {
    if (insecure.value != "true" && insecure.value != "false" && insecure.value != "1" &&
        insecure.value != "0")
      return bad_value(insecure, "true or false");
    options.insecure = insecure.value == "true" || insecure.value == "1";
  }
  return options;
}

int report(const Error& error) {
  std::fprintf(stderr, "candela-worker: %s\n", escape_unprintable(error.to_string()).c_str());
  return error.exit_code();
}

int run(const Texts& texts) {
  const auto config = Config::load();
  if (!config) return report(config.error());
  const std::string level = choose(*config, "log-level", texts.log_level).value;
  const std::string format = choose(*config, "log-format", texts.log_format).value;
  if (auto logging =
          log::initialise("candela-worker", level.empty() ? "info" : level, format.empty() ? "text" : format);
      !logging)
    return report(logging.error());
  const auto options = resolve(*config, texts);
  if (!options) return report(options.error());

  // Signals are blocked in every thread and taken by one that waits for them, so that nothing runs in a
  // handler.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);  // a closed log pipe must not end the worker
  std::signal(SIGXFSZ, SIG_IGN);  // a file size limit is an error of the write, as a full disk is

  auto worker = Worker::start(*options, nullptr);
  if (!worker) return report(worker.error());
  std::thread([&signals, &worker] {
    int number = 0;
    sigwait(&signals, &number);
    log::info(number == SIGTERM ? "SIGTERM: draining; a second signal ends at once"
                                : "SIGINT: draining; a second signal ends at once");
    (*worker)->drain();
    sigwait(&signals, &number);
    std::_Exit(128 + number);
  }).detach();

  const Result<void> end = (*worker)->wait();
  const int code = end ? 0 : report(end.error());
  // Without destructors: the protocol's end is said already, and a scene that is being compiled cannot be
  // stopped.
  spdlog::default_logger()->flush();
  std::fflush(nullptr);
  std::_Exit(code);
}

}  // namespace

int run_worker(int argc, char** argv) {
  if (const char* missing = missing_cpu_feature()) {
    std::fprintf(stderr, "candela-worker: this CPU lacks %s, which this build needs\n", missing);
    return 1;
  }
  wire::configure_grpc();
  Texts texts;
  CLI::App app("A render worker: leases units of work from a master, renders them and delivers the results.");
  app.set_version_flag("--version", std::string(version()) + " (build " + std::string(build_id()) + ")");
  app.add_option("--master", texts.master, "The master's HOST:PORT; default: $CANDELA_MASTER");
  app.add_option("--cache", texts.cache, "Folder for scene files; default: ~/.cache/candela")
      ->type_name("DIR");
  app.add_option("--cache-size", texts.cache_size,
                 "Limit of the cache in bytes, with K, M, G or T; default: 20G");
  app.add_option("--texture-memory", texts.texture_memory,
                 "Decoded textures of a scene beyond this lie in a file; default: a quarter of the memory");
  app.add_option("--scratch", texts.scratch, "Folder for that file, on a disk; default: the cache's")
      ->type_name("DIR");
  app.add_option("--threads", texts.threads, "Render threads; default: all cores this process may use");
  app.add_option("--name", texts.name, "Name shown to people; default: the host's name");
  app.add_option("--tls-cert", texts.tls_cert, "This worker's certificate (PEM)")->type_name("FILE");
  app.add_option("--tls-key", texts.tls_key, "The certificate's private key (PEM)")->type_name("FILE");
  app.add_option("--tls-ca", texts.tls_ca, "The authority that signed the master's certificate (PEM)")
      ->type_name("FILE");
  app.add_flag("--insecure", texts.insecure, "Allow a master beyond loopback without TLS");
  app.add_option("--give-up", texts.give_up,
                 "End after this long without a master, such as 10m; default: never");
  app.add_option("--log-level", texts.log_level, "trace, debug, info, warn, error or off; default: info");
  app.add_option("--log-format", texts.log_format, "text or json; default: text");
  return parse_and_run("candela-worker", app, argc, argv, [&] { return run(texts); });
}

}  // namespace candela::worker
