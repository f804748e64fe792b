// A worker in the test's hands: the worker's side of the protocol call by call, so that it can fall silent
// and deliver anything. What it renders is said by those who derive from it.
#pragma once

#include <grpcpp/grpcpp.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "candela/v1/worker.grpc.pb.h"
#include "common/base/hash.h"
#include "common/base/version.h"
#include "common/wire/wire.h"

namespace candela::test {

class HandWorker {
 public:
  explicit HandWorker(const std::shared_ptr<grpc::Channel>& channel)
      : stub(v1::WorkerService::NewStub(channel)) {}

  grpc::Status enrol(const std::string& build = std::string(build_id()), std::uint32_t protocol = kProtocol) {
    v1::RegisterRequest request;
    request.set_protocol(protocol);
    request.set_build_id(build);
    request.set_name(name);
    request.set_host(host);
    request.set_threads(1);
    request.add_isas("avx2");
    grpc::ClientContext context;
    return status = stub->Register(&context, request, &session);
  }
  // Nothing if there is none, or the call fails: see `status`.
  std::optional<v1::Lease> acquire() {
    v1::AcquireLeaseRequest request;
    request.set_worker_id(session.worker_id());
    request.set_session(session.session());
    v1::AcquireLeaseResponse response;
    grpc::ClientContext context;
    status = stub->AcquireLease(&context, request, &response);
    if (!response.has_lease()) return std::nullopt;
    return response.lease();
  }
  // As acquire(), waiting for a unit that waits after a failure.
  std::optional<v1::Lease> acquire_soon() {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    std::optional<v1::Lease> lease = acquire();
    while (!lease && status.ok() && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      lease = acquire();
    }
    return lease;
  }
  template <class Request>
  void sign(Request& request, const v1::Lease& lease) const {
    request.set_worker_id(session.worker_id());
    request.set_session(session.session());
    request.set_token(lease.token());
  }
  // True if the pilot's result was accepted.
  bool complete(const v1::CompletePilotRequest& request) {
    v1::CompletePilotResponse response;
    grpc::ClientContext context;
    status = stub->CompletePilot(&context, request, &response);
    return response.accepted();
  }
  void fail(const v1::Lease& lease, v1::FailureCause cause, const std::string& message) {
    v1::FailUnitRequest request;
    sign(request, lease);
    request.set_cause(cause);
    request.set_message(message);
    v1::FailUnitResponse response;
    grpc::ClientContext context;
    status = stub->FailUnit(&context, request, &response);
  }
  // The bytes that come; `status` says whether all did. `size`: as the bundle has it.
  std::string fetch_blob(const std::string& sha256, std::uint64_t size = 0) {
    v1::FetchBlobRequest request;
    request.set_worker_id(session.worker_id());
    request.set_session(session.session());
    request.set_sha256(sha256);
    request.set_size_bytes(size);
    grpc::ClientContext context;
    auto stream = stub->FetchBlob(&context, request);
    v1::FetchBlobChunk chunk;
    std::string bytes;
    while (stream->Read(&chunk)) bytes += chunk.data();
    status = stream->Finish();
    return bytes;
  }
  v1::DeltaHeader header(const v1::Lease& lease, const std::string& bytes) const {
    v1::DeltaHeader h;
    sign(h, lease);
    h.set_unit_id(lease.unit_id());
    h.set_job_id(lease.job_id());
    *h.mutable_unit() = lease.unit();
    h.set_build_id(std::string(build_id()));
    h.set_size_bytes(bytes.size());
    h.set_sha256(sha256_hex(bytes));
    h.set_render_seconds(0.01);
    return h;
  }
  v1::PushDeltaResponse push(const v1::DeltaHeader& h, const std::string& bytes) {
    constexpr std::size_t kChunk = 5000;  // several chunks
    v1::DeltaChunk chunk;
    *chunk.mutable_header() = h;
    v1::PushDeltaResponse response;
    grpc::ClientContext context;
    auto stream = stub->PushDelta(&context, &response);
    for (std::size_t at = 0; at == 0 || at < bytes.size(); at += kChunk) {
      chunk.set_data(bytes.substr(at, kChunk));
      if (!stream->Write(chunk)) break;
      chunk.Clear();
    }
    stream->WritesDone();
    status = stream->Finish();
    return response;
  }

  std::string name = "test", host;  // as it registers
  std::unique_ptr<v1::WorkerService::Stub> stub;
  v1::RegisterResponse session;
  grpc::Status status;  // of the last call
};

}  // namespace candela::test
