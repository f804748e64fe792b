// candela.v1.FarmService: a thin layer over Farm. guarded_services.h asks who may call.
#pragma once

#include <grpcpp/grpcpp.h>

#include "candela/v1/client.grpc.pb.h"
#include "master/api/access.h"
#include "master/api/peer_places.h"
#include "master/farm.h"

namespace candela::master {

class FarmServiceImpl : public v1::FarmService::Service {
 public:
  FarmServiceImpl(Farm& farm, const Access& access) : farm_(farm), access_(access) {}
  grpc::Status GetServerInfo(grpc::ServerContext*, const v1::GetServerInfoRequest*,
                             v1::GetServerInfoResponse*) override;
  grpc::Status FindMissingBlobs(grpc::ServerContext*, const v1::FindMissingBlobsRequest*,
                                v1::FindMissingBlobsResponse*) override;
  grpc::Status UploadBlob(grpc::ServerContext*, grpc::ServerReader<v1::UploadBlobRequest>*,
                          v1::UploadBlobResponse*) override;
  grpc::Status Submit(grpc::ServerContext*, const v1::SubmitRequest*, v1::SubmitResponse*) override;
  grpc::Status ListJobs(grpc::ServerContext*, const v1::ListJobsRequest*, v1::ListJobsResponse*) override;
  grpc::Status GetJob(grpc::ServerContext*, const v1::GetJobRequest*, v1::JobStatus*) override;
  grpc::Status FindJobs(grpc::ServerContext*, const v1::FindJobsRequest*, v1::FindJobsResponse*) override;
  grpc::Status GetGroup(grpc::ServerContext*, const v1::GetGroupRequest*, v1::GroupStatus*) override;
  grpc::Status SteerGroup(grpc::ServerContext*, const v1::SteerGroupRequest*, v1::GroupStatus*) override;
  grpc::Status WatchJob(grpc::ServerContext*, const v1::WatchJobRequest*,
                        grpc::ServerWriter<v1::JobStatus>*) override;
  grpc::Status FetchImage(grpc::ServerContext*, const v1::FetchImageRequest*,
                          grpc::ServerWriter<v1::FetchImageChunk>*) override;
  grpc::Status PauseJob(grpc::ServerContext*, const v1::JobRequest*, v1::JobStatus*) override;
  grpc::Status ResumeJob(grpc::ServerContext*, const v1::JobRequest*, v1::JobStatus*) override;
  grpc::Status ExtendJob(grpc::ServerContext*, const v1::ExtendJobRequest*, v1::JobStatus*) override;
  grpc::Status CancelJob(grpc::ServerContext*, const v1::JobRequest*, v1::JobStatus*) override;
  grpc::Status SetPriority(grpc::ServerContext*, const v1::SetPriorityRequest*, v1::JobStatus*) override;
  grpc::Status ListEvents(grpc::ServerContext*, const v1::ListEventsRequest*,
                          v1::ListEventsResponse*) override;
  grpc::Status ListWorkers(grpc::ServerContext*, const v1::ListWorkersRequest*,
                           v1::ListWorkersResponse*) override;
  grpc::Status DrainWorker(grpc::ServerContext*, const v1::DrainWorkerRequest*, v1::WorkerStatus*) override;
  grpc::Status PauseWorker(grpc::ServerContext*, const v1::WorkerRequest*, v1::WorkerStatus*) override;
  grpc::Status ResumeWorker(grpc::ServerContext*, const v1::WorkerRequest*, v1::WorkerStatus*) override;
  grpc::Status DistrustWorker(grpc::ServerContext*, const v1::WorkerRequest*, v1::TrustResponse*) override;
  grpc::Status TrustWorker(grpc::ServerContext*, const v1::WorkerRequest*, v1::TrustResponse*) override;
  grpc::Status GetLedger(grpc::ServerContext*, const v1::GetLedgerRequest*, v1::GetLedgerResponse*) override;
  grpc::Status VerifyJobs(grpc::ServerContext*, const v1::VerifyJobsRequest*,
                          grpc::ServerWriter<v1::JobReport>*) override;
  grpc::Status RepairJob(grpc::ServerContext*, const v1::JobRequest*, v1::JobStatus*) override;

 private:
  Farm& farm_;
  const Access& access_;
  // Limits on the calls that one master serves at a time, since each call holds a thread.
  PeerPlaces watchers_{"calls that wait for a job or a worker", 256, 64,
                       "end some of them, or use `candela list`"};
  PeerPlaces uploads_{"uploads", 32, 16, "wait until some are done"};
  PeerPlaces images_{"images being made", 4, 2, "wait until one is done"};  // or sent if they are large
  PeerPlaces senders_{"images being sent", 32, 16, "wait until some are done"};
  PeerPlaces verifications_{"verifications", 2, 1, "wait until it is done"};
};

}  // namespace candela::master
