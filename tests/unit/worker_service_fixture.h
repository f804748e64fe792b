// The worker service between a scripted master and a scripted renderer.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <mutex>

#include "tests/temporary_folder.h"
#include "tests/unit/worker_fakes.h"

namespace candela::worker {

class WorkerServiceTest : public testing::Test {
 protected:
  void SetUp() override {
    options_.cache_dir = folder_;
    options_.threads = 1;
    options_.name = "tester";
    tuning_.first_backoff = Milliseconds(5);
    tuning_.longest_backoff = Milliseconds(40);
    tuning_.drain_limit = Milliseconds(1500);
    tuning_.finish_within = Milliseconds(300);
  }
  void TearDown() override {
    renderer_.open_gate();
    worker_.reset();
  }
  void start() {
    auto worker = FarmWorker::start(options_, master_.channel(), fake_factory(renderer_), tuning_);
    ASSERT_TRUE(worker.ok()) << worker.error().to_string();
    worker_ = std::move(*worker);
  }
  [[nodiscard]] bool wait_until_rendering() {
    std::unique_lock lock(renderer_.mutex);
    return renderer_.changed.wait_for(lock, std::chrono::seconds(5), [&] { return renderer_.running > 0; });
  }
  std::size_t merged_count() const { return master_.merged.size(); }  // under master_.mutex

  test::TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path();
  WorkerOptions options_;
  Tuning tuning_;
  FakeMaster master_;
  FakeRendererControl renderer_;
  std::unique_ptr<Worker> worker_;
};

}  // namespace candela::worker
