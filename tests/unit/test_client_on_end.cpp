// --on-end: the command that runs when jobs have ended, and what it is told.
#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "client/commands/on_end.h"
#include "tests/temporary_folder.h"

namespace candela::client {
namespace {

struct Ran {
  int code;
  std::string told, err;  // `told`: what the command wrote to $TOLD
};

Ran run_command(const std::string& command, const std::vector<EndedJob>& ended) {
  const test::TemporaryFolder folder;
  const std::string file = (folder.path() / "told").string();
  std::ostringstream out, err;
  Context context{out, err, {}, {}, {}};
  ::setenv("TOLD", file.c_str(), 1);
  const int code = run_on_end(context, command, ended);
  ::unsetenv("TOLD");
  EXPECT_EQ(out.str(), "");
  std::ifstream told(file);
  return {code, std::string(std::istreambuf_iterator<char>(told), {}), err.str()};
}

constexpr const char* kTell =
    R"(printf '%s|%s|%s|%s\n' "$CANDELA_JOB_ID" "$CANDELA_JOB_NAME" "$CANDELA_JOB_STATE" "$CANDELA_JOB_ERROR" >>$TOLD)";

// Claim: the command runs once for each job that has ended, in their order, and knows its id, name, state and
// error; a failure is told with its exit code, and the others still run. Without a command nothing happens.
TEST(OnEnd, RunsForEachJobAndTellsFailures) {
  const std::vector<EndedJob> ended = {{"j1", "box", "done"}, {"g2", "shot", "failed", "scene.xml:1: no"}};
  EXPECT_EQ(run_command("", ended).code, 0);
  const Ran ran = run_command(kTell, ended);
  EXPECT_EQ(ran.code, 0);
  EXPECT_EQ(ran.err, "");
  EXPECT_EQ(ran.told, "j1|box|done|\ng2|shot|failed|scene.xml:1: no\n");
  const Ran wrong = run_command(std::string(kTell) + "; test $CANDELA_JOB_STATE = failed || exit 3", ended);
  EXPECT_EQ(wrong.code, 1);
  EXPECT_EQ(wrong.err, "candela: error: --on-end for j1 (box): exit code 3\n");
  EXPECT_EQ(wrong.told, ran.told);
  const Ran killed = run_command("kill -9 $$", {ended[0]});
  EXPECT_EQ(killed.code, 1);
  EXPECT_NE(killed.err.find("signal 9"), std::string::npos) << killed.err;
  const Ran absent = run_command("/nonexistent/program 2>/dev/null", {ended[0]});
  EXPECT_EQ(absent.err, "candela: error: --on-end for j1 (box): exit code 127\n");
}

// Claim: no text of a job is code, an option or a second line, and none is cut: quotes, spaces, options,
// newlines, NUL, other scripts, bytes that are no text. What another command told of other jobs is not there.
TEST(OnEnd, TextsOfJobsAreTextsAlone) {
  const std::pair<std::string, std::string> names[] = {
      {"a 'b' \"$(touch no)\" `touch no`; touch no", "a 'b' \"$(touch no)\" `touch no`; touch no"},
      {"-n", "-n"},
      {"", ""},
      {"Küche 台所", "Küche 台所"},
      {"line\nCANDELA_JOB_STATE=done\r", "line\\nCANDELA_JOB_STATE=done\\r"},
      {std::string("cut\0here", 8), "cut\\x00here"},
      {"\x1b[31m\xff", "\\x1b[31m\\xff"},
      {std::string(256, 'x'), std::string(256, 'x')}};
  ::setenv("CANDELA_JOB_ERROR", "another's", 1);
  for (const auto& [name, shown] : names) {
    const Ran ran = run_command(kTell, {{"j1", name, "cancelled"}});
    EXPECT_EQ(ran.told, "j1|" + shown + "|cancelled|\n");
    EXPECT_EQ(ran.code, 0) << ran.err;
  }
  ::unsetenv("CANDELA_JOB_ERROR");
}

// Claim: the command itself may have any form: several lines, quotes, a first character that is an option's.
TEST(OnEnd, CommandsOfAnyForm) {
  EXPECT_EQ(run_command("x='a \"b\"'\nprintf '%s' \"$x\" >$TOLD\n", {{"j1", "a", "done"}}).told, "a \"b\"");
  EXPECT_EQ(run_command("-c 2>/dev/null || printf ran >$TOLD", {{"j1", "a", "done"}}).told, "ran");
  EXPECT_NE(run_command("printf 'open", {{"j1", "a", "done"}}).err.find("exit code 2"), std::string::npos);
}

// Claim: signals that this process, or who started it, ignores change nothing: a pipe that is closed ends its
// writer, and the exit code is known where SIGCHLD is ignored.
TEST(OnEnd, IgnoredSignals) {
  const auto pipes = std::signal(SIGPIPE, SIG_IGN);
  const auto children = std::signal(SIGCHLD, SIG_IGN);
  const Ran ran =
      run_command("(yes; echo $? >$TOLD) 2>&1 | head -1 >/dev/null; exit 5", {{"j1", "a", "done"}});
  EXPECT_EQ(std::signal(SIGCHLD, children), SIG_IGN);
  std::signal(SIGPIPE, pipes);
  EXPECT_EQ(ran.told, "141\n");  // 128 + SIGPIPE
  EXPECT_EQ(ran.err, "candela: error: --on-end for j1 (a): exit code 5\n");
}

}  // namespace
}  // namespace candela::client
