// Trouble of a place, a line or a program: the job waits and says so, and once
// the trouble is gone it ends as if there had been none.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "common/base/files.h"
#include "common/base/hash.h"
#include "tests/farm/farm.h"
#include "tests/farm/hand_worker.h"

namespace candela::farm {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kFewIterations = 60;
const std::vector<std::string> kMasterOptions{"--unit-time", "0.1",          "--checkpoint-interval",
                                              "0.2",         "--lease-time", "2"};

// The process may write no file beyond so many bytes: a full disk, as far as it can see.
void limit_cache_files(const Process& process, bool limited) {
  rlimit limit{};
  ASSERT_EQ(::prlimit(process.pid(), RLIMIT_FSIZE, nullptr, &limit), 0);
  limit.rlim_cur = limited ? 256 : limit.rlim_max;
  ASSERT_EQ(::prlimit(process.pid(), RLIMIT_FSIZE, &limit, nullptr), 0);
}

bool told(Farm& farm, const std::string& id, const std::string& kind) {
  const auto events = farm.events(id);
  return std::any_of(events.begin(), events.end(), [&](const v1::Event& e) { return e.kind() == kind; });
}

// Claim: a full cache disk of the only worker holds its job up and never fails it; `show` and `workers` say
// which worker, what is wrong and what to do. With room again, `resume` goes on at once, to the same image.
TEST(Failures, AFullCacheDisk) {
  Farm farm;
  farm.start_master(kMasterOptions);
  Process& worker = farm.start_worker("narrow");
  ASSERT_TRUE(eventually(30, [&] { return farm.workers().size() == 1; }));
  limit_cache_files(worker, true);
  const std::string id = farm.submit(kFewIterations);
  ASSERT_TRUE(eventually(60, [&] {
    const auto status = farm.job(id);
    return status.failures_size() > 0 && status.failures(0).count() >= 3;
  }));
  const v1::JobStatus waits = farm.job(id);
  EXPECT_NE(waits.state(), v1::JOB_STATE_FAILED) << waits.message();
  EXPECT_EQ(waits.waiting().cause(), v1::FAILURE_CAUSE_PLACE);
  const std::string shown = farm.candela({"show", id}).out;
  for (const char* part : {"place trouble on worker narrow", "File too large", "free space"})
    EXPECT_NE(shown.find(part), std::string::npos) << shown;
  EXPECT_NE(farm.candela({"workers"}).out.find("place: "), std::string::npos);
  EXPECT_TRUE(told(farm, id, "waiting"));
  limit_cache_files(worker, false);
  // On a busy machine the worker may try again by itself and be done before the command arrives.
  EXPECT_TRUE(farm.candela({"resume", id}).exit_code == 0 || farm.job(id).state() == v1::JOB_STATE_DONE);
  farm.wait_for(id, v1::JOB_STATE_DONE, 30);
  expect_identical(farm.fetch(id), farm.render(kFewIterations), "after a full cache disk");
  farm.audit(id, kFewIterations);
}

// Claim: a scene file that rots on the master's disk holds the job up, is named, and is mended by submitting
// the scene again; both jobs end.
TEST(Failures, ARottenSceneFile) {
  Farm farm;
  farm.start_master_here(kMasterOptions);
  const std::string id = farm.submit(kFewIterations);
  std::size_t spoilt = 0;
  for (const auto& e : fs::recursive_directory_iterator(farm.folder() / "data" / "blobs"))
    if (e.is_regular_file()) {
      std::fstream(e.path(), std::ios::in | std::ios::out | std::ios::binary).seekp(10).put('#');
      ++spoilt;
    }
  ASSERT_GT(spoilt, 0U);
  farm.start_worker_here("one");
  ASSERT_TRUE(eventually(30, [&] { return told(farm, id, "blob-damaged"); }));
  ASSERT_TRUE(eventually(30, [&] {
    return farm.job(id).message().find("submit the scene again") != std::string::npos;
  })) << farm.job(id).message();
  EXPECT_EQ(farm.worker("one").units_failed(), 0U);
  for (int i = 0; i < 3; ++i) {  // a scene may have several files: each is missed when it is read
    if (farm.job(id).message().find("submit the scene again") == std::string::npos) break;
    const std::string again = farm.submit(kFewIterations, "cornell", {}, 8);
    eventually(5, [&] { return farm.job(again).state() == v1::JOB_STATE_DONE; });
  }
  farm.wait_for(id, v1::JOB_STATE_DONE);
  expect_identical(farm.fetch(id), farm.render(kFewIterations), "after rot");
}

// Claim: a worker whose cache somebody removes renders the next job as if nothing had been.
TEST(Failures, ARemovedCache) {
  Farm farm;
  farm.start_master_here(kMasterOptions);
  farm.start_worker_here("one");
  farm.wait_for(farm.submit(4), v1::JOB_STATE_DONE);
  fs::remove_all(farm.folder() / "cache-one");
  const std::string id = farm.submit(kFewIterations, "furnace");
  farm.wait_for(id, v1::JOB_STATE_DONE);
  EXPECT_EQ(farm.job(id).failures_size(), 0);
}

// Claim: bits that flip on the way of half of all deltas cost time and nothing else.
TEST(Failures, BitsFlippedOnTheWay) {
  Farm farm;
  farm.start_master_here(kMasterOptions);
  const std::string id = farm.submit(12);
  HandWorker worker(farm.address(), "noisy");
  worker.scene_file_for_pilots = scene_path("cornell");
  for (int i = 0; i < 60 && farm.job(id).iterations() < 12; ++i) {
    const v1::Lease lease = worker.acquire();
    Push push = worker.delta_for(lease, scene_path("cornell"));
    if (i % 2 == 0) {
      push.bytes[push.bytes.size() / 2] ^= 4;
      EXPECT_EQ(worker.push(push).verdict(), v1::DELTA_VERDICT_CORRUPT);
      EXPECT_EQ(farm.job(id).waiting().cause(), v1::FAILURE_CAUSE_NETWORK);
    } else {
      EXPECT_EQ(worker.push(push).verdict(), v1::DELTA_VERDICT_MERGED);
    }
  }
  farm.wait_for(id, v1::JOB_STATE_DONE);
  expect_identical(farm.fetch(id), farm.render(12), "over a noisy line");
  farm.audit(id, 12);
}

}  // namespace
}  // namespace candela::farm
