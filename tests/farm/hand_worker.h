// A worker in the test's hands: speaks the worker's side of the protocol call by call, with real deltas from
// the real renderer, and can therefore misbehave in any way a test wants.
#pragma once

#include <candela/v1/worker.grpc.pb.h>
#include <grpcpp/grpcpp.h>

#include <memory>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/film/film.h"
#include "worker/render/renderer.h"

namespace candela::farm {

// Content of a push; delta_for() makes an honest one.
struct Push {
  v1::DeltaHeader header;
  std::string bytes;
};

class HandWorker {
 public:
  // Registers; throws std::runtime_error if refused. Without credentials it shows the token.
  HandWorker(const std::string& address, const std::string& name,
             const std::shared_ptr<grpc::ChannelCredentials>& credentials = nullptr);

  // Registers with this protocol and build, and tells how that went.
  static grpc::Status try_register(const std::string& address, std::uint32_t protocol,
                                   const std::string& build_id);

  // The next lease of iterations or segments; pilots and bootstraps are done on the way. Throws if none comes
  // within `seconds`.
  v1::Lease acquire(double seconds = 30);
  // Nothing if there is nothing to do now.
  std::optional<v1::Lease> try_acquire();
  // Renders the lease's unit of the scene file and encodes it.
  Push delta_for(const v1::Lease& lease, const std::string& scene_file);
  // Sends it all. Throws if the call itself fails.
  v1::PushDeltaResponse push(const Push& push);
  grpc::Status push_status(const Push& push, v1::PushDeltaResponse& response);
  // Keeps the lease alive; true if the master says that the token is void.
  bool revoked(const v1::Lease& lease);

  v1::WorkerService::Stub& stub() { return *stub_; }
  std::string scene_file_for_pilots;  // must be set before acquire()
  double told_seconds = 0;            // of an iteration, in answers to pilots; 0: as measured
  const std::string& id() const { return registered_.worker_id(); }

 private:
  void complete_pilot(const v1::Lease& lease);
  std::string fetch_state(const v1::DecidedState& state);
  render::Renderer& renderer_for(const v1::Lease& lease, const std::string& scene_file);

  std::unique_ptr<v1::WorkerService::Stub> stub_;
  v1::RegisterResponse registered_;
  std::unique_ptr<render::Renderer> renderer_;
  std::string renderer_job_;
};

// A push that has begun and does not go on: the header and half of the bytes are sent, the stream stays open.
class HungPush {
 public:
  HungPush(HandWorker& worker, const Push& push);
  ~HungPush();
  HungPush(const HungPush&) = delete;
  HungPush& operator=(const HungPush&) = delete;

 private:
  grpc::ClientContext context_;
  v1::PushDeltaResponse response_;
  std::unique_ptr<grpc::ClientWriter<v1::DeltaChunk>> writer_;
};

}  // namespace candela::farm
