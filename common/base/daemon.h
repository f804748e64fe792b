// Code that the servers' programs share: their settings from command line, environment and configuration
// files, their log, their signals and their ends. (parse_and_run.h reads the command line itself.)
#pragma once

#include <csignal>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "common/base/config.h"
#include "common/base/result.h"

namespace candela {

// A value with the place it came from, for error messages.
struct Chosen {
  std::string value, origin;
  bool empty() const { return value.empty(); }
};

// The settings of one program: its section of the configuration files, and what all programs share.
class DaemonSettings {
 public:
  // `program`: as in messages, such as "candela-worker".
  static Result<DaemonSettings> load(std::string program, std::string section);

  // `given` on the command line, else the section's own setting, else (if `shared`) that of all programs.
  enum class Scope { section, shared };
  Chosen choose(const std::string& option, const std::string& given, Scope scope) const;

  // The log as --log-level and --log-format say; "info" and "text" otherwise.
  Result<void> start_log(const std::string& level, const std::string& format) const;
  // An error for settings that nobody knows.
  Result<void> check_names(const std::vector<std::string>& known) const;

 private:
  DaemonSettings(Config config, std::string program, std::string section)
      : config_(std::move(config)), program_(std::move(program)), section_(std::move(section)) {}

  Config config_;
  std::string program_, section_;
};

// Readers of chosen values. Nothing chosen leaves `out` as it is. `what` says in an error what the value is
// not.
Result<void> read_bytes(const Chosen& chosen, std::uint64_t& out);
Result<void> read_seconds(const Chosen& chosen, double& out);           // at least 0
Result<void> read_positive_seconds(const Chosen& chosen, double& out);  // above 0
Result<void> read_share(const Chosen& chosen, double& out);             // 0 to 1
Result<void> read_flag(const Chosen& chosen, bool& out);
Error bad_value(const Chosen& chosen, const std::string& what);

// The folder in which a worker keeps scene files unless --cache names another one.
Result<std::filesystem::path> default_cache_folder();

// Prints the error; returns its exit code.
int report(const char* program, const Error& error);

// Blocks the signals in this thread and all that it starts, to be waited for, so that nothing runs in a
// handler. A closed log pipe and a file size limit do not end the process: their writes fail.
sigset_t block_signals(std::initializer_list<int> signals);

// Replaces the process by a new one of the same program and arguments, whatever its threads do. Open files
// are closed; the process id and blocked signals stay. Returns only if that failed.
void begin_again(char** argv);

// Ends the process without destructors, with logs and streams flushed.
[[noreturn]] void end_process(int code);

}  // namespace candela
