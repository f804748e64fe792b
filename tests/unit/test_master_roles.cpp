// Who may call what of a master that listens: by its token without TLS, by certificates with it.
#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <grpcpp/generic/generic_stub.h>
#include <sys/stat.h>

#include <fstream>
#include <map>
#include <set>

#include "common/wire/authority.h"
#include "common/wire/token.h"
#include "master/api/access.h"
#include "tests/token_channel.h"
#include "tests/unit/master_fixture.h"

namespace candela::master {
namespace {

namespace fs = std::filesystem;
using wire::Role;
using wire::Roles;

constexpr grpc::StatusCode kDenied = grpc::StatusCode::PERMISSION_DENIED;

// Every call of the protocol: "FarmService/Submit".
std::set<std::string> calls_of_the_protocol() {
  std::set<std::string> calls;
  const auto* pool = google::protobuf::DescriptorPool::generated_pool();
  for (const char* name : {"candela.v1.FarmService", "candela.v1.WorkerService"}) {
    const auto* service = pool->FindServiceByName(name);
    EXPECT_NE(service, nullptr) << name;
    for (int i = 0; service != nullptr && i < service->method_count(); ++i)
      calls.insert(service->name() + "/" + service->method(i)->name());
  }
  return calls;
}

// The call with one empty request; what the master answers.
grpc::Status call_empty(const std::shared_ptr<grpc::Channel>& channel, const std::string& call) {
  grpc::GenericStub stub(channel);
  grpc::CompletionQueue queue;
  grpc::ClientContext context;
  context.set_wait_for_ready(true);
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  const auto wait = [&] {
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  };
  const auto stream = stub.PrepareCall(&context, "/candela.v1." + call, &queue);
  stream->StartCall(nullptr);
  if (wait()) {
    const grpc::Slice nothing("");
    stream->WriteLast(grpc::ByteBuffer(&nothing, 1), {}, nullptr);
    wait();
    grpc::ByteBuffer answer;
    do stream->Read(&answer, nullptr);
    while (wait());
  }
  grpc::Status status;
  stream->Finish(&status, nullptr);
  wait();
  queue.Shutdown();
  wait();
  return status;
}

class RolesTest : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(log::initialise("test", "off", "text").ok()); }
  void start(MasterOptions o = {}) {
    o.data_dir = folder_.path() / "data";
    o.listen = "127.0.0.1:0";
    o.checkpoint_seconds = 0.05;
    master_.reset();
    auto started = Master::start(o);
    ASSERT_TRUE(started.ok()) << started.error().to_string();
    master_ = std::move(*started);
  }
  std::string address() const { return fmt::format("127.0.0.1:{}", master_->port()); }

  test::TemporaryFolder folder_;
  std::unique_ptr<Master> master_;
};

// Claim: the table has each call of the protocol, and no other.
TEST(AccessTable, HasEachCall) {
  std::set<std::string> listed;
  for (const Rule& rule : rules()) EXPECT_TRUE(listed.insert(std::string(rule.method)).second) << rule.method;
  EXPECT_EQ(listed, calls_of_the_protocol());
  EXPECT_EQ(rule_of("FarmService/Nothing"), nullptr);
}

// Claim: without TLS no call of the protocol gets past the door without the master's token, and each refusal
// names the role that is missing and the token's file. With the token each call is heard, and so it is
// in this process.
TEST_F(RolesTest, WithoutTheTokenNothing) {
  start();
  const fs::path token = folder_.path() / "data" / "token";
  EXPECT_EQ(fs::status(token).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  std::ofstream(folder_.path() / "wrong") << std::string(64, 'a');
  ASSERT_EQ(::chmod((folder_.path() / "wrong").c_str(), 0600), 0);
  const auto dial = [&](const fs::path& file) {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    return wire::token_channel(address(), grpc::InsecureChannelCredentials(), arguments, file);
  };
  const auto right = dial(token), wrong = dial(folder_.path() / "wrong"), none = dial("");
  for (const std::string& call : calls_of_the_protocol()) {
    for (const auto& stranger : {wrong, none}) {
      const grpc::Status refused = call_empty(stranger, call);
      EXPECT_EQ(refused.error_code(), kDenied) << call << ": " << refused.error_message();
      const std::string role =
          fmt::format("role '{}' is missing", wire::name(rule_of(call) ? rule_of(call)->role : Role::read));
      EXPECT_NE(refused.error_message().find(role), std::string::npos) << call << refused.error_message();
      EXPECT_NE(refused.error_message().find(token.string()), std::string::npos) << refused.error_message();
    }
    EXPECT_NE(call_empty(right, call).error_code(), kDenied) << call;
    EXPECT_NE(call_empty(master_->in_process_channel(), call).error_code(), kDenied) << call;
  }
}

// Claim: the token stays over a restart, so that programs that run on go on; another one in its file counts
// from the next start.
TEST_F(RolesTest, TheTokenStays) {
  start();
  const fs::path file = folder_.path() / "data" / "token";
  const std::string first = *wire::read_token_file(file);
  start();
  EXPECT_EQ(*wire::read_token_file(file), first);
  std::ofstream(file) << "another-token-of-mine";
  start();
  const auto farm = v1::FarmService::NewStub(test::token_channel(address(), folder_.path() / "data"));
  grpc::ClientContext context;
  v1::ListJobsResponse jobs;
  EXPECT_TRUE(farm->ListJobs(&context, {}, &jobs).ok());
}

class CertificatesTest : public RolesTest {
 protected:
  void SetUp() override {
    RolesTest::SetUp();
    auto made = wire::Authority::make(tls(), "farm");
    ASSERT_TRUE(made.ok()) << made.error().to_string();
    authority_ = std::make_unique<wire::Authority>(std::move(*made));
    ASSERT_TRUE(authority_->sign({"master", {"127.0.0.1", "localhost"}, {}}).ok());
    MasterOptions o;
    o.tls_cert = (tls() / "master.pem").string();
    o.tls_key = (tls() / "master.key").string();
    o.tls_ca = (tls() / "ca.pem").string();
    start(o);
  }
  fs::path tls() const { return folder_.path() / "tls"; }
  std::shared_ptr<grpc::Channel> dial(const std::string& name, Roles roles) {
    EXPECT_TRUE(authority_->sign({name, {}, roles}).ok());
    const auto text = [&](const std::string& file) { return *read_file(tls() / file, 1 << 20); };
    grpc::SslCredentialsOptions ssl;
    ssl.pem_root_certs = text("ca.pem");
    ssl.pem_private_key = text(name + ".key");
    ssl.pem_cert_chain = text(name + ".pem");
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    return grpc::CreateCustomChannel(address(), grpc::SslCredentials(ssl), arguments);
  }
  std::unique_ptr<v1::FarmService::Stub> farm(const std::string& name, Roles roles) {
    return v1::FarmService::NewStub(dial(name, roles));
  }
  static std::string submit(v1::FarmService::Stub& farm) {
    JobSettings settings;
    settings.width = kWidth;
    settings.height = kHeight;
    v1::SubmitRequest request = test::submission(kScene, settings, 8);
    request.set_submitter("somebody-else");
    return test::submit(farm, kScene, request);
  }
  using JobCall = grpc::Status (v1::FarmService::Stub::*)(grpc::ClientContext*, const v1::JobRequest&,
                                                          v1::JobStatus*);
  static grpc::Status steer(v1::FarmService::Stub& farm, JobCall call, const std::string& id) {
    v1::JobRequest request;
    request.set_job_id(id);
    v1::JobStatus out;
    grpc::ClientContext context;
    return (farm.*call)(&context, request, &out);
  }

  std::unique_ptr<wire::Authority> authority_;
};

// Claim: a group is steered by who submitted it, and by operators, as a job is; a token means another group
// for another submitter, so that nobody's frames come into somebody else's.
TEST_F(CertificatesTest, GroupsAreTheirSubmitters) {
  const auto ann = farm("ann", {Role::submit}), bob = farm("bob", {Role::submit}),
             op = farm("op", {Role::operate});
  const auto submit_frame = [&](v1::FarmService::Stub& stub) {
    JobSettings settings;
    settings.width = kWidth;
    settings.height = kHeight;
    v1::SubmitRequest request = test::submission(kScene, settings, 8);
    request.mutable_frame()->set_group_name("shot");
    request.mutable_frame()->set_group_token("token");
    v1::SubmitResponse response;
    grpc::ClientContext context;
    EXPECT_TRUE(test::upload(stub, kScene, sha256_hex(kScene), kScene.size()).ok());
    EXPECT_TRUE(stub.Submit(&context, request, &response).ok());
    return response.group_id();
  };
  const auto pause = [](v1::FarmService::Stub& stub, const std::string& id) {
    v1::SteerGroupRequest request;
    request.set_group_id(id);
    request.set_action(v1::SteerGroupRequest::ACTION_PAUSE);
    v1::GroupStatus out;
    grpc::ClientContext context;
    return stub.SteerGroup(&context, request, &out).error_code();
  };
  const std::string group = submit_frame(*ann);
  EXPECT_EQ(submit_frame(*ann), group);
  EXPECT_NE(submit_frame(*bob), group);
  EXPECT_EQ(pause(*bob, group), kDenied);
  EXPECT_EQ(pause(*ann, group), grpc::StatusCode::OK);
  EXPECT_EQ(pause(*op, group), grpc::StatusCode::OK);
}

// Claim: with TLS a certificate may call what its roles allow: `read` looks; `submit` also submits and
// steers jobs; `operate` does all but a worker's work; `worker` works, sees the farm's workers, and nothing
// else. A certificate without a role may do nothing. Each refusal names role and certificate.
TEST_F(CertificatesTest, MayWhatTheirRolesAllow) {
  const std::set<std::string> read = {"FarmService/GetServerInfo", "FarmService/ListJobs",
                                      "FarmService/GetJob",        "FarmService/WatchJob",
                                      "FarmService/FetchImage",    "FarmService/ListEvents",
                                      "FarmService/ListWorkers",   "FarmService/GetLedger",
                                      "FarmService/FindJobs",      "FarmService/GetGroup"};
  std::set<std::string> submit = read, operate,
                        worker = {"FarmService/GetServerInfo", "FarmService/ListWorkers"};
  // For jobs that there are not: what a call says of others' jobs is another test.
  submit.insert({"FarmService/FindMissingBlobs", "FarmService/UploadBlob", "FarmService/Submit",
                 "FarmService/PauseJob", "FarmService/ResumeJob", "FarmService/ExtendJob",
                 "FarmService/CancelJob", "FarmService/SetPriority", "FarmService/SteerGroup"});
  for (const std::string& call : calls_of_the_protocol())
    (call.starts_with("WorkerService/") ? worker : operate).insert(call);
  const std::map<std::string, std::pair<Roles, std::set<std::string>>> expected = {
      {"nobody", {{}, {}}},
      {"reader", {{Role::read}, read}},
      {"artist", {{Role::submit}, submit}},
      {"operator", {{Role::operate}, operate}},
      {"node", {{Role::worker}, worker}}};
  for (const auto& [name, what] : expected) {
    const auto channel = dial(name, what.first);
    std::set<std::string> allowed;
    for (const std::string& call : calls_of_the_protocol()) {
      const grpc::Status status = call_empty(channel, call);
      if (status.error_code() != kDenied) {
        allowed.insert(call);
        continue;
      }
      EXPECT_NE(status.error_message().find("' is missing"), std::string::npos) << status.error_message();
      EXPECT_NE(status.error_message().find("the certificate '" + name + "'"), std::string::npos)
          << status.error_message();
    }
    EXPECT_EQ(allowed, what.second) << name;
  }
}

// Claim: a job's submitter is the name of the certificate, whatever the request says. Others with the role
// `submit` see the job and change nothing of it; its submitter and operators do.
TEST_F(CertificatesTest, OthersJobsAreForOperators) {
  const auto alice = farm("alice", {Role::submit}), bob = farm("bob", {Role::submit}),
             operators = farm("olga", {Role::operate});
  const std::string id = submit(*alice);
  EXPECT_EQ(test::show(*bob, id).submitter(), "alice");
  const std::map<const char*, JobCall> calls = {{"pause", &v1::FarmService::Stub::PauseJob},
                                                {"resume", &v1::FarmService::Stub::ResumeJob},
                                                {"repair", &v1::FarmService::Stub::RepairJob},
                                                {"cancel", &v1::FarmService::Stub::CancelJob}};
  for (const auto& [what, call] : calls) {
    const grpc::Status refused = steer(*bob, call, id);
    EXPECT_EQ(refused.error_code(), kDenied) << what;
    EXPECT_NE(refused.error_message().find("role 'operate' is missing"), std::string::npos);
    EXPECT_NE(refused.error_message().find("the job is of 'alice'"), std::string::npos)
        << refused.error_message();
  }
  v1::ExtendJobRequest more;
  more.set_job_id(id);
  more.set_add_iterations(8);
  v1::SetPriorityRequest first;
  first.set_job_id(id);
  first.set_priority(9);
  v1::JobStatus out;
  grpc::ClientContext extend, priority;
  EXPECT_EQ(bob->ExtendJob(&extend, more, &out).error_code(), kDenied);
  EXPECT_EQ(bob->SetPriority(&priority, first, &out).error_code(), kDenied);
  EXPECT_EQ(test::show(*bob, id).state(), v1::JOB_STATE_QUEUED) << "a refused call had an effect";
  EXPECT_EQ(test::show(*bob, id).priority(), 0);

  EXPECT_TRUE(steer(*alice, &v1::FarmService::Stub::PauseJob, id).ok());
  EXPECT_TRUE(steer(*operators, &v1::FarmService::Stub::ResumeJob, id).ok());
  EXPECT_TRUE(steer(*alice, &v1::FarmService::Stub::CancelJob, id).ok());
  // Calls that belong to no job are an operator's.
  EXPECT_EQ(call_empty(dial("carl", {Role::submit}), "FarmService/VerifyJobs").error_code(), kDenied);
  EXPECT_EQ(steer(*alice, &v1::FarmService::Stub::RepairJob, "jnone").error_code(), kDenied);
  EXPECT_EQ(steer(*alice, &v1::FarmService::Stub::CancelJob, "jnone").error_code(),
            grpc::StatusCode::NOT_FOUND);
}

// Claim: a worker's certificate drains the workers that registered with it, and no others; an operator's
// drains all.
TEST_F(CertificatesTest, WorkersDrainTheirOwn) {
  TestWorker own(dial("node-1", {Role::worker}));
  ASSERT_TRUE(own.enrol().ok()) << own.status.error_message();
  const auto drain = [&](v1::FarmService::Stub& farm) {
    v1::DrainWorkerRequest request;
    request.set_worker_id(own.session.worker_id());
    v1::WorkerStatus out;
    grpc::ClientContext context;
    return farm.DrainWorker(&context, request, &out).error_code();
  };
  EXPECT_EQ(drain(*farm("node-2", {Role::worker})), kDenied);
  EXPECT_EQ(drain(*farm("alice", {Role::submit})), kDenied);
  EXPECT_EQ(drain(*v1::FarmService::NewStub(dial("node-3", {Role::operate}))), grpc::StatusCode::OK);
  TestWorker again(dial("node-4", {Role::worker}));
  ASSERT_TRUE(again.enrol().ok());
  own.session = again.session;
  authority_.reset();
  const auto text = [&](const std::string& file) { return *read_file(tls() / file, 1 << 20); };
  grpc::SslCredentialsOptions ssl{text("ca.pem"), text("node-4.key"), text("node-4.pem")};
  EXPECT_EQ(drain(*v1::FarmService::NewStub(grpc::CreateChannel(address(), grpc::SslCredentials(ssl)))),
            grpc::StatusCode::OK);
}

// Claim: without TLS a job's submitter is who the client says, and stays over a restart of the master; it is
// no part of what makes a repeated submission the same.
TEST_F(MasterTest, KeepsTheSubmitter) {
  v1::SubmitRequest request = submission(4);
  request.set_submitter("alice@workstation");
  request.set_idempotency_token("once");
  const std::string id = test::submit(*farm, kScene, request);
  EXPECT_EQ(show(id).submitter(), "alice@workstation");
  request.set_submitter("alice@laptop");
  EXPECT_EQ(test::submit(*farm, kScene, request), id);
  restart();
  EXPECT_EQ(show(id).submitter(), "alice@workstation");
}

// Claim: a data folder that others could read is closed to them at start, with all that is in it; symbolic
// links and what they lead to stay as they are. What is made later is not open either.
TEST_F(RolesTest, TheDataFolderIsTightened) {
  const fs::path data = folder_.path() / "data", elsewhere = folder_.path() / "elsewhere";
  start();
  master_.reset();
  std::ofstream(elsewhere) << "x";
  fs::create_symlink(elsewhere, data / "link");
  std::set<fs::path> opened = {data};
  for (const auto& entry : fs::recursive_directory_iterator(data))
    if (!entry.is_symlink()) opened.insert(entry.path());
  for (const fs::path& path : opened)
    ASSERT_EQ(::chmod(path.c_str(), fs::is_directory(path) ? 0755 : 0644), 0) << path;
  ASSERT_EQ(::chmod(elsewhere.c_str(), 0644), 0);
  ASSERT_GT(opened.size(), 5U);
  start();
  for (const fs::path& path : opened) {
    if (!fs::exists(path)) continue;               // a file of the store's log
    if (path == data / "blobs" / "tmp") continue;  // made anew at each start
    EXPECT_EQ(fs::status(path).permissions() & (fs::perms::group_all | fs::perms::others_all),
              fs::perms::none)
        << path;
  }
  EXPECT_NE(fs::status(elsewhere).permissions() & fs::perms::others_read, fs::perms::none);
}

}  // namespace
}  // namespace candela::master
