// candela.v1.WorkerService: a thin layer over Farm. guarded_services.h asks who may call.
#pragma once

#include <grpcpp/grpcpp.h>

#include "candela/v1/worker.grpc.pb.h"
#include "master/api/access.h"
#include "master/farm.h"
#include "master/merge/buffer_pool.h"

namespace candela::master {

class WorkerServiceImpl : public v1::WorkerService::Service {
 public:
  WorkerServiceImpl(Farm& farm, const Access& access) : farm_(farm), access_(access) {}
  grpc::Status Register(grpc::ServerContext*, const v1::RegisterRequest*, v1::RegisterResponse*) override;
  grpc::Status AcquireLease(grpc::ServerContext*, const v1::AcquireLeaseRequest*,
                            v1::AcquireLeaseResponse*) override;
  grpc::Status Heartbeat(grpc::ServerContext*, const v1::HeartbeatRequest*, v1::HeartbeatResponse*) override;
  grpc::Status ReturnLease(grpc::ServerContext*, const v1::ReturnLeaseRequest*,
                           v1::ReturnLeaseResponse*) override;
  grpc::Status FailUnit(grpc::ServerContext*, const v1::FailUnitRequest*, v1::FailUnitResponse*) override;
  grpc::Status CompletePilot(grpc::ServerContext*, const v1::CompletePilotRequest*,
                             v1::CompletePilotResponse*) override;
  grpc::Status PushDelta(grpc::ServerContext*, grpc::ServerReader<v1::DeltaChunk>*,
                         v1::PushDeltaResponse*) override;
  grpc::Status GetBundle(grpc::ServerContext*, const v1::GetBundleRequest*, v1::Bundle*) override;
  grpc::Status FetchBlob(grpc::ServerContext*, const v1::FetchBlobRequest*,
                         grpc::ServerWriter<v1::FetchBlobChunk>*) override;
  grpc::Status Deregister(grpc::ServerContext*, const v1::DeregisterRequest*,
                          v1::DeregisterResponse*) override;

 private:
  static constexpr std::size_t kPooledBytes = 128 << 20;  // the deltas of some turns of merging

  Farm& farm_;
  const Access& access_;
  BufferPool buffers_{kPooledBytes};
};

}  // namespace candela::master
