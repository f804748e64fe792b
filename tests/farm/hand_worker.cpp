#include "tests/farm/hand_worker.h"

#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <stdexcept>

#include "common/base/hash.h"
#include "common/base/version.h"
#include "common/bundle/gather.h"
#include "common/wire/wire.h"
#include "tests/farm/process.h"
#include "tests/token_channel.h"

namespace candela::farm {
namespace {

constexpr std::size_t kChunkBytes = 64 << 10;

void set_deadline(grpc::ClientContext& context, double seconds = 20) {
  context.set_deadline(std::chrono::system_clock::now() +
                       std::chrono::milliseconds(static_cast<int>(seconds * 1000)));
}

void expect_ok(const grpc::Status& status, const char* call) {
  if (!status.ok())
    throw std::runtime_error(
        fmt::format("{}: {} {}", call, static_cast<int>(status.error_code()), status.error_message()));
}

template <class T>
T unwrap(Result<T> result) {
  if (!result.ok()) throw std::runtime_error(result.error().to_string());
  return std::move(result).value();
}

v1::RegisterRequest registration(const std::string& name) {
  v1::RegisterRequest request;
  request.set_protocol(kProtocol);
  request.set_build_id(std::string(build_id()));
  request.set_name(name);
  request.set_host("localhost");
  request.set_threads(1);
  for (const std::string& isa : render::supported_isas()) request.add_isas(isa);
  request.set_memory_bytes(1ULL << 30);
  return request;
}

// A connection of its own each: a broken stream of one worker shall not be another's.
std::unique_ptr<v1::WorkerService::Stub> dial(
    const std::string& address, const std::shared_ptr<grpc::ChannelCredentials>& credentials = nullptr) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  if (credentials != nullptr)
    return v1::WorkerService::NewStub(grpc::CreateCustomChannel(address, credentials, arguments));
  return v1::WorkerService::NewStub(test::token_channel_by_environment(address, arguments));
}

}  // namespace

HandWorker::HandWorker(const std::string& address, const std::string& name,
                       const std::shared_ptr<grpc::ChannelCredentials>& credentials)
    : stub_(dial(address, credentials)) {
  grpc::ClientContext context;
  set_deadline(context);
  context.set_wait_for_ready(true);
  expect_ok(stub_->Register(&context, registration(name), &registered_), "Register");
}

grpc::Status HandWorker::try_register(const std::string& address, std::uint32_t protocol,
                                      const std::string& build_id) {
  v1::RegisterRequest request = registration("stranger");
  request.set_protocol(protocol);
  request.set_build_id(build_id);
  v1::RegisterResponse response;
  grpc::ClientContext context;
  set_deadline(context);
  context.set_wait_for_ready(true);
  return dial(address)->Register(&context, request, &response);
}

std::optional<v1::Lease> HandWorker::try_acquire() {
  v1::AcquireLeaseRequest request;
  request.set_worker_id(registered_.worker_id());
  request.set_session(registered_.session());
  v1::AcquireLeaseResponse response;
  grpc::ClientContext context;
  set_deadline(context);
  expect_ok(stub_->AcquireLease(&context, request, &response), "AcquireLease");
  if (!response.has_lease()) return std::nullopt;
  const v1::Lease& lease = response.lease();
  if (lease.unit().kind() == v1::Unit::KIND_PILOT)
    complete_pilot(lease);
  else if (lease.unit().kind() == v1::Unit::KIND_BOOTSTRAP)
    push(delta_for(lease, scene_file_for_pilots));
  else
    return lease;
  return std::nullopt;
}

void HandWorker::complete_pilot(const v1::Lease& lease) {
  const PilotResult pilot = unwrap(renderer_for(lease, scene_file_for_pilots).pilot({}));
  v1::CompletePilotRequest done;
  done.set_worker_id(registered_.worker_id());
  done.set_session(registered_.session());
  done.set_token(lease.token());
  wire::to_proto(pilot.state, *done.mutable_named_state());
  done.set_plan(pilot.plan);
  done.set_seconds_per_iteration(told_seconds > 0 ? told_seconds : pilot.seconds_per_iteration);
  wire::to_proto(pilot.work, *done.mutable_work());
  v1::CompletePilotResponse accepted;
  grpc::ClientContext context;
  set_deadline(context);
  expect_ok(stub_->CompletePilot(&context, done, &accepted), "CompletePilot");
  if (!accepted.accepted()) throw std::runtime_error("the pilot was not accepted");
}

v1::Lease HandWorker::acquire(double seconds) {
  std::optional<v1::Lease> lease;
  if (!eventually(seconds, [&] { return (lease = try_acquire()).has_value(); }))
    throw std::runtime_error("no lease came");
  return *lease;
}

render::Renderer& HandWorker::renderer_for(const v1::Lease& lease, const std::string& scene_file) {
  if (renderer_ && renderer_job_ == lease.job_id()) return *renderer_;
  const std::filesystem::path path = std::filesystem::absolute(scene_file);
  const bundle::DiskSource files(path.parent_path());
  renderer_ = unwrap(render::Renderer::create(files, path.filename().string(), {},
                                              unwrap(wire::from_proto(lease.settings())), 1));
  renderer_job_ = lease.job_id();
  return *renderer_;
}

std::string HandWorker::fetch_state(const v1::DecidedState& state) {
  v1::FetchBlobRequest request;
  request.set_worker_id(registered_.worker_id());
  request.set_session(registered_.session());
  request.set_sha256(state.sha256());
  request.set_size_bytes(state.size_bytes());
  grpc::ClientContext context;
  set_deadline(context);
  const auto stream = stub_->FetchBlob(&context, request);
  std::string bytes;
  for (v1::FetchBlobChunk chunk; stream->Read(&chunk);) bytes += chunk.data();
  expect_ok(stream->Finish(), "FetchBlob");
  if (sha256_hex(bytes) != state.sha256()) throw std::runtime_error("a state is not that of its hash");
  return bytes;
}

Push HandWorker::delta_for(const v1::Lease& lease, const std::string& scene_file) {
  render::Renderer& renderer = renderer_for(lease, scene_file);
  const NamedState state = unwrap(wire::from_proto(lease.named_state()));
  const Unit unit = unwrap(wire::from_proto(lease.unit()));
  render::UnitOutput output;
  if (makes_film(unit.kind)) output = renderer.make_output(state);
  std::vector<chains::ChainStart> starts;
  for (const v1::ChainStart& start : lease.chain_starts()) starts.push_back(unwrap(wire::from_proto(start)));
  std::map<std::string, std::string> states;
  render::UnitInput input{state, {}, starts};
  for (const v1::DecidedState& decided : lease.states())
    input.states[decided.name()] = states[decided.name()] = fetch_state(decided);
  const Result<void> ran = renderer.run(unit, input, output, {});
  if (!ran.ok()) throw std::runtime_error(ran.error().to_string());

  Push push;
  push.bytes = encode_delta({unit, {}, 0, lease.job_id(), std::string(build_id())}, output);
  push.header.set_worker_id(registered_.worker_id());
  push.header.set_session(registered_.session());
  push.header.set_token(lease.token());
  push.header.set_unit_id(lease.unit_id());
  push.header.set_job_id(lease.job_id());
  *push.header.mutable_unit() = lease.unit();
  push.header.set_build_id(std::string(build_id()));
  push.header.set_size_bytes(push.bytes.size());
  push.header.set_sha256(sha256_hex(push.bytes));
  push.header.set_render_seconds(0.1);
  return push;
}

grpc::Status HandWorker::push_status(const Push& push, v1::PushDeltaResponse& response) {
  grpc::ClientContext context;
  set_deadline(context);
  const auto writer = stub_->PushDelta(&context, &response);
  v1::DeltaChunk chunk;
  *chunk.mutable_header() = push.header;
  bool open = true;
  for (std::size_t at = 0; open && (at < push.bytes.size() || at == 0); at += kChunkBytes) {
    chunk.set_data(push.bytes.substr(at, kChunkBytes));
    open = writer->Write(chunk);
    chunk.clear_header();
  }
  writer->WritesDone();
  return writer->Finish();
}

v1::PushDeltaResponse HandWorker::push(const Push& push) {
  v1::PushDeltaResponse response;
  expect_ok(push_status(push, response), "PushDelta");
  return response;
}

bool HandWorker::revoked(const v1::Lease& lease) {
  v1::HeartbeatRequest request;
  request.set_worker_id(registered_.worker_id());
  request.set_session(registered_.session());
  v1::UnitProgress* progress = request.add_units();
  progress->set_token(lease.token());
  progress->set_fraction(0.5);
  v1::HeartbeatResponse response;
  grpc::ClientContext context;
  set_deadline(context);
  expect_ok(stub_->Heartbeat(&context, request, &response), "Heartbeat");
  for (const std::uint64_t token : response.revoked_tokens())
    if (token == lease.token()) return true;
  return false;
}

HungPush::HungPush(HandWorker& worker, const Push& push) {
  set_deadline(context_, 600);
  writer_ = worker.stub().PushDelta(&context_, &response_);
  v1::DeltaChunk chunk;
  *chunk.mutable_header() = push.header;
  chunk.set_data(push.bytes.substr(0, push.bytes.size() / 2));
  if (!writer_->Write(chunk)) throw std::runtime_error("the hung push could not even begin");
}

HungPush::~HungPush() {
  context_.TryCancel();
  (void)writer_->Finish();
}

}  // namespace candela::farm
