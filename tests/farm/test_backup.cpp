// Backups of a master's data, made while it works, and farms that go on from them.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <csignal>
#include <filesystem>
#include <fstream>

#include "tests/farm/farm.h"
#include "tests/paths.h"
#include "tests/temporary_folder.h"

namespace candela::farm {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kIterations = 601;

CommandResult run(Farm& farm, const std::vector<std::string>& arguments) {
  static int serial = 0;
  Process process(arguments, farm.folder() / ("backup-" + std::to_string(++serial)), farm.environment());
  CommandResult out;
  out.exit_code = process.wait(kPatienceSeconds).value_or(-1);
  out.out = process.out();
  out.err = process.err();
  return out;
}

std::string master_program() {
  return test::program_path("candela-master");
}

CommandResult backup(Farm& farm, const fs::path& target, std::vector<std::string> more = {}) {
  std::vector<std::string> arguments = {master_program(), "backup", target.string(), "--data",
                                        (farm.folder() / "data").string()};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return run(farm, arguments);
}

// Claim: a backup made in the middle of a render, and a second one on its base, are whole: with the master
// killed and its folder gone, a master that starts with the second finishes the job, and image and ledger are
// those of a render without any accident. Jobs that had ended keep their image.
TEST(Backup, InTheMiddleOfARender) {
  Farm farm;
  farm.start_master({"--unit-time", "0.05", "--checkpoint-interval", "0.1", "--lease-time", "2"});
  Process& worker = farm.start_worker("one");
  const std::string ended = farm.submit(16);
  farm.wait_for(ended, v1::JOB_STATE_DONE);
  const std::string id = farm.submit(kIterations);
  ASSERT_TRUE(eventually(kPatienceSeconds, [&] { return farm.job(id).checkpoint_generation() > 0; }));
  const CommandResult first = backup(farm, farm.folder() / "first");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_NE(first.out.find("2 jobs"), std::string::npos) << first.out;
  worker.signal(SIGSTOP);  // the job must not end before the master is killed
  const CommandResult second =
      backup(farm, farm.folder() / "second", {"--base", (farm.folder() / "first").string()});
  ASSERT_EQ(second.exit_code, 0) << second.err;
  const std::uint64_t then = farm.job(id).iterations();
  EXPECT_LT(then, kIterations) << "the render was too quick for this test";
  farm.kill_master();
  fs::remove_all(farm.folder() / "data");
  fs::copy(farm.folder() / "second", farm.folder() / "data", fs::copy_options::recursive);
  farm.restart_master();
  worker.signal(SIGCONT);
  EXPECT_GT(farm.job(id).iterations(), 0U);
  farm.wait_for(id, v1::JOB_STATE_DONE);
  expect_identical(farm.fetch(id), farm.render(kIterations), "from a backup");
  expect_identical(farm.fetch(ended), farm.render(16), "ended before the backup");
  farm.audit(id, kIterations);
  farm.audit(ended, 16);
  const CommandResult verified = farm.candela({"verify"});
  EXPECT_EQ(verified.exit_code, 0) << verified.out << verified.err;
}

// Claim: on another file system a backup is copied whole, a second one takes what has not changed from the
// first as links, but nothing that the first's disk has damaged, and a farm goes on from it.
TEST(Backup, OnAnotherFileSystem) {
  Farm farm;
  const fs::path other = "/dev/shm";
  struct stat here {
  }, there{};
  if (::stat(farm.folder().path().c_str(), &here) != 0 || ::stat(other.c_str(), &there) != 0 ||
      here.st_dev == there.st_dev)
    GTEST_SKIP() << "/dev/shm is no other file system than that of " << farm.folder().path();
  const test::TemporaryFolder scratch(other);
  const fs::path& target = scratch.path();
  farm.start_master();
  farm.start_worker("one");
  const std::string id = farm.submit(16);
  farm.wait_for(id, v1::JOB_STATE_DONE);
  const CommandResult first = backup(farm, target / "first");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_NE(first.out.find(" 0 of them with 0.0 MB as links"), std::string::npos) << first.out;
  // The base's disk has lost a bit of the newest checkpoint, which neither its size nor its time tells.
  const fs::path checkpoint =
      fs::path("jobs") / id / ("film." + std::to_string(farm.job(id).checkpoint_generation()) + ".ckpt");
  const auto time = fs::last_write_time(target / "first" / checkpoint);
  {
    std::fstream file(target / "first" / checkpoint, std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(100);
    const char flipped = static_cast<char>(file.get() ^ 1);
    file.seekp(100);
    file.put(flipped);
  }
  fs::last_write_time(target / "first" / checkpoint, time);
  const CommandResult second = backup(farm, target / "second", {"--base", (target / "first").string()});
  ASSERT_EQ(second.exit_code, 0) << second.err;
  EXPECT_EQ(second.out.find(" 0 of them"), std::string::npos) << second.out;
  farm.kill_master();
  fs::remove_all(farm.folder() / "data");
  fs::remove_all(target / "first");  // the second stands without it
  fs::copy(target / "second", farm.folder() / "data", fs::copy_options::recursive);
  farm.restart_master();
  expect_identical(farm.fetch(id), farm.render(16), "from a backup on another file system");
  const CommandResult verified = farm.candela({"verify"});
  EXPECT_EQ(verified.exit_code, 0) << verified.out << verified.err;
}

// Claim: what cannot be backed up is one line and leaves nothing behind: a name that is taken, no store, a
// base that is none, a place in the data folder, a full disk, a damaged store.
TEST(Backup, RefusesInOneLine) {
  Farm farm;
  farm.start_master();
  const std::string id = farm.submit(4);
  farm.kill_master();
  const fs::path target = farm.folder() / "b";
  const auto refused = [&](const CommandResult& result, const std::string& part) {
    EXPECT_NE(result.exit_code, 0) << part;
    EXPECT_NE(result.err.find(part), std::string::npos) << result.err;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_FALSE(fs::exists(target)) << part;
    EXPECT_FALSE(fs::exists(farm.folder() / "b.partial")) << part;
  };
  fs::create_directories(farm.folder() / "taken");
  refused(backup(farm, farm.folder() / "taken"), "this is there already");
  refused(run(farm, {master_program(), "--data", farm.folder().path().string(), "backup", target.string()}),
          "no master has kept its jobs in this folder");
  refused(backup(farm, target, {"--base", (farm.folder() / "taken").string()}), "this is no backup");
  refused(backup(farm, farm.folder() / "data" / "b"), "a backup cannot lie in the data folder");
  refused(run(farm, {"/bin/sh", "-c", "ulimit -f 80; exec \"$0\" \"$@\"", master_program(), "backup",
                     target.string(), "--data", (farm.folder() / "data").string()}),
          "cannot copy the store");
  // A master that is not there is no obstacle.
  const CommandResult good = backup(farm, target);
  EXPECT_EQ(good.exit_code, 0) << good.err;
  EXPECT_NE(good.out.find("1 jobs"), std::string::npos) << good.out;
  fs::remove_all(target);
  {
    std::fstream store(farm.folder() / "data" / "master.sqlite",
                       std::ios::in | std::ios::out | std::ios::binary);
    store.seekp(8192);
    store << std::string(4096, '\xff');
  }
  refused(backup(farm, target), "store");
}

}  // namespace
}  // namespace candela::farm
