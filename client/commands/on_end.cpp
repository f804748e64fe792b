#include "client/commands/on_end.h"

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <ostream>
#include <string_view>
#include <utility>

#include "client/values.h"

namespace candela::client {
namespace {

// While one lives, the end of a child is kept for waitpid. A parent that ignores SIGCHLD hands that down.
class KeptChildren {
 public:
  KeptChildren() {
    struct sigaction action {};
    action.sa_handler = SIG_DFL;
    sigemptyset(&action.sa_mask);
    ::sigaction(SIGCHLD, &action, &before_);
  }
  ~KeptChildren() { ::sigaction(SIGCHLD, &before_, nullptr); }
  KeptChildren(const KeptChildren&) = delete;
  KeptChildren& operator=(const KeptChildren&) = delete;

 private:
  struct sigaction before_ {};
};

// Starts /bin/sh. gRPC ignores SIGPIPE, by which commands such as `yes | head` end: the shell has it again.
int start_shell(pid_t& child, char** arguments, char** environment) {
  posix_spawnattr_t attributes;
  if (const int error = ::posix_spawnattr_init(&attributes); error != 0) return error;
  sigset_t restored;
  sigemptyset(&restored);
  sigaddset(&restored, SIGPIPE);
  ::posix_spawnattr_setsigdefault(&attributes, &restored);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
  const int error = ::posix_spawn(&child, "/bin/sh", nullptr, &attributes, arguments, environment);
  ::posix_spawnattr_destroy(&attributes);
  return error;
}

// Empty: it ended with exit code 0.
std::string run(const std::string& command, const EndedJob& job) {
  std::vector<std::string> environment;
  for (char** entry = environ; *entry != nullptr; ++entry)
    if (!std::string_view(*entry).starts_with("CANDELA_JOB_")) environment.emplace_back(*entry);
  // A name may have any bytes. One line cannot be cut at a NUL, nor add a header to a mail.
  for (const auto& [name, value] : {std::pair<const char*, const std::string&>{"ID", job.id},
                                    {"NAME", job.name},
                                    {"STATE", job.state},
                                    {"ERROR", job.error}})
    environment.push_back(fmt::format("CANDELA_JOB_{}={}", name, printable(value)));
  std::vector<char*> entries;
  for (std::string& entry : environment) entries.push_back(entry.data());
  entries.push_back(nullptr);
  // Without "--" a command that begins with '-' would be options of the shell.
  std::string shell = "sh", option = "-c", end_of_options = "--", text = command;
  char* arguments[] = {shell.data(), option.data(), end_of_options.data(), text.data(), nullptr};
  const KeptChildren kept;
  pid_t child = 0;
  if (const int error = start_shell(child, arguments, entries.data()); error != 0)
    return fmt::format("cannot start /bin/sh: {}", std::strerror(error));
  int status = 0;
  while (::waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return fmt::format("waiting for it failed: {}", std::strerror(errno));
  if (WIFSIGNALED(status)) return fmt::format("signal {} ended it", WTERMSIG(status));
  return WEXITSTATUS(status) == 0 ? "" : fmt::format("exit code {}", WEXITSTATUS(status));
}

}  // namespace

void add_on_end(CLI::App& app, std::optional<std::string>& command) {
  add_text(
      app, "--on-end", command,
      "Run this by /bin/sh when the job or group has ended and its image is written, with CANDELA_JOB_ID, "
      "CANDELA_JOB_NAME, CANDELA_JOB_STATE and, after a failure, CANDELA_JOB_ERROR; `submit` needs --wait",
      "COMMAND")
      ->check([](const std::string& text) {
        return text.find_first_not_of(" \t\n") == std::string::npos ? "the command is empty" : std::string();
      });
}

int run_on_end(Context& context, const std::string& command, const std::vector<EndedJob>& ended) {
  if (command.empty()) return 0;
  context.out << std::flush;
  context.err << std::flush;
  int code = 0;
  for (const EndedJob& job : ended) {
    const std::string trouble = run(command, job);
    if (trouble.empty()) continue;
    context.err << fmt::format("candela: error: --on-end for {} ({}): {}\n", printable(job.id),
                               printable(job.name), trouble);
    code = 1;
  }
  return code;
}

}  // namespace candela::client
