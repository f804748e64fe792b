// The worker service and what it fetches and keeps: blobs that are wrong, missing or cut short, caches,
// disks.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/unit/worker_service_fixture.h"

namespace candela::worker {
namespace {

namespace fs = std::filesystem;
using grpc::Status;
using grpc::StatusCode;

// Claim: a blob with other bytes than its name says never reaches the renderer: they changed on the way.
TEST_F(WorkerServiceTest, WrongBlobIsRefused) {
  master_.wrong_blob_bytes = true;
  master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return master_.failures.size() == 1; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.failures[0].cause(), v1::FAILURE_CAUSE_NETWORK);
  EXPECT_NE(master_.failures[0].message().find(sha256_hex("the texture")), std::string::npos);
  EXPECT_EQ(renderer_.created, 0);
}

// Claim: a blob or bundle that the master does not have is the master's trouble, told in its words; the
// worker says with its request how large the blob must be.
TEST_F(WorkerServiceTest, WhatTheMasterLacksIsItsOwnTrouble) {
  master_.blob_script = {Status(StatusCode::DATA_LOSS, "'a.bin' is damaged: submit the scene again")};
  master_.add_lease(0, 1);
  master_.add_lease(1, 2);
  master_.leases.back().set_bundle_sha256(sha256_hex("another bundle"));
  start();
  ASSERT_TRUE(master_.wait_for([&] { return master_.failures.size() == 2; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.failures[0].cause(), v1::FAILURE_CAUSE_MASTER);
  EXPECT_NE(master_.failures[0].message().find("submit the scene again"), std::string::npos);
  EXPECT_EQ(master_.failures[1].cause(), v1::FAILURE_CAUSE_MASTER);
  EXPECT_EQ(master_.fetched_size, 11U);
}

// Claim: errors of the renderer that are the machine's (a full scratch disk) are by cause place, and a cache
// that cannot be written is, too. With the folder mended the next unit is rendered.
TEST_F(WorkerServiceTest, DisksAreThePlace) {
  renderer_.create_error = resource_error("cannot create a scratch file for textures");
  master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return master_.failures.size() == 1; }));
  {
    const std::lock_guard lock(renderer_.mutex);
    renderer_.create_error.reset();
  }
  fs::remove_all(folder_);
  std::ofstream(folder_) << "a file where the folder was";
  master_.add_lease(0, 1);
  ASSERT_TRUE(master_.wait_for([&] { return master_.failures.size() == 2; }));
  fs::remove(folder_);
  master_.add_lease(0, 1);
  EXPECT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.failures[0].cause(), v1::FAILURE_CAUSE_PLACE);
  EXPECT_EQ(master_.failures[1].cause(), v1::FAILURE_CAUSE_PLACE);
  EXPECT_NE(master_.failures[1].message().find(folder_.string()), std::string::npos);
}

// Claim: a blob transfer that breaks off in the middle is taken up again where it was, and the bytes are
// right.
TEST_F(WorkerServiceTest, BrokenBlobTransferIsResumed) {
  master_.blob_script = {Status(StatusCode::UNAVAILABLE, "broken"),
                         Status(StatusCode::UNAVAILABLE, "broken")};
  master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 1; }));
  EXPECT_EQ(master_.blob_fetches, 4);
  ASSERT_EQ(master_.blob_offsets.size(), 4U);
  EXPECT_GT(master_.blob_offsets[1], 0U);
  EXPECT_GT(master_.blob_offsets[2], master_.blob_offsets[1]) << "it goes on from the byte it has";
  EXPECT_EQ(renderer_.files["../textures/a.bin"], "the texture");
}

// Claim: a cache too small for the scene fails the unit with the mend, and does not crash or hang.
TEST_F(WorkerServiceTest, CacheTooSmallFailsTheUnit) {
  options_.cache_limit_bytes = 15;
  master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return master_.failures.size() == 1; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_EQ(master_.failures[0].cause(), v1::FAILURE_CAUSE_PLACE);
  EXPECT_NE(master_.failures[0].message().find("--cache-size"), std::string::npos);
}

// Claim: a lease that cannot be understood fails its unit by field and harms nothing else.
TEST_F(WorkerServiceTest, MalformedLeaseFailsTheUnit) {
  master_.add_lease(0, 1);
  master_.leases.front().mutable_settings()->set_width(0);
  master_.add_lease(0, 1);
  master_.leases.back().clear_named_state();
  master_.add_lease(0, 1);
  start();
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == 1 && master_.failures.size() == 2; }));
  const std::lock_guard lock(master_.mutex);
  EXPECT_NE(master_.failures[0].message().find("settings.width"), std::string::npos);
  EXPECT_NE(master_.failures[1].message().find("named_state"), std::string::npos);
}

// Claim: jobs of other settings have scenes of their own, and only so many are kept.
TEST_F(WorkerServiceTest, ScenesAreKeptUpToALimit) {
  tuning_.max_scenes = 2;
  const std::vector<std::uint32_t> widths = {40, 41, 40,
                                             42, 40, 41};  // 41 was evicted by 42: 40 was used later
  for (std::size_t i = 0; i < widths.size(); ++i) {
    master_.add_lease(i, i + 1);
    master_.leases.back().mutable_settings()->set_width(widths[i]);
  }
  start();
  ASSERT_TRUE(master_.wait_for([&] { return merged_count() == widths.size(); }));
  EXPECT_EQ(renderer_.created, 4);
  EXPECT_EQ(master_.blob_fetches, 2) << "blobs are fetched once for all";
}

}  // namespace
}  // namespace candela::worker
