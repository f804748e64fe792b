// A group of many frames, and what it costs. CANDELA_FRAMES sets their number.
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "common/wire/token.h"
#include "tests/unit/http_call.h"
#include "tests/unit/master_fixture.h"

namespace candela::master {
namespace {

class ManyFrames : public MasterTest {
 protected:
  void SetUp() override {
    http_listen = "127.0.0.1:0";
    MasterTest::SetUp();
  }
  template <class F>
  double seconds(F&& f) {
    const auto begin = std::chrono::steady_clock::now();
    f();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }
  static double resident_megabytes() {
    std::ifstream file("/proc/self/statm");
    long size = 0, resident = 0;
    file >> size >> resident;
    return static_cast<double>(resident) * static_cast<double>(::sysconf(_SC_PAGESIZE)) * 1e-6;
  }
};

// Claim: a group of many frames is one row of a folded list, all frames are in the page's list, and one call
// cancels all of them.
TEST_F(ManyFrames, AreOneRow) {
  const char* wanted = std::getenv("CANDELA_FRAMES");
  const int frames = wanted != nullptr ? std::atoi(wanted) : 200;
  ASSERT_TRUE(upload(kScene, sha256_hex(kScene), kScene.size()).ok());
  std::string group;
  const double before = resident_megabytes();
  const auto submit = [&](int from, int to) {
    for (int i = from; i < to; ++i) {
      v1::SubmitRequest request = submission(64);
      request.set_name("shot." + std::to_string(i));
      (*request.mutable_bundle()->mutable_parameters())["frame"] = std::to_string(i);
      request.set_idempotency_token("t/" + std::to_string(i));
      request.mutable_frame()->set_group_name("shot");
      request.mutable_frame()->set_group_token("t");
      request.mutable_frame()->set_frame(i);
      request.mutable_frame()->set_frames(static_cast<std::uint32_t>(frames));
      v1::SubmitResponse response;
      grpc::ClientContext context;
      const grpc::Status status = farm->Submit(&context, request, &response);
      ASSERT_TRUE(status.ok()) << status.error_message();
      group = response.group_id();
    }
  };
  const double first = seconds([&] { submit(0, frames / 2); }),
               second = seconds([&] { submit(frames / 2, frames); });
  const double memory = resident_megabytes() - before;
  const auto list = [&](bool fold) {
    v1::ListJobsRequest request;
    request.set_fold(fold);
    v1::ListJobsResponse response;
    grpc::ClientContext context;
    EXPECT_TRUE(farm->ListJobs(&context, request, &response).ok());
    return response;
  };
  v1::ListJobsResponse folded, unfolded;
  const double fold = seconds([&] { folded = list(true); }),
               unfold = seconds([&] { unfolded = list(false); });
  EXPECT_EQ(folded.groups_size(), 1);
  EXPECT_EQ(folded.jobs_size(), 0);
  EXPECT_EQ(unfolded.total(), static_cast<std::uint64_t>(frames));
  std::size_t listed = 0;
  const std::string token = *wire::read_token_file(folder.path() / "token");
  const double page = seconds([&] {
    for (std::size_t more = 1; more > 0; listed += more) {
      const std::string answer =
          test::http_call(master->http_port(), "GET /api/jobs?order=wall&offset=" + std::to_string(listed) +
                                                   " HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " +
                                                   token + "\r\n\r\n");
      more = nlohmann::json::parse(answer.substr(answer.find("\r\n\r\n"))).at("jobs").size();
    }
  });
  EXPECT_EQ(listed, static_cast<std::size_t>(frames));
  v1::SteerGroupRequest cancel;
  cancel.set_group_id(group);
  cancel.set_action(v1::SteerGroupRequest::ACTION_CANCEL);
  v1::GroupStatus cancelled;
  const double steer = seconds([&] {
    grpc::ClientContext context;
    EXPECT_TRUE(farm->SteerGroup(&context, cancel, &cancelled).ok());
  });
  ASSERT_EQ(cancelled.states_size(), 1);
  EXPECT_EQ(cancelled.states(0).state(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(cancelled.states(0).jobs(), static_cast<std::uint32_t>(frames));
  std::printf(
      "%d frames: submitted in %.2f s (halves %.2f and %.2f), folded list %.1f ms, list %.1f ms, list of the "
      "page "
      "%.1f ms, cancelled in %.1f ms, %.1f MB\n",
      frames, first + second, first, second, 1e3 * fold, 1e3 * unfold, 1e3 * page, 1e3 * steer, memory);
}

}  // namespace
}  // namespace candela::master
