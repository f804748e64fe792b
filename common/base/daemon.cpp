#include "common/base/daemon.h"

#include <fmt/format.h>
#include <linux/close_range.h>
#include <pthread.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

#include "common/base/log.h"
#include "common/base/quantity.h"
#include "common/base/text.h"

namespace candela {

Result<DaemonSettings> DaemonSettings::load(std::string program, std::string section) {
  CANDELA_ASSIGN(Config config, Config::load());
  return DaemonSettings(std::move(config), std::move(program), std::move(section));
}

Chosen DaemonSettings::choose(const std::string& option, const std::string& given, Scope scope) const {
  if (!given.empty()) return {given, "--" + option};
  const std::string own = section_ + "." + option;
  if (auto value = config_.get(own)) return {*value, config_.origin(own)};
  if (scope == Scope::shared)
    if (auto value = config_.get(option)) return {*value, config_.origin(option)};
  return {{}, "--" + option};
}

Result<void> DaemonSettings::start_log(const std::string& level, const std::string& format) const {
  const Chosen chosen_level = choose("log-level", level, Scope::shared);
  const Chosen chosen_format = choose("log-format", format, Scope::shared);
  return log::initialise(program_, chosen_level.empty() ? "info" : chosen_level.value,
                         chosen_format.empty() ? "text" : chosen_format.value);
}

Result<void> DaemonSettings::check_names(const std::vector<std::string>& known) const {
  CANDELA_TRY(config_.check_shared());
  return config_.check_section(section_, known);
}

Error bad_value(const Chosen& chosen, const std::string& what) {
  return usage_error(fmt::format("'{}' is not {}", chosen.value.substr(0, 100), what))
      .with_field(chosen.origin);
}

Result<void> read_bytes(const Chosen& chosen, std::uint64_t& out) {
  if (chosen.empty()) return {};
  const auto bytes = parse_bytes(chosen.value);
  if (!bytes) return bad_value(chosen, "a size in bytes such as 500M, 20G or 1T");
  out = *bytes;
  return {};
}

Result<void> read_seconds(const Chosen& chosen, double& out) {
  if (chosen.empty()) return {};
  const auto seconds = parse_seconds(chosen.value);
  if (!seconds) return bad_value(chosen, "a time such as 90s, 10m or 2h");
  out = *seconds;
  return {};
}

Result<void> read_positive_seconds(const Chosen& chosen, double& out) {
  if (chosen.empty()) return {};
  const auto seconds = parse_seconds(chosen.value);
  if (!seconds || *seconds == 0) return bad_value(chosen, "a time above 0 such as 2.5, 30s, 10m or 1h");
  out = *seconds;
  return {};
}

Result<void> read_share(const Chosen& chosen, double& out) {
  if (chosen.empty()) return {};
  const auto share = parse_share(chosen.value);
  if (!share) return bad_value(chosen, "a share from 0 to 1 such as 0.01, 1% or 0");
  out = *share;
  return {};
}

Result<void> read_flag(const Chosen& chosen, bool& out) {
  if (chosen.empty()) return {};
  const std::string& text = chosen.value;
  if (text != "true" && text != "false" && text != "1" && text != "0")
    return bad_value(chosen, "true or false");
  out = text == "true" || text == "1";
  return {};
}

int report(const char* program, const Error& error) {
  std::fprintf(stderr, "%s: %s\n", program, escape_unprintable(error.to_string()).c_str());
  return error.exit_code();
}

sigset_t block_signals(std::initializer_list<int> signals) {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : signals) sigaddset(&set, signal);
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  return set;
}

void begin_again(char** argv) {
  log::flush();
  std::fflush(nullptr);
  ::close_range(STDERR_FILENO + 1, ~0U, CLOSE_RANGE_CLOEXEC);
  ::execv("/proc/self/exe", argv);
}

void end_process(int code) {
  log::flush();
  std::fflush(nullptr);
  std::_Exit(code);
}

Result<std::filesystem::path> default_cache_folder() {
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

}  // namespace candela
