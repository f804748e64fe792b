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

#include "client/values.h"

namespace candela::client {
namespace {

// Empty: it ended with exit code 0.
std::string run(const std::string& command, const EndedJob& job) {
  std::vector<std::string> environment;
  for (char** entry = environ; *entry != nullptr; ++entry)
    if (!std::string_view(*entry).starts_with("CANDELA_JOB_")) environment.emplace_back(*entry);
  environment.push_back("CANDELA_JOB_ID=" + job.id);
  environment.push_back("CANDELA_JOB_NAME=" + job.name);
  environment.push_back("CANDELA_JOB_STATE=" + job.state);
  std::vector<char*> entries;
  for (std::string& entry : environment) entries.push_back(entry.data());
  entries.push_back(nullptr);
  std::string shell = "sh", option = "-c", text = command;
  char* arguments[] = {shell.data(), option.data(), text.data(), nullptr};
  pid_t child = 0;
  if (const int error = ::posix_spawn(&child, "/bin/sh", nullptr, nullptr, arguments, entries.data());
      error != 0)
    return fmt::format("cannot start /bin/sh: {}", std::strerror(error));
  int status = 0;
  while (::waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return fmt::format("waiting for it failed: {}", std::strerror(errno));
  if (WIFSIGNALED(status)) return fmt::format("signal {} ended it", WTERMSIG(status));
  return WEXITSTATUS(status) == 0 ? "" : fmt::format("exit code {}", WEXITSTATUS(status));
}

}  // namespace

void add_on_end(CLI::App& app, std::optional<std::string>& command, const std::string& when) {
  add_text(app, "--on-end", command,
           (when.empty() ? std::string("Run") : when + "run") +
               " this by /bin/sh when the job or group has ended, after its image is written, with "
               "CANDELA_JOB_ID, CANDELA_JOB_NAME and CANDELA_JOB_STATE",
           "COMMAND");
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
