#include "client/slurm/batch_script.h"

#include <fmt/format.h>
#include <sys/wait.h>

#include <algorithm>
#include <cctype>
#include <csignal>
#include <cstdio>
#include <cstdlib>

#include "common/base/shell_words.h"

namespace candela::client {
namespace {

// True if all of `text` are letters, digits or one of `others`.
bool plain(const std::string& text, std::string_view others) {
  return std::all_of(text.begin(), text.end(), [&](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || others.find(c) != std::string_view::npos;
  });
}

bool one_line(const std::string& text) {
  return std::none_of(text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20; });
}

Result<void> check_words(const SlurmJob& job) {
  struct Word {
    const char* option;
    const std::string& value;
    std::string_view others;
    const char* mend;
  };
  const Word words[] = {
      {"--partition", job.partition, "-_,.", "a name, or names with commas between"},
      {"--account", job.account, "-_.", "a name"},
      {"--qos", job.qos, "-_.", "a name"},
      {"--name", job.name, "-_.", "letters, digits, '-', '_' and '.'"},
      {"--memory", job.memory, "", "a number of megabytes, or a number and K, M, G or T"},
      {"--time", job.time, ":-", "minutes, HOURS:MINUTES:SECONDS or DAYS-HOURS"},
  };
  for (const Word& word : words)
    if (!plain(word.value, word.others))
      return usage_error(fmt::format("'{}' is not what Slurm takes", word.value))
          .with_field(word.option)
          .with_mend(word.mend);
  if (job.name.empty()) return usage_error("is empty").with_field("--name");
  for (const std::string& more : job.more)
    if (!more.starts_with("--") || more.size() < 3 || !one_line(more))
      return usage_error(fmt::format("'{}' is no option of sbatch", more))
          .with_field("--sbatch")
          .with_mend("such as --sbatch=--constraint=avx2");
  for (const auto& [option, path] : {std::pair{"--logs", &job.logs}, std::pair{"--program", &job.program},
                                     std::pair{"--cache", &job.cache}})
    if (!one_line(*path))
      return usage_error("has a line break or another control character").with_field(option);
  if (job.logs.find_first_of("%\\\"") != std::string::npos)
    return usage_error(fmt::format("'{}' has a '%', '\\' or '\"', which Slurm reads itself", job.logs))
        .with_field("--logs");
  return {};
}

std::string header(const SlurmJob& job) {
  std::string text;
  const auto line = [&](const std::string& option) { text += "#SBATCH " + option + "\n"; };
  const auto optional = [&](const char* option, const std::string& value) {
    if (!value.empty()) line(fmt::format("--{}={}", option, value));
  };
  line("--job-name=" + job.name);
  line(fmt::format("--array=1-{}", job.workers));
  line("--ntasks=1");
  line(fmt::format("--cpus-per-task={}", job.cpus));
  optional("mem", job.memory);
  optional("time", job.time);
  optional("partition", job.partition);
  optional("account", job.account);
  optional("qos", job.qos);
  const std::string folder = job.logs.empty() ? "" : job.logs + "/";
  line(fmt::format("--output=\"{}{}-%A-%a.log\"", folder, job.name));
  line("--open-mode=append");
  line("--requeue");
  line(fmt::format("--signal=B:TERM@{}", job.notice));
  for (const std::string& more : job.more) line(more);
  return text;
}

std::string command(const SlurmJob& job) {
  std::string text =
      fmt::format("exec {} \\\n  --master {}", shell_quote(job.program), shell_quote(job.farm.master));
  if (job.farm.insecure) text += " --insecure";
  for (const auto& [option, path] :
       {std::pair{"--tls-cert", &job.farm.tls_cert}, std::pair{"--tls-key", &job.farm.tls_key},
        std::pair{"--tls-ca", &job.farm.tls_ca}, std::pair{"--token-file", &job.farm.token_file}})
    if (!path->empty()) text += fmt::format(" \\\n  {} {}", option, shell_quote(*path));
  if (!job.give_up.empty()) text += fmt::format(" \\\n  --give-up {}", shell_quote(job.give_up));
  return text +
         " \\\n  --cache \"$cache\" --threads \"${SLURM_CPUS_PER_TASK:-1}\" \\\n"
         "  --name \"slurm-${SLURM_ARRAY_JOB_ID:-${SLURM_JOB_ID:-0}}-${SLURM_ARRAY_TASK_ID:-0}\"\n";
}

}  // namespace

Result<std::string> batch_script(const SlurmJob& job) {
  CANDELA_TRY(check_words(job));
  const std::string cache = job.cache.empty() ? "${TMPDIR:-/tmp}/candela-cache-$(id -un)" : "";
  return "#!/usr/bin/env bash\n"
         "# Workers of a Candela farm as a job array, one worker a task; written by `candela slurm`. The "
         "array's\n"
         "# indices mean nothing to Candela: tasks may start late, run twice, be requeued or end at any "
         "time.\n" +
         header(job) +
         "# Slurm warns before the limit. The worker, which replaces this shell, then gives back what\n"
         "# it has not rendered, delivers the rest, and leaves. This shell has no work and exits at once.\n"
         "trap 'exit 0' TERM\n"
         "set -euo pipefail\n" +
         fmt::format("cache={}\n", cache.empty() ? shell_quote(job.cache) : cache) +
         "mkdir -p -m 700 \"$cache\"\n" + command(job);
}

Result<void> submit_batch_script(const std::string& script) {
  if (std::system("command -v sbatch >/dev/null 2>&1") != 0)
    return failed_error("there is no program sbatch in PATH")
        .with_mend("call this on a machine of the cluster, or leave --submit out and carry the script there");
  const auto before = std::signal(SIGPIPE, SIG_IGN);  // an sbatch that ends early is told by its exit code
  std::fflush(stdout);
  FILE* pipe = ::popen("exec sbatch", "w");
  if (pipe == nullptr) {
    std::signal(SIGPIPE, before);
    return failed_error("sbatch cannot be started");
  }
  const bool written = std::fwrite(script.data(), 1, script.size(), pipe) == script.size();
  const int status = ::pclose(pipe);
  std::signal(SIGPIPE, before);
  if (status != 0 || !written)
    return failed_error(fmt::format("sbatch refused the script (exit code {}); it says why above",
                                    WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status)));
  return {};
}

}  // namespace candela::client
