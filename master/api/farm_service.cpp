#include "master/api/farm_service.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <set>
#include <thread>

#include "common/base/hash.h"
#include "common/base/version.h"
#include "common/wire/canonical.h"
#include "common/wire/peer.h"
#include "common/wire/stall_guard.h"
#include "master/api/find_jobs.h"
#include "master/api/list_jobs.h"
#include "master/api/messages.h"
#include "master/api/service_support.h"
#include "master/api/submission.h"

namespace candela::master {
namespace {

constexpr std::size_t kLargeImageBytes = 64 << 20;
constexpr int kMaxHashes = 100000;
constexpr std::uint32_t kMaxEventsAsked = 10000;
constexpr auto kStep = std::chrono::milliseconds(20);  // between looks at a job that is watched

// The caller's place, or why it has none.
Result<PeerPlaces::Place> place_of(const Access& access, const grpc::ServerContext& context,
                                   PeerPlaces& places, bool yields = false) {
  return places.enter(
      access.is_in_process(context) ? PeerPlaces::kThisProcess : wire::peer_name(context.peer()), yields);
}

grpc::Status too_many(const Error& error) {
  return wire::to_status_with_retry(error, 1000);
}

grpc::Status given_away() {
  return too_many(resource_error("another client needed this place, and this one has the most")
                      .with_mend("wait for fewer jobs or workers at a time"));
}

Result<film::MergedFilm::Which> half_of(v1::FetchImageRequest::Half half) {
  switch (half) {
    case v1::FetchImageRequest::HALF_UNSPECIFIED:
      return film::MergedFilm::Which::both;
    case v1::FetchImageRequest::HALF_A:
      return film::MergedFilm::Which::half0;
    case v1::FetchImageRequest::HALF_B:
      return film::MergedFilm::Which::half1;
    default:
      return usage_error("there is no such half").with_field("half");
  }
}

Result<void> check_token(const v1::ExtendJobRequest& request, const char* field) {
  if (request.idempotency_token().size() <= Limits::max_name_bytes) return {};
  return input_error(fmt::format("longer than {} bytes", Limits::max_name_bytes)).with_field(field);
}

Extension extension_of(const v1::ExtendJobRequest& request) {
  return {request.add_iterations(), request.add_time_seconds(), request.relmse(),
          request.idempotency_token()};
}

// Answers with what was made, or with its error.
template <class T, class Message>
grpc::Status answer(Result<T> made, Message* response) {
  if (!made.ok()) return wire::to_status(made.error());
  if constexpr (std::is_same_v<T, Message>)
    *response = std::move(*made);
  else
    *response = to_message(*made);
  return grpc::Status::OK;
}

// Answers with what was found. what, id: of the one that is not there.
template <class T, class Message>
grpc::Status answer(const std::optional<T>& found, Message* response, const char* what,
                    const std::string& id) {
  if (!found) return not_found(what, id);
  *response = to_message(*found);
  return grpc::Status::OK;
}

std::vector<std::string> job_ids(const Scheduler& scheduler) {
  std::vector<std::string> out;
  for (const auto& [id, job] : scheduler.jobs()) out.push_back(id);
  return out;
}

}  // namespace

grpc::Status FarmServiceImpl::GetServerInfo(grpc::ServerContext*, const v1::GetServerInfoRequest*,
                                            v1::GetServerInfoResponse* response) {
  response->set_version(std::string(version()));
  response->set_build_id(std::string(build_id()));
  response->set_protocol(kProtocol);
  response->set_unix_ms(JobTable::now().unix_ms);
  response->set_statistics_limit_bytes(farm_.statistics_limit());
  response->set_memory_limit_bytes(farm_.memory_limit());
  return grpc::Status::OK;
}

grpc::Status FarmServiceImpl::FindMissingBlobs(grpc::ServerContext*,
                                               const v1::FindMissingBlobsRequest* request,
                                               v1::FindMissingBlobsResponse* response) {
  return guarded([&] {
    if (request->sha256_size() > kMaxHashes)
      return wire::to_status(
          input_error(fmt::format("more than {} hashes", kMaxHashes)).with_field("sha256"));
    std::set<std::string> seen;
    for (const std::string& hash : request->sha256()) {
      if (!is_sha256_hex(hash))
        return wire::to_status(input_error("must be 64 lower-case hex digits").with_field("sha256"));
      if (!seen.insert(hash).second) continue;
      farm_.blobs().use(hash);
      if (!farm_.blobs().size(hash)) response->add_sha256(hash);
    }
    return grpc::Status::OK;
  });
}

grpc::Status FarmServiceImpl::UploadBlob(grpc::ServerContext* context,
                                         grpc::ServerReader<v1::UploadBlobRequest>* reader,
                                         v1::UploadBlobResponse*) {
  return guarded([&] {
    if (farm_.stopping()) return stopping_status();
    // A sender that hangs is cut off, as for deltas: soon before the first chunk, which is short.
    const auto cancel = [context] { context->TryCancel(); };
    auto guard = farm_.gate().enter_unknown(farm_.now().seconds, cancel);
    v1::UploadBlobRequest chunk;
    if (!reader->Read(&chunk)) return grpc::Status(grpc::StatusCode::INVALID_ARGUMENT, "no chunk came");
    const auto place = place_of(access_, *context, uploads_);
    if (!place.ok()) return answer_early(*context, *reader, too_many(place.error()));
    guard = farm_.gate().enter_silent(farm_.now().seconds, cancel);
    const std::string sha256 = chunk.sha256();  // later chunks do not say it
    auto upload = farm_.blobs().begin(sha256, chunk.size_bytes());
    if (!upload.ok()) return answer_early(*context, *reader, wire::to_status(upload.error()));
    if (const auto size = farm_.blobs().size(sha256)) {
      // Another length is damage that nobody has met yet.
      bool whole = *size == chunk.size_bytes();
      if (!whole) {
        const auto checked = farm_.blobs().check(sha256);
        if (!checked.ok()) return answer_early(*context, *reader, wire::to_status(checked.error()));
        whole = *checked;
      }
      if (whole) return answer_early(*context, *reader, grpc::Status::OK);
    }
    do {
      if (chunk.data().size() > Limits::max_chunk_bytes)
        return answer_early(
            *context, *reader,
            wire::to_status(input_error(fmt::format("larger than {} bytes", Limits::max_chunk_bytes))
                                .with_field("data")));
      if (auto added = (*upload)->append(chunk.data()); !added.ok()) {
        if (added.error().kind == ErrorKind::failed)
          return answer_early(*context, *reader,
                              grpc::Status(grpc::StatusCode::DATA_LOSS, added.error().to_string()));
        return answer_early(*context, *reader, wire::to_status(added.error()));
      }
      farm_.counters().upload_bytes += chunk.data().size();
      guard->progress(farm_.now().seconds);  // a large blob may take long, silence may not
    } while (reader->Read(&chunk) && !farm_.stopping());
    guard->all_here();
    if (context->IsCancelled())
      return grpc::Status(grpc::StatusCode::CANCELLED, "the blob did not arrive whole");
    if (auto stored = (*upload)->finish(); !stored.ok()) {
      if (stored.error().kind == ErrorKind::failed)
        return grpc::Status(grpc::StatusCode::DATA_LOSS, stored.error().to_string());
      return wire::to_status(stored.error());
    }
    farm_.blob_found(sha256);
    return grpc::Status::OK;
  });
}

grpc::Status FarmServiceImpl::Submit(grpc::ServerContext* context, const v1::SubmitRequest* request,
                                     v1::SubmitResponse* response) {
  return guarded([&] {
    if (farm_.stopping()) return stopping_status();
    auto submitted = submit_job(farm_, *request, access_.caller(*context).name);
    if (!submitted.ok()) {
      if (submitted.error().field == "idempotency_token" && submitted.error().kind == ErrorKind::refused)
        return grpc::Status(grpc::StatusCode::ALREADY_EXISTS, submitted.error().to_string());
      return wire::to_status(submitted.error());
    }
    response->set_job_id(submitted->job_id);
    response->set_existed(submitted->existed);
    response->set_group_id(submitted->group_id);
    return grpc::Status::OK;
  });
}

grpc::Status FarmServiceImpl::ListJobs(grpc::ServerContext* context, const v1::ListJobsRequest* request,
                                       v1::ListJobsResponse* response) {
  return guarded([&] { return answer(list_jobs(farm_, *request, access_.caller(*context).name), response); });
}

grpc::Status FarmServiceImpl::GetJob(grpc::ServerContext*, const v1::GetJobRequest* request,
                                     v1::JobStatus* response) {
  return guarded(
      [&] { return answer(farm_.full_status(request->job_id()), response, "job", request->job_id()); });
}

grpc::Status FarmServiceImpl::FindJobs(grpc::ServerContext*, const v1::FindJobsRequest* request,
                                       v1::FindJobsResponse* response) {
  return guarded([&] { return answer(find_jobs(farm_, *request), response); });
}

grpc::Status FarmServiceImpl::GetGroup(grpc::ServerContext*, const v1::GetGroupRequest* request,
                                       v1::GroupStatus* response) {
  return guarded([&] {
    return answer(farm_.group_status(request->group_id()), response, "group", request->group_id());
  });
}

grpc::Status FarmServiceImpl::SteerGroup(grpc::ServerContext*, const v1::SteerGroupRequest* request,
                                         v1::GroupStatus* response) {
  return guarded([&] {
    if (farm_.stopping()) return stopping_status();
    if (!farm_.group_status(request->group_id())) return not_found("group", request->group_id());
    if (request->action() < v1::SteerGroupRequest::ACTION_PAUSE ||
        request->action() > v1::SteerGroupRequest::ACTION_EXTEND)
      return wire::to_status(input_error("there is no such action").with_field("action"));
    const v1::ExtendJobRequest& extend = request->extend();
    if (auto checked = check_token(extend, "extend.idempotency_token"); !checked.ok())
      return wire::to_status(checked.error());
    GroupAction action{
        static_cast<GroupAction::Kind>(request->action() - v1::SteerGroupRequest::ACTION_PAUSE),
        request->priority(),
        {}};
    if (action.kind == GroupAction::Kind::extend) action.extension = extension_of(extend);
    return answer(farm_.steer_group(request->group_id(), action), response);
  });
}

grpc::Status FarmServiceImpl::WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest* request,
                                       grpc::ServerWriter<v1::JobStatus>* writer) {
  return guarded([&] {
    const auto place = place_of(access_, *context, watchers_, true);
    if (!place.ok()) return too_many(place.error());
    const double interval =
        request->interval_ms() == 0 ? 0.5 : std::clamp(request->interval_ms() / 1000.0, 0.02, 60.0);
    std::string last;
    double last_sent = -1e9;
    while (!context->IsCancelled() && !farm_.stopping()) {
      const auto status = farm_.status(request->job_id());
      if (!status) return not_found("job", request->job_id());
      const bool final = has_ended(status->row.state);
      const double now = farm_.now().seconds;
      if (final || now - last_sent >= interval) {
        const v1::JobStatus message = to_message(*status);
        const std::string bytes = wire::canonical(message);
        if (bytes != last || final) {
          if (!writer->Write(message))
            return grpc::Status(grpc::StatusCode::CANCELLED, "the watcher went away");
          last = bytes;
        }
        last_sent = now;
      }
      if (final) return grpc::Status::OK;
      if (place->revoked()) return given_away();
      std::this_thread::sleep_for(kStep);
    }
    return farm_.stopping() ? stopping_status() : grpc::Status(grpc::StatusCode::CANCELLED, "cancelled");
  });
}

grpc::Status FarmServiceImpl::FetchImage(grpc::ServerContext* context, const v1::FetchImageRequest* request,
                                         grpc::ServerWriter<v1::FetchImageChunk>* writer) {
  return guarded([&] {
    if (!farm_.status(request->job_id())) return not_found("job", request->job_id());
    EncodedImagePtr image;
    if (!request->sha256().empty())
      image = farm_.images().recent().find(request->sha256(), farm_.now().seconds);
    std::optional<PeerPlaces::Place> making;
    if (!image) {
      auto place = place_of(access_, *context, images_);
      if (!place.ok()) return too_many(place.error());
      making.emplace(std::move(*place));
      auto which = half_of(request->half());
      if (!which.ok()) return wire::to_status(which.error());
      auto bytes = farm_.images().encode(
          request->job_id(),
          {request->error_layer(), request->image_only(), request->chain_layers(), request->state_layers(),
           request->partial(), request->estimator(), *which, request->variance_layer()});
      if (!bytes.ok()) return wire::to_status(bytes.error());
      image = farm_.images().recent().keep(std::move(*bytes), farm_.now().seconds);
      // Clients on slow links keep nobody from an image, as long as it is not memory they take.
      if (image->bytes.size() <= kLargeImageBytes) making.reset();
    }
    const auto sending = place_of(access_, *context, senders_);
    if (!sending.ok()) return too_many(sending.error());
    // A client that takes nothing is cut off.
    const auto guard = farm_.gate().enter_silent(farm_.now().seconds, [context] { context->TryCancel(); });
    const std::string_view bytes = image->bytes;
    std::size_t at =
        image->sha256 == request->sha256() ? std::min<std::uint64_t>(request->offset(), bytes.size()) : 0;
    v1::FetchImageChunk chunk;
    chunk.set_sha256(image->sha256);
    chunk.set_offset(at);
    do {
      chunk.set_total_bytes(bytes.size());
      const std::string_view part = bytes.substr(at, wire::kStreamBytes);
      chunk.set_data(part.data(), part.size());
      if (!writer->Write(chunk)) return grpc::Status(grpc::StatusCode::CANCELLED, "the client went away");
      guard->progress(farm_.now().seconds);
      at += part.size();
      chunk.Clear();
    } while (at < bytes.size());
    return grpc::Status::OK;
  });
}

namespace {

// Changes a job by `change()`, which returns how it stands then.
template <class Change>
grpc::Status change(Farm& farm, const std::string& job_id, v1::JobStatus* response, Change&& change) {
  return guarded([&] {
    if (farm.stopping()) return stopping_status();
    if (!farm.status(job_id)) return not_found("job", job_id);
    return answer(change(), response);
  });
}

// The same by `f(scheduler, now)`.
template <class F>
grpc::Status change_by(Farm& farm, const std::string& job_id, v1::JobStatus* response, F&& f) {
  return change(farm, job_id, response, [&] { return farm.change_job(job_id, f); });
}

}  // namespace

grpc::Status FarmServiceImpl::PauseJob(grpc::ServerContext*, const v1::JobRequest* request,
                                       v1::JobStatus* response) {
  return change_by(farm_, request->job_id(), response,
                   [&](Scheduler& s, Now now) { return s.pause(request->job_id(), now); });
}

grpc::Status FarmServiceImpl::ResumeJob(grpc::ServerContext*, const v1::JobRequest* request,
                                        v1::JobStatus* response) {
  return change(farm_, request->job_id(), response, [&] { return farm_.resume(request->job_id()); });
}

grpc::Status FarmServiceImpl::CancelJob(grpc::ServerContext*, const v1::JobRequest* request,
                                        v1::JobStatus* response) {
  return change_by(farm_, request->job_id(), response,
                   [&](Scheduler& s, Now now) { return s.cancel(request->job_id(), now); });
}

grpc::Status FarmServiceImpl::SetPriority(grpc::ServerContext*, const v1::SetPriorityRequest* request,
                                          v1::JobStatus* response) {
  return change_by(farm_, request->job_id(), response, [&](Scheduler& s, Now now) {
    return s.set_priority(request->job_id(), request->priority(), now);
  });
}

grpc::Status FarmServiceImpl::ExtendJob(grpc::ServerContext*, const v1::ExtendJobRequest* request,
                                        v1::JobStatus* response) {
  return change(farm_, request->job_id(), response, [&]() -> Result<JobStatus> {
    CANDELA_TRY(check_token(*request, "idempotency_token"));
    return farm_.extend(request->job_id(), extension_of(*request));
  });
}

grpc::Status FarmServiceImpl::ListEvents(grpc::ServerContext*, const v1::ListEventsRequest* request,
                                         v1::ListEventsResponse* response) {
  return guarded([&] {
    if (!request->job_id().empty() && !farm_.status(request->job_id()))
      return not_found("job", request->job_id());
    if (auto flushed = farm_.writer().flush(); !flushed.ok()) return wire::to_status(flushed.error());
    const std::uint32_t limit = request->limit() == 0 ? 1000 : std::min(request->limit(), kMaxEventsAsked);
    auto events = farm_.store().events(request->job_id(), limit);
    if (!events.ok()) return wire::to_status(events.error());
    for (EventRow& e : *events) {
      v1::Event& out = *response->add_events();
      out.set_unix_ms(e.unix_ms);
      out.set_job_id(std::move(e.job_id));
      out.set_worker_id(std::move(e.worker_id));
      out.set_kind(std::move(e.kind));
      out.set_message(std::move(e.message));
    }
    return grpc::Status::OK;
  });
}

grpc::Status FarmServiceImpl::ListWorkers(grpc::ServerContext*, const v1::ListWorkersRequest*,
                                          v1::ListWorkersResponse* response) {
  return guarded([&] {
    for (const WorkerStatus& w : farm_.all_workers()) *response->add_workers() = to_message(w);
    const Wanted wanted = farm_.with_scheduler([&](Scheduler& s) { return s.wanted(farm_.now()); });
    response->mutable_wanted()->set_threads(wanted.threads);
    response->mutable_wanted()->set_workers(wanted.workers);
    farm_.with_scheduler([&](Scheduler& s) {
      for (const auto& [who, row] : s.distrusted()) *response->add_distrusted() = to_message(row);
    });
    return grpc::Status::OK;
  });
}

grpc::Status FarmServiceImpl::DrainWorker(grpc::ServerContext* context, const v1::DrainWorkerRequest* request,
                                          v1::WorkerStatus* response) {
  return guarded([&] {
    auto status = farm_.worker(request->worker_id());
    if (!status) return not_found("worker", request->worker_id());
    std::optional<PeerPlaces::Place> place;
    if (request->wait()) {
      auto entered = place_of(access_, *context, watchers_, true);
      if (!entered.ok()) return too_many(entered.error());
      place.emplace(std::move(*entered));
    }
    auto drained =
        farm_.with_scheduler([&](Scheduler& s) { return s.drain(request->worker_id(), farm_.now()); });
    if (!drained.ok()) return wire::to_status(drained.error());
    for (;;) {
      auto now = farm_.worker(request->worker_id());
      if (now)
        status = std::move(now);
      else
        status->state = "drained";  // it has left
      if (!request->wait() || status->state == "drained") break;
      if (context->IsCancelled()) return grpc::Status(grpc::StatusCode::CANCELLED, "cancelled");
      if (farm_.stopping()) return stopping_status();
      if (place->revoked()) return given_away();
      std::this_thread::sleep_for(kStep);
    }
    *response = to_message(*status);
    return grpc::Status::OK;
  });
}

namespace {

// Changes a worker by `change(scheduler, now)` and answers how it stands then.
template <class Change>
grpc::Status change_worker(Farm& farm, const std::string& id, v1::WorkerStatus* response, Change&& change) {
  return guarded([&] {
    if (farm.stopping()) return stopping_status();
    if (!farm.worker(id)) return not_found("worker", id);
    auto done = farm.with_scheduler([&](Scheduler& s) { return change(s, farm.now()); });
    if (!done.ok()) return wire::to_status(done.error());
    if (const auto status = farm.worker(id)) *response = to_message(*status);
    return grpc::Status::OK;
  });
}

}  // namespace

grpc::Status FarmServiceImpl::PauseWorker(grpc::ServerContext*, const v1::WorkerRequest* request,
                                          v1::WorkerStatus* response) {
  return change_worker(farm_, request->worker_id(), response,
                       [&](Scheduler& s, Now now) { return s.pause_worker(request->worker_id(), now); });
}

grpc::Status FarmServiceImpl::ResumeWorker(grpc::ServerContext*, const v1::WorkerRequest* request,
                                           v1::WorkerStatus* response) {
  return change_worker(farm_, request->worker_id(), response,
                       [&](Scheduler& s, Now now) { return s.resume_worker(request->worker_id(), now); });
}

namespace {

template <class Change>
grpc::Status change_trust(Farm& farm, const std::string& word, v1::TrustResponse* response, Change&& change) {
  return guarded([&] {
    if (farm.stopping()) return stopping_status();
    const Result<DistrustRow> row = farm.with_scheduler([&](Scheduler& s) { return change(s, farm.now()); });
    if (!row.ok() && row.error().mend.empty()) return not_found("worker", word);
    if (!row.ok()) return wire::to_status(row.error());
    *response->mutable_worker() = to_message(*row);
    if (auto flushed = farm.writer().flush(); !flushed.ok()) return wire::to_status(flushed.error());
    return grpc::Status::OK;
  });
}

}  // namespace

grpc::Status FarmServiceImpl::DistrustWorker(grpc::ServerContext*, const v1::WorkerRequest* request,
                                             v1::TrustResponse* response) {
  return guarded([&] {
    const std::string& word = request->worker_id();
    std::vector<MakerRow> makers;
    if (!farm_.worker(word)) {       // one that has left is known by what it brought
      (void)farm_.writer().flush();  // without room on the disk, by what it had brought before
      auto read = farm_.store().makers();
      if (!read.ok()) return wire::to_status(read.error());
      makers = std::move(*read);
    }
    return change_trust(farm_, word, response,
                        [&](Scheduler& s, Now now) { return s.distrust(word, now, makers); });
  });
}

grpc::Status FarmServiceImpl::TrustWorker(grpc::ServerContext*, const v1::WorkerRequest* request,
                                          v1::TrustResponse* response) {
  return change_trust(farm_, request->worker_id(), response,
                      [&](Scheduler& s, Now now) { return s.trust(request->worker_id(), now); });
}

grpc::Status FarmServiceImpl::GetLedger(grpc::ServerContext*, const v1::GetLedgerRequest* request,
                                        v1::GetLedgerResponse* response) {
  return guarded([&] {
    if (!farm_.status(request->job_id())) return not_found("job", request->job_id());
    return answer(farm_.ledger(request->job_id()), response);
  });
}

grpc::Status FarmServiceImpl::VerifyJobs(grpc::ServerContext* context, const v1::VerifyJobsRequest* request,
                                         grpc::ServerWriter<v1::JobReport>* writer) {
  return guarded([&] {
    const auto place = place_of(access_, *context, verifications_);
    if (!place.ok()) return too_many(place.error());
    std::vector<std::string> ids{request->job_id()};
    if (request->job_id().empty()) ids = farm_.with_scheduler([](Scheduler& s) { return job_ids(s); });
    for (const std::string& id : ids) {
      if (context->IsCancelled()) return grpc::Status(grpc::StatusCode::CANCELLED, "cancelled");
      if (farm_.stopping()) return stopping_status();
      if (!farm_.status(id)) return not_found("job", id);
      const auto report = farm_.truth().verify(id);
      if (!report.ok()) return wire::to_status(report.error());
      writer->Write(to_message(*report));
    }
    if (request->job_id().empty()) writer->Write(to_message(farm_.truth().verify_store()));
    return grpc::Status::OK;
  });
}

grpc::Status FarmServiceImpl::RepairJob(grpc::ServerContext*, const v1::JobRequest* request,
                                        v1::JobStatus* response) {
  return guarded([&] {
    if (farm_.stopping()) return stopping_status();
    const auto known = farm_.truth().repair(request->job_id());
    if (!known.ok()) return wire::to_status(known.error());
    if (!*known) return not_found("job", request->job_id());
    return answer(farm_.status(request->job_id()), response, "job", request->job_id());
  });
}

}  // namespace candela::master
