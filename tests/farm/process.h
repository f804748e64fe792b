// Child processes of the farm tests: started with a clean environment, watched with bounded waits, and never
// left behind.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace candela::farm {

// Begins the line of a master's log that tells of a violated invariant (checked_master.h).
inline constexpr const char* kViolation = "invariant violated: ";

// A folder that is removed with the object.
class TempDir {
 public:
  TempDir();
  ~TempDir();
  TempDir(const TempDir&) = delete;
  TempDir& operator=(const TempDir&) = delete;
  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

// Polls until `condition` holds; false if it did not within `seconds`.
bool eventually(double seconds, const std::function<bool()>& condition);

class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

// A child in a process group of its own, which dies with this object and with the test. Its output goes to
// files, so that nobody has to drain it.
class Process {
 public:
  // `out` is the stem of its output files. Throws std::runtime_error if it cannot be started.
  Process(const std::vector<std::string>& arguments, const std::filesystem::path& out,
          const std::map<std::string, std::string>& environment);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  pid_t pid() const { return pid_; }
  void signal(int number);
  // The exit code, or 128 + n where signal n ended it; nothing if it still runs after `seconds`.
  std::optional<int> wait(double seconds);
  bool running() { return !wait(0).has_value(); }
  // SIGKILL, and waits for its end.
  void kill();

  std::string out() const;  // so far
  std::string err() const;
  // The rest of the first line of standard output that starts with `prefix`; empty if none came.
  std::string wait_for_line(const std::string& prefix, double seconds);

 private:
  pid_t pid_ = -1;
  std::optional<int> exit_;
  std::filesystem::path out_, err_;
};

// A child that sleeps as long as this object lives. What is done to its job meanwhile finds it amid its work,
// however short the job and however busy the machine.
class Asleep {
 public:
  explicit Asleep(Process& process) : process_(process) { process_.signal(SIGSTOP); }
  ~Asleep() { process_.signal(SIGCONT); }
  Asleep(const Asleep&) = delete;
  Asleep& operator=(const Asleep&) = delete;

 private:
  Process& process_;
};

}  // namespace candela::farm
