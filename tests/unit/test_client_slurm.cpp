// candela slurm: scripts that a shell reads, and that say what was asked for; words that Slurm or a shell
// would misread are refused. What Slurm makes of them: tests/slurm.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "client/embedded/app.h"
#include "client/slurm/batch_script.h"
#include "tests/paths.h"
#include "tests/unit/client_outcome.h"

namespace candela::client {
namespace {

class Slurm : public CommandTest {
 protected:
  Outcome run(std::vector<std::string> more, const std::string& master = "farm:7070") const {
    std::vector<std::string> arguments = {"slurm", "--master", master, "--insecure"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_candela(arguments);
  }
  // Tells if bash reads the script to its end, and finds no fault.
  static bool bash_reads(const std::string& path) {
    return std::system(("bash -n '" + path + "'").c_str()) == 0;
  }
};

TEST_F(Slurm, TheScriptSaysWhatWasAskedFor) {
  const Outcome script = run({"--workers",
                              "20",
                              "--cpus",
                              "16",
                              "--memory",
                              "32G",
                              "--time",
                              "8:00:00",
                              "--partition",
                              "render,spare",
                              "--account",
                              "light",
                              "--qos",
                              "low",
                              "--notice",
                              "90",
                              "--sbatch",
                              "--constraint=avx2",
                              "--sbatch=--nice=100",
                              "--cache",
                              "/scratch/it's here",
                              "--give-up",
                              "30m",
                              "--program",
                              "/opt/candela/bin/candela-worker"});
  ASSERT_EQ(script.code, 0) << script.err;
  for (const char* line :
       {"#SBATCH --array=1-20\n", "#SBATCH --cpus-per-task=16\n", "#SBATCH --mem=32G\n",
        "#SBATCH --time=8:00:00\n", "#SBATCH --partition=render,spare\n", "#SBATCH --account=light\n",
        "#SBATCH --qos=low\n", "#SBATCH --signal=B:TERM@90\n", "#SBATCH --requeue\n",
        "#SBATCH --constraint=avx2\n", "#SBATCH --nice=100\n", "cache='/scratch/it'\\''s here'\n",
        "exec /opt/candela/bin/candela-worker \\\n", "--master farm:7070 --insecure", "--give-up 30m"})
    EXPECT_NE(script.out.find(line), std::string::npos) << line << "\n" << script.out;
  const std::string path = (folder_.path() / "workers.sbatch").string();
  const Outcome written = run({"-o", path});
  ASSERT_EQ(written.code, 0) << written.err;
  EXPECT_EQ(written.out, "");
  EXPECT_TRUE(bash_reads(path));
}

// The script, run without Slurm beside a program that prints how it was called.
TEST_F(Slurm, TheScriptStartsAWorker) {
  const std::string program = (folder_.path() / "a worker").string();
  std::ofstream(program) << "#!/bin/sh\nprintf '%s\\n' \"$@\"\n";
  std::filesystem::permissions(program, std::filesystem::perms::owner_all);
  const std::string path = (folder_.path() / "workers.sbatch").string(),
                    cache = folder_.path() / "some $cache";
  ASSERT_EQ(run({"-o", path, "--program", program, "--cache", cache}).code, 0);
  const std::string said = (folder_.path() / "said").string();
  ASSERT_EQ(std::system(("SLURM_CPUS_PER_TASK=3 SLURM_ARRAY_JOB_ID=7 SLURM_ARRAY_TASK_ID=2 bash '" + path +
                         "' >'" + said + "'")
                            .c_str()),
            0);
  std::stringstream words;
  words << std::ifstream(said).rdbuf();
  EXPECT_EQ(words.str(),
            "--master\nfarm:7070\n--insecure\n--cache\n" + cache + "\n--threads\n3\n--name\nslurm-7-2\n");
  EXPECT_TRUE(std::filesystem::is_directory(cache));
}

// Claim: if Slurm warns before the worker runs, the script ends well and starts no worker. The signal comes
// from a mkdir of our own, which the script calls before the worker.
TEST_F(Slurm, TheScriptLeavesWhenItIsWarned) {
  const std::string said = (folder_.path() / "said").string();
  const auto program = [&](const char* name, const std::string& text) {
    const std::string path = (folder_.path() / name).string();
    std::ofstream(path) << "#!/bin/sh\n" << text << "\n";
    std::filesystem::permissions(path, std::filesystem::perms::owner_all);
    return path;
  };
  program("mkdir", "kill -TERM $PPID");
  const std::string worker = program("candela-worker", "touch '" + said + "'"),
                    path = folder_.path() / "workers.sbatch";
  ASSERT_EQ(run({"-o", path, "--program", worker, "--cache", folder_.path() / "cache"}).code, 0);
  for (const std::string& script :
       {path, test::source_path("deploy/slurm/candela-workers.sbatch").string()}) {
    const std::string command =
        "PATH='" + folder_.path().string() + "':\"$PATH\" CANDELA_MASTER=farm:7070 bash '";
    EXPECT_EQ(std::system((command + script + "'").c_str()), 0) << script;
    EXPECT_FALSE(std::filesystem::exists(said)) << script;
  }
}

TEST_F(Slurm, BadWordsAreOneError) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> bad = {
      {{"--workers", "0"}, "--workers"},
      {{"--cpus", "many"}, "--cpus"},
      {{"--notice", "70000"}, "--notice"},
      {{"--partition", "a b"}, "--partition"},
      {{"--account", "x\n#SBATCH --uid=0"}, "--account"},
      {{"--memory", "32 G"}, "--memory"},
      {{"--time", "8h 30"}, "--time"},
      {{"--name", ""}, "--name"},
      {{"--sbatch", "constraint=avx2"}, "--sbatch"},
      {{"--sbatch", "--nice\nrm -rf"}, "--sbatch"},
      {{"--logs", "logs-%j"}, "--logs"},
      {{"--give-up", "soon"}, "--give-up"},
      {{"--cache", "a\nb"}, "--cache"},
  };
  for (const auto& [arguments, option] : bad) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.code, 2) << option << outcome.out;
    EXPECT_NE(outcome.err.find(option + ": "), std::string::npos) << outcome.err;
    EXPECT_EQ(outcome.out, "") << option;
  }
  std::ostringstream out, err;
  EXPECT_EQ(run_program({"candela", "slurm"}, out, err), 2) << "no master is given";
}

TEST_F(Slurm, AMasterOnLoopbackIsWarnedOf) {
  EXPECT_NE(run({}, "localhost:7070").err.find("loopback"), std::string::npos);
  EXPECT_EQ(run({}).err, "");
}

TEST_F(Slurm, WithoutSlurmNothingIsSubmitted) {
  const std::string path = std::getenv("PATH");
  ::setenv("PATH", "/nonexistent", 1);
  const Outcome outcome = run({"--submit"});
  ::setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.err.find("there is no program sbatch in PATH"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace candela::client
