// The client before masters that are overloaded, or pass on names that people made to deceive.
#include <fmt/format.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <sstream>

#include "candela/v1/client.grpc.pb.h"
#include "client/embedded/app.h"
#include "common/base/text.h"
#include "common/base/version.h"
#include "common/job/job.h"
#include "common/wire/wire.h"
#include "tests/unit/client_outcome.h"

namespace candela::client {
namespace {

const char* const kEvil = "a\n\x1b[31mFAKE\u202etxt.exe\u200b\u009b";

class FakeFarm final : public v1::FarmService::Service {
 public:
  FakeFarm() {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  ~FakeFarm() override { server_->Shutdown(std::chrono::system_clock::now()); }

  Outcome run(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"--master", fmt::format("127.0.0.1:{}", port_), "--timeout", "500ms"});
    return run_candela(arguments);
  }

  grpc::Status GetServerInfo(grpc::ServerContext*, const v1::GetServerInfoRequest*,
                             v1::GetServerInfoResponse* response) override {
    response->set_protocol(kProtocol);
    return answer;
  }
  grpc::Status ListJobs(grpc::ServerContext*, const v1::ListJobsRequest*,
                        v1::ListJobsResponse* response) override {
    *response->add_jobs() = evil_job();
    return grpc::Status::OK;
  }
  grpc::Status GetJob(grpc::ServerContext*, const v1::GetJobRequest*, v1::JobStatus* response) override {
    *response = evil_job();
    return grpc::Status::OK;
  }
  grpc::Status ListWorkers(grpc::ServerContext*, const v1::ListWorkersRequest*,
                           v1::ListWorkersResponse* response) override {
    v1::WorkerStatus& w = *response->add_workers();
    for (std::string* text :
         {w.mutable_id(), w.mutable_name(), w.mutable_host(), w.mutable_state(), w.mutable_message()})
      *text = kEvil;
    return grpc::Status::OK;
  }
  grpc::Status ListEvents(grpc::ServerContext*, const v1::ListEventsRequest*,
                          v1::ListEventsResponse* response) override {
    v1::Event& e = *response->add_events();
    for (std::string* text :
         {e.mutable_job_id(), e.mutable_worker_id(), e.mutable_kind(), e.mutable_message()})
      *text = kEvil;
    return grpc::Status::OK;
  }
  grpc::Status CancelJob(grpc::ServerContext*, const v1::JobRequest*, v1::JobStatus*) override {
    return {grpc::StatusCode::FAILED_PRECONDITION, kEvil};
  }

  // An extension is made, and its answer lost, so often; then it is answered.
  grpc::Status ExtendJob(grpc::ServerContext*, const v1::ExtendJobRequest* request,
                         v1::JobStatus* response) override {
    tokens.push_back(request->idempotency_token());
    if (tokens.size() <= lost_answers) return lost_answer;
    response->set_id(request->job_id());
    return grpc::Status::OK;
  }

  grpc::Status answer;
  std::size_t lost_answers = 0;
  grpc::Status lost_answer{grpc::StatusCode::UNAVAILABLE, "gone"};
  std::vector<std::string> tokens;

 private:
  static v1::JobStatus evil_job() {
    v1::JobStatus job;
    for (std::string* text : {job.mutable_id(), job.mutable_name(), job.mutable_message(),
                              job.mutable_bundle_sha256(), job.mutable_settings()->mutable_integrator(),
                              job.add_layers(), job.add_rejected()->mutable_cause()})
      *text = kEvil;
    job.mutable_rejected(0)->set_count(1);
    (*job.mutable_settings()->mutable_integrator_settings())[kEvil] = kEvil;
    return job;
  }
  std::unique_ptr<grpc::Server> server_;
  int port_ = 0;
};

struct Overload {
  const char* name;
  grpc::Status status;
};
class OverloadTest : public testing::TestWithParam<Overload> {};

// Claim: a master that has no room or time for a call is exit code 3 (try again), in one line that names it.
TEST_P(OverloadTest, IsCodeThree) {
  FakeFarm farm;
  farm.answer = GetParam().status;
  const auto r = farm.run({"list"});
  EXPECT_EQ(r.code, 3) << r.err;
  EXPECT_NE(r.err.find("the master at 127.0.0.1:"), std::string::npos) << r.err;
  EXPECT_EQ(r.err.find('\n'), r.err.size() - 1) << r.err;
}
INSTANTIATE_TEST_SUITE_P(
    , OverloadTest,
    testing::Values(Overload{"NoThreads", {grpc::StatusCode::RESOURCE_EXHAUSTED, ""}},
                    Overload{"TooMany", wire::to_status_with_retry(resource_error("too many watchers"), 100)},
                    Overload{"Stopping", {grpc::StatusCode::UNAVAILABLE, "the master is stopping"}},
                    Overload{"Late", {grpc::StatusCode::DEADLINE_EXCEEDED, ""}}),
    [](const auto& one) { return std::string(one.param.name); });

// Claim: an extension whose answer was lost is asked for again with the token of the first call; where no
// answer comes it is no exit code 3, which says that a repeated command does no harm; one that the master
// refused for want of room is.
TEST(ExtendTest, IsNeverCodeThreeOnceItMayBeMade) {
  FakeFarm farm;
  farm.lost_answers = 1;
  const auto once = farm.run({"extend", "j", "--iterations", "+5"});
  EXPECT_EQ(once.code, 0) << once.err;
  ASSERT_EQ(farm.tokens.size(), 2U);
  EXPECT_FALSE(farm.tokens[0].empty());
  EXPECT_EQ(farm.tokens[0], farm.tokens[1]);
  farm.lost_answers = 1'000'000;
  const auto never = farm.run({"extend", "j", "--iterations", "+5"});
  EXPECT_EQ(never.code, 1) << never.err;
  EXPECT_NE(never.err.find("may or may not be extended"), std::string::npos) << never.err;
  EXPECT_NE(farm.tokens.back(), farm.tokens.front()) << "another command is another extension";
  farm.lost_answer = {grpc::StatusCode::RESOURCE_EXHAUSTED, "the disk is full"};
  EXPECT_EQ(farm.run({"extend", "j", "--iterations", "+5"}).code, 3);
}

class EvilNamesTest : public testing::TestWithParam<std::vector<std::string>> {};

// Claim: whatever a farm tells, no output holds a character that steers a terminal, hides, or turns text
// around; names are escaped within their line.
TEST_P(EvilNamesTest, AreEscaped) {
  const FakeFarm farm;
  const auto r = farm.run(GetParam());
  const std::string all = r.out + r.err;
  EXPECT_NE(all.find("u202e"), std::string::npos) << all;
  std::istringstream lines(all);
  for (std::string line; std::getline(lines, line);) EXPECT_EQ(line, escape_unprintable(line));
  EXPECT_EQ(all.find("\n\\x1b"), std::string::npos) << "a name began a line";
}
INSTANTIATE_TEST_SUITE_P(
    , EvilNamesTest,
    testing::Values(std::vector<std::string>{"list"}, std::vector<std::string>{"show", "j"},
                    std::vector<std::string>{"workers"}, std::vector<std::string>{"events"},
                    std::vector<std::string>{"cancel", "j"}, std::vector<std::string>{"list", "--json"},
                    std::vector<std::string>{"show", "j", "--json"},
                    std::vector<std::string>{"workers", "--json"},
                    std::vector<std::string>{"events", "--json"}),
    [](const auto& one) { return one.param[0] + (one.param.back() == "--json" ? "_json" : ""); });

}  // namespace
}  // namespace candela::client
