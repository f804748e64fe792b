// Calls to the master: each with a deadline, each cancellable by lane. No retries here: what a failure means
// differs from call to call.
#pragma once

#include <grpcpp/grpcpp.h>

#include <array>
#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string_view>

#include "candela/v1/worker.grpc.pb.h"
#include "common/base/mutex.h"
#include "common/base/result.h"
#include "common/rng/stream.h"

namespace candela::worker {

using Milliseconds = std::chrono::milliseconds;

// Delays between attempts: doubling from `first` to `longest`, each multiplied by a factor from [1/2, 1) so
// that a fleet does not come back in step. The jitter never touches pixels, so it may be seeded by anything.
class Backoff {
 public:
  Backoff(Milliseconds first, Milliseconds longest, std::uint64_t seed);
  Milliseconds next();
  void reset() { current_ = first_; }

 private:
  Milliseconds first_, longest_, current_;
  rng::Stream stream_;
};

// The master cannot be reached or did not answer: the same call may succeed later.
bool is_unreachable(const grpc::Status& status);

class MasterLink {
 public:
  enum class Lane { registration, control, heartbeat, fetch, push };

  explicit MasterLink(std::shared_ptr<grpc::Channel> channel);

  template <class Request, class Response>
  grpc::Status unary(Lane lane,
                     grpc::Status (v1::WorkerService::Stub::*method)(grpc::ClientContext*, const Request&,
                                                                     Response*),
                     const Request& request, Response& response, Milliseconds deadline) {
    Call call(*this, lane, deadline);
    if (!call.open()) return cancelled();
    return (stub_.get()->*method)(&call.context(), request, &response);
  }

  // Transfers have no deadline while they move (common/wire/stall_guard.h).

  // The blob from request.offset on through `sink`, in order. An error of the sink cancels the call and comes
  // back in `sink_error`.
  using Sink = std::function<Result<void>(std::string_view)>;
  grpc::Status fetch_blob(const v1::FetchBlobRequest& request, const Sink& sink, Result<void>& sink_error);

  // One delta in chunks of at most `chunk_bytes`; `steps` grows with each that is sent.
  grpc::Status push_delta(const v1::DeltaHeader& header, std::string_view bytes, std::size_t chunk_bytes,
                          v1::PushDeltaResponse& response, std::atomic<std::uint64_t>& steps);

  // Cancels all calls of the lane, those in flight and those to come.
  void close(Lane lane);
  // Cancels the calls in flight.
  void interrupt(Lane lane);

 private:
  // Registers a call's context for as long as the call lasts.
  class Call {
   public:
    Call(MasterLink& link, Lane lane, std::optional<Milliseconds> deadline);
    ~Call();
    Call(const Call&) = delete;
    Call& operator=(const Call&) = delete;
    bool open() const { return open_; }
    grpc::ClientContext& context() { return context_; }

   private:
    MasterLink& link_;
    std::size_t lane_;
    grpc::ClientContext context_;
    bool open_ = false;
  };
  struct LaneState {
    bool closed = false;
    std::set<grpc::ClientContext*> calls;
  };
  static grpc::Status cancelled() { return {grpc::StatusCode::CANCELLED, "the worker is leaving"}; }

  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::WorkerService::Stub> stub_;
  Mutex mutex_;
  std::array<LaneState, 5> lanes_ CANDELA_GUARDED_BY(mutex_);
};

}  // namespace candela::worker
