// The services behind their table of roles: no call of either reaches its handler past Access::permit().
#pragma once

#include <concepts>

#include "master/api/access.h"
#include "master/api/farm_service.h"
#include "master/api/worker_service.h"

namespace candela::master {

// The owner of the job, or of the worker, that a request names.
template <class Request>
Owner owner_of(Farm& farm, const Request& request) {
  if constexpr (std::same_as<Request, v1::DrainWorkerRequest>) {
    const auto worker = farm.worker(request.worker_id());
    return worker ? Owner{true, worker->row.certificate} : Owner{};
  } else if constexpr (std::same_as<Request, v1::SteerGroupRequest>) {
    return farm.with_scheduler([&](Scheduler& s) {
      const auto group = s.groups().find(request.group_id());
      if (group == s.groups().end()) return Owner{};
      return Owner{true, s.job(*group->second.jobs.begin())->row.submitter};
    });
  } else if constexpr (requires { request.job_id(); }) {
    return farm.with_scheduler([&](Scheduler& s) {
      const Job* job = s.job(request.job_id());
      return job == nullptr ? Owner{} : Owner{true, job->row.submitter};
    });
  } else {
    return {};
  }
}

// One call of each kind. `Service` and `Method` are its names in the proto.
#define CANDELA_UNARY(Service, Method, Request, Response)                                               \
  grpc::Status Method(grpc::ServerContext* context, const v1::Request* request, v1::Response* response) \
      override {                                                                                        \
    const grpc::Status allowed =                                                                        \
        access_.permit(*context, #Service "/" #Method, [&] { return owner_of(farm_, *request); });      \
    return allowed.ok() ? Service##Impl::Method(context, request, response) : allowed;                  \
  }
#define CANDELA_SENDS(Service, Method, Request, Response)                                          \
  grpc::Status Method(grpc::ServerContext* context, const v1::Request* request,                    \
                      grpc::ServerWriter<v1::Response>* writer) override {                         \
    const grpc::Status allowed =                                                                   \
        access_.permit(*context, #Service "/" #Method, [&] { return owner_of(farm_, *request); }); \
    return allowed.ok() ? Service##Impl::Method(context, request, writer) : allowed;               \
  }
#define CANDELA_TAKES(Service, Method, Request, Response)                                                \
  grpc::Status Method(grpc::ServerContext* context, grpc::ServerReader<v1::Request>* reader,             \
                      v1::Response* response) override {                                                 \
    const grpc::Status allowed = access_.permit(*context, #Service "/" #Method, [] { return Owner(); }); \
    return allowed.ok() ? Service##Impl::Method(context, reader, response) : allowed;                    \
  }

class GuardedFarmService final : public FarmServiceImpl {
 public:
  GuardedFarmService(Farm& farm, const Access& access)
      : FarmServiceImpl(farm, access), farm_(farm), access_(access) {}
  CANDELA_UNARY(FarmService, GetServerInfo, GetServerInfoRequest, GetServerInfoResponse)
  CANDELA_UNARY(FarmService, FindMissingBlobs, FindMissingBlobsRequest, FindMissingBlobsResponse)
  CANDELA_TAKES(FarmService, UploadBlob, UploadBlobRequest, UploadBlobResponse)
  CANDELA_UNARY(FarmService, Submit, SubmitRequest, SubmitResponse)
  CANDELA_UNARY(FarmService, ListJobs, ListJobsRequest, ListJobsResponse)
  CANDELA_UNARY(FarmService, GetJob, GetJobRequest, JobStatus)
  CANDELA_UNARY(FarmService, FindJobs, FindJobsRequest, FindJobsResponse)
  CANDELA_UNARY(FarmService, GetGroup, GetGroupRequest, GroupStatus)
  CANDELA_UNARY(FarmService, SteerGroup, SteerGroupRequest, GroupStatus)
  CANDELA_SENDS(FarmService, WatchJob, WatchJobRequest, JobStatus)
  CANDELA_SENDS(FarmService, FetchImage, FetchImageRequest, FetchImageChunk)
  CANDELA_UNARY(FarmService, PauseJob, JobRequest, JobStatus)
  CANDELA_UNARY(FarmService, ResumeJob, JobRequest, JobStatus)
  CANDELA_UNARY(FarmService, ExtendJob, ExtendJobRequest, JobStatus)
  CANDELA_UNARY(FarmService, CancelJob, JobRequest, JobStatus)
  CANDELA_UNARY(FarmService, SetPriority, SetPriorityRequest, JobStatus)
  CANDELA_UNARY(FarmService, ListEvents, ListEventsRequest, ListEventsResponse)
  CANDELA_UNARY(FarmService, ListWorkers, ListWorkersRequest, ListWorkersResponse)
  CANDELA_UNARY(FarmService, DrainWorker, DrainWorkerRequest, WorkerStatus)
  CANDELA_UNARY(FarmService, PauseWorker, WorkerRequest, WorkerStatus)
  CANDELA_UNARY(FarmService, ResumeWorker, WorkerRequest, WorkerStatus)
  CANDELA_UNARY(FarmService, DistrustWorker, WorkerRequest, TrustResponse)
  CANDELA_UNARY(FarmService, TrustWorker, WorkerRequest, TrustResponse)
  CANDELA_UNARY(FarmService, GetLedger, GetLedgerRequest, GetLedgerResponse)
  CANDELA_SENDS(FarmService, VerifyJobs, VerifyJobsRequest, JobReport)
  CANDELA_UNARY(FarmService, RepairJob, JobRequest, JobStatus)

 private:
  Farm& farm_;
  const Access& access_;
};

class GuardedWorkerService final : public WorkerServiceImpl {
 public:
  GuardedWorkerService(Farm& farm, const Access& access)
      : WorkerServiceImpl(farm, access), farm_(farm), access_(access) {}
  CANDELA_UNARY(WorkerService, Register, RegisterRequest, RegisterResponse)
  CANDELA_UNARY(WorkerService, AcquireLease, AcquireLeaseRequest, AcquireLeaseResponse)
  CANDELA_UNARY(WorkerService, Heartbeat, HeartbeatRequest, HeartbeatResponse)
  CANDELA_UNARY(WorkerService, ReturnLease, ReturnLeaseRequest, ReturnLeaseResponse)
  CANDELA_UNARY(WorkerService, FailUnit, FailUnitRequest, FailUnitResponse)
  CANDELA_UNARY(WorkerService, CompletePilot, CompletePilotRequest, CompletePilotResponse)
  CANDELA_TAKES(WorkerService, PushDelta, DeltaChunk, PushDeltaResponse)
  CANDELA_UNARY(WorkerService, GetBundle, GetBundleRequest, Bundle)
  CANDELA_SENDS(WorkerService, FetchBlob, FetchBlobRequest, FetchBlobChunk)
  CANDELA_UNARY(WorkerService, Deregister, DeregisterRequest, DeregisterResponse)

 private:
  Farm& farm_;
  const Access& access_;
};

#undef CANDELA_UNARY
#undef CANDELA_SENDS
#undef CANDELA_TAKES

}  // namespace candela::master
