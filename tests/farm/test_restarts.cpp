// A master that is killed and started again, as scripts meet it that go on at once: commands, and clients
// whose connection is the old master's.
#include <fmt/format.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <functional>
#include <thread>

#include "client/farm_client.h"
#include "common/job/job.h"
#include "tests/farm/farm.h"
#include "tests/farm/shifted_clock.h"
#include "tests/token_channel.h"

namespace candela::farm {
namespace {

class Restarts : public testing::Test {
 protected:
  void SetUp() override {
    farm_.start_master({"--checkpoint-interval", "0.1"});
    Process& worker = farm_.start_worker("one");
    id_ = farm_.submit(4);
    farm_.wait_for(id_, v1::JOB_STATE_DONE);
    farm_.forget_worker(worker);
  }
  void restart() {
    farm_.kill_master();
    farm_.restart_master();
  }
  Farm farm_;
  std::string id_;
};

// Claim: commands that are started as soon as the master says that it listens succeed, and so do those that
// are started before it does.
TEST_F(Restarts, CommandsAtOnceSucceed) {
  for (int i = 0; i < 4; ++i) {
    restart();
    const CommandResult shown = farm_.candela_process({"show", id_});
    EXPECT_EQ(shown.exit_code, 0) << shown.err;
    farm_.kill_master();
    const auto listing = farm_.start_candela({"list"}, "early");
    farm_.restart_master();
    EXPECT_EQ(listing->wait(30).value_or(-1), 0) << listing->err();
  }
}

// Claim: a master serves its first connections: calls over new ones that come as soon as it says that it
// listens are answered, none of them repeated.
TEST_F(Restarts, FirstConnectionsAreServed) {
  for (int i = 0; i < 4; ++i) {
    restart();
    for (int k = 0; k < 8; ++k) {
      grpc::ChannelArguments arguments;
      arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
      const auto stub =
          v1::FarmService::NewStub(test::token_channel_by_environment(farm_.address(), arguments));
      grpc::ClientContext context;
      context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
      v1::GetServerInfoResponse info;
      const grpc::Status status = stub->GetServerInfo(&context, {}, &info);
      EXPECT_TRUE(status.ok()) << "restart " << i << ", connection " << k << ": " << status.error_message();
    }
  }
}

// Claim: each call of a client that had a connection to the master before it died succeeds as soon as the
// next one listens: those that may be repeated are, and those that may not find the master first.
TEST_F(Restarts, EachCallSurvivesAStaleConnection) {
  client::ConnectionOptions connection;
  connection.master = farm_.address();
  connection.token_file = farm_.token_file();
  auto made = client::FarmClient::create(connection);
  ASSERT_TRUE(made.ok());
  client::FarmClient& client = **made;
  const auto told = [](const auto& result) {
    return result.ok() ? std::string() : result.error().to_string();
  };
  int reports = 0;
  const std::vector<std::pair<const char*, std::function<std::string()>>> calls = {
      {"check_server", [&] { return told(client.check_server()); }},
      {"find_missing", [&] { return told(client.find_missing({std::string(64, '0')})); }},
      {"list_jobs", [&] { return told(client.list_jobs({})); }},
      {"get_job", [&] { return told(client.get_job(id_)); }},
      {"repair_job", [&] { return told(client.repair_job(id_)); }},
      {"verify_jobs",
       [&] { return told(client.verify_jobs(id_, [&](const v1::JobReport&) { ++reports; })); }},
      {"list_events", [&] { return told(client.list_events(id_, 10)); }},
      {"list_workers", [&] { return told(client.list_workers()); }},
      {"fetch_image", [&] { return told(client.fetch_image(id_, {})); }},
      {"watch_job", [&] { return told(client.watch_job(id_, 100, {}, nullptr)); }},
      {"extend_job",
       [&] {
         v1::ExtendJobRequest request;
         request.set_job_id(id_);
         request.set_add_iterations(2);
         return told(client.extend_job(request));
       }},
      {"pause_job", [&] { return told(client.pause_job(id_)); }},
      {"set_priority", [&] { return told(client.set_priority(id_, 3)); }},
      {"resume_job", [&] { return told(client.resume_job(id_)); }},
      {"cancel_job", [&] { return told(client.cancel_job(id_)); }},
  };
  for (const auto& [name, call] : calls) {
    ASSERT_EQ(told(client.check_server()), "");  // there is a connection
    restart();
    EXPECT_EQ(call(), "") << name;
  }
  EXPECT_EQ(reports, 1);
  EXPECT_EQ(farm_.job(id_).stop().iterations(), 6U) << "the extension was made once";
}

// Claim: a worker whose wall clock was set back by an hour, or forward by a year, finds a master that is
// started again, within seconds.
TEST(Clocks, ThatAreSetKeepNoWorkerAway) {
  Farm farm;
  const ShiftedClock clock(farm);
  farm.start_master();
  farm.start_worker("one");
  const auto is_there = [&] { return farm.worker("one").state() == "idle"; };
  ASSERT_TRUE(eventually(kPatienceSeconds, is_there));
  for (const std::int64_t seconds : {-3600, 31'536'000}) {
    clock.set(seconds);
    farm.kill_master();
    farm.restart_master();
    ASSERT_TRUE(eventually(120, is_there)) << seconds;
  }
}

// Claim: a violated invariant of the scheduler in a real master is seen by the farm that it belongs to.
TEST(Violations, AreSeenInRealMasters) {
  Farm farm;
  farm.add_environment("CANDELA_PLANT_VIOLATION", "1");
  farm.start_master({"--unit-time", "0.05"});
  farm.start_worker("one");
  farm.submit(16);
  ASSERT_TRUE(eventually(kPatienceSeconds, [&] { return !farm.violations().empty(); }));
  EXPECT_NE(farm.violations().front().find("lease-worker: "), std::string::npos) << farm.violations().front();
}

}  // namespace
}  // namespace candela::farm
