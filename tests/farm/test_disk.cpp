// A full disk at a checkpoint: rendering goes on, the generation before serves, and nothing is lost once
// there is room again.
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <fstream>

#include "tests/farm/farm.h"
#include "tests/farm/metrics_page.h"

namespace candela::farm {
namespace {

// A small file system of its own under the master's data folder.
class SmallDisk {
 public:
  explicit SmallDisk(std::filesystem::path path) : path_(std::move(path)) {
    std::filesystem::create_directories(path_);
    mounted_ = ::mount("tmpfs", path_.c_str(), "tmpfs", MS_NOSUID | MS_NODEV, "size=24m") == 0;
  }
  ~SmallDisk() {
    if (mounted_) ::umount2(path_.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  bool mounted() const { return mounted_; }
  void fill() {
    std::ofstream filler(path_ / "filler", std::ios::binary);
    const std::string block(4096, 'x');
    while (filler.write(block.data(), static_cast<std::streamsize>(block.size())).flush()) {
    }
  }
  void make_room() { std::filesystem::remove(path_ / "filler"); }

 private:
  std::filesystem::path path_;
  bool mounted_ = false;
};

// Without the right to mount: the master may write no file beyond a few bytes, which fails with an error too.
void limit_files(Process& master, bool limited) {
  rlimit limit{};
  ASSERT_EQ(::prlimit(master.pid(), RLIMIT_FSIZE, nullptr, &limit), 0);
  limit.rlim_cur = limited ? 512 : limit.rlim_max;
  ASSERT_EQ(::prlimit(master.pid(), RLIMIT_FSIZE, &limit, nullptr), 0);
}

// Claim: see the top of the file. `by_limit`: the file size limit instead of a full file system.
void full_disk(bool by_limit) {
  constexpr std::uint64_t iterations = 1201;  // the store's spare room holds some checkpoints more
  Farm farm;
  SmallDisk disk(farm.folder() / "data");
  if (!by_limit && !disk.mounted())
    GTEST_SKIP() << "this user may not mount a file system; the file size limit's case runs";
  const auto spoil = [&] { by_limit ? limit_files(farm.master(), true) : disk.fill(); };
  const auto mend = [&] { by_limit ? limit_files(farm.master(), false) : disk.make_room(); };

  farm.start_master(
      {"--unit-time", "0.1", "--checkpoint-interval", "0.1", "--lease-time", "2", "--http", "127.0.0.1:0"});
  const std::string http = farm.master().wait_for_line("http on ", 10);
  Process& worker = farm.start_worker("one");
  const std::string id = farm.submit(iterations);
  ASSERT_TRUE(eventually(kPatienceSeconds, [&] { return farm.job(id).checkpoint_generation() > 0; }));
  {
    const Asleep one(worker);
    spoil();
  }
  // Some checkpoint after this moment fails; those under way may still come through. On a busy machine more
  // than a second may pass before one is tried.
  ASSERT_TRUE(eventually(30, [&] {
    spoil();  // the store has given up its own spare room meanwhile
    return metric(http_get(http, "/metrics"), "candela_checkpoint_failures_total") > 0;
  })) << "no checkpoint fails on a full disk: the test is none";
  std::uint64_t generation = 0;
  Stopwatch unchanged;
  ASSERT_TRUE(eventually(30, [&] {
    spoil();
    const v1::JobStatus status = farm.job(id);
    if (status.checkpoint_generation() != generation) unchanged = Stopwatch();
    generation = status.checkpoint_generation();
    return unchanged.seconds() > 1;
  })) << "checkpoints come through on a full disk: the test is none";
  const v1::JobStatus full = farm.job(id);
  EXPECT_NE(full.state(), v1::JOB_STATE_FAILED) << full.message();
  EXPECT_NE(full.state(), v1::JOB_STATE_DONE) << "a job is not done before its last checkpoint is on disk";
  EXPECT_FALSE(full.message().empty()) << "the status says nothing of the full disk";
  farm.fetch(id);  // the preview needs no disk

  // The crash in that condition: the generation before serves.
  {
    const Asleep one(worker);  // no checkpoint has its work before the disk is full again
    farm.kill_master();
    if (!by_limit) disk.make_room();
    farm.restart_master();
    const v1::JobStatus after = farm.job(id);
    EXPECT_GE(after.iterations(), 1U) << "the previous generation does not serve";
    EXPECT_GE(after.checkpoint_generation(), 1U);
    farm.audit(id, iterations, false);
    spoil();
  }
  ASSERT_TRUE(eventually(20, [&] {
    spoil();
    return !farm.job(id).message().empty();
  })) << "no word of the full disk";
  mend();
  farm.wait_for(id, v1::JOB_STATE_DONE);
  expect_identical(farm.fetch(id), farm.render(iterations), "after a full disk");
  farm.audit(id, iterations);
}

TEST(FullDisk, FileSystem) {
  full_disk(false);
}
TEST(FullDisk, FileSizeLimit) {
  full_disk(true);
}

// Claim: what people decide while the disk is full is kept: a job that is cancelled then is cancelled after a
// crash too, though the disk stays full until then.
TEST(FullDisk, CancelHolds) {
  Farm farm;
  SmallDisk disk(farm.folder() / "data");
  if (!disk.mounted()) GTEST_SKIP() << "this user may not mount a file system";
  farm.start_master({"--checkpoint-interval", "0.1"});
  const std::string id = farm.submit(1000), other = farm.submit(1000);
  farm.events(id);  // the store has all of it
  disk.fill();
  for (int i = 0; i < 30; ++i) farm.candela({"priority", other, std::to_string(i)});  // uses up what is left
  const CommandResult cancelled = farm.candela({"cancel", id});
  EXPECT_EQ(cancelled.exit_code, 0) << cancelled.err;
  EXPECT_NE(cancelled.err.find("is cancelled"), std::string::npos) << cancelled.err;
  farm.kill_master();
  disk.make_room();
  farm.restart_master();
  EXPECT_EQ(farm.job(id).state(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(farm.job(other).state(), v1::JOB_STATE_QUEUED);
}

}  // namespace
}  // namespace candela::farm
