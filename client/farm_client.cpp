#include "client/farm_client.h"

#include <fmt/format.h>
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <random>
#include <thread>
#include <utility>

#include "candela/v1/client.grpc.pb.h"
#include "client/retry.h"
#include "client/signals.h"
#include "common/base/hash.h"
#include "common/base/version.h"
#include "common/wire/dial.h"
#include "common/wire/stall_guard.h"
#include "common/wire/wire.h"

namespace candela::client {
namespace {

using Clock = std::chrono::steady_clock;

// A master that reads a film, or all files of all jobs, from its disk.
constexpr double kReadingSeconds = 600, kVerifyingSeconds = 24 * 3600;
constexpr int kMaxMessageBytes = 64 << 20;            // lists of jobs may be long; chunks are 1 MiB
constexpr std::uint64_t kMaxImageBytes = 1ULL << 36;  // of a fetched image
constexpr std::size_t kHashesPerCall = 1000;
constexpr std::chrono::seconds kImageMade{600};  // the master develops the film before it sends
constexpr double kWatchSeconds = 20;  // one stream; then a new one, so that a hung master is noticed

}  // namespace

struct FarmClient::State {
  std::unique_ptr<v1::FarmService::Stub> stub;
  std::string peer;  // for messages
  double timeout_seconds = 10;
  bool remote = true;

  Error error_of(const grpc::Status& status) const {
    Error error = wire::from_status(status);
    // A master of this process has no resource that comes back by waiting: its full disk is ours.
    if (remote && error.kind == ErrorKind::resource) {
      error.kind = ErrorKind::unreachable;
      error.message = fmt::format("the master at {} is overloaded: {}", peer, error.message);
      if (error.mend.empty()) error.mend = "try again later; --timeout says how long to try";
    } else if (error.kind == ErrorKind::unreachable) {
      error.message = fmt::format("cannot reach the master at {}: {}", peer, error.message);
      error.mend =
          "is it running, is this its address, and do both use TLS or neither? --timeout says how long to "
          "try";
    }
    return error;
  }

  // Maximum silence of a transfer.
  Clock::duration stall() const {
    return std::max<Clock::duration>(wire::kStall, std::chrono::duration_cast<Clock::duration>(
                                                       std::chrono::duration<double>(timeout_seconds)));
  }

  // Runs `call(context)` until it succeeds, fails for good, or the timeout is over.
  template <class Call>
  Result<void> repeat(const Call& call) const {
    const auto begin = Clock::now();
    Backoff backoff;
    for (;;) {
      grpc::ClientContext context;
      context.set_deadline(deadline_in(std::max(0.1, timeout_seconds - seconds_since(begin))));
      const grpc::Status status = call(context);
      if (status.ok()) return {};
      const double pause = std::max(backoff.next_seconds(), wire::retry_ms(status, 0) / 1000.0);
      if (!may_repeat(status) || seconds_since(begin) + pause >= timeout_seconds) return error_of(status);
      sleep_seconds(pause);
    }
  }

  template <class Response, class Request, class Method>
  Result<Response> unary(Method method, const Request& request) const {
    Response response;
    CANDELA_TRY(repeat([&](grpc::ClientContext& context) {
      response.Clear();
      return (stub.get()->*method)(&context, request, &response);
    }));
    return response;
  }

  // A call whose request is the id of a job, a group or a worker.
  template <class Request, class Response>
  Result<Response> call(grpc::Status (v1::FarmService::Stub::*method)(grpc::ClientContext*, const Request&,
                                                                      Response*),
                        const std::string& id) const {
    Request request;
    if constexpr (requires { request.set_job_id(id); })
      request.set_job_id(id);
    else if constexpr (requires { request.set_group_id(id); })
      request.set_group_id(id);
    else
      request.set_worker_id(id);
    return unary<Response>(method, request);
  }
};

std::string random_token() {
  std::random_device random;
  std::string token;
  for (int i = 0; i < 4; ++i) token += fmt::format("{:08x}", random());
  return token;
}

FarmClient::FarmClient(std::unique_ptr<State> state) : state_(std::move(state)) {}
FarmClient::~FarmClient() = default;

Result<std::unique_ptr<FarmClient>> FarmClient::create(const ConnectionOptions& options) {
  CANDELA_ASSIGN(const wire::Address address, wire::parse_address(options.master, "--master"));
  // A third of the timeout is left for another address of the host, for when the first one swallows what is
  // sent to it.
  const double attempt_seconds = std::clamp(options.timeout_seconds * 2 / 3, 2.0, 20.0);
  CANDELA_ASSIGN(const std::shared_ptr<grpc::Channel> channel,
                 wire::dial({.master = options.master,
                             .tls = {options.tls_cert, options.tls_key, options.tls_ca},
                             .token_file = options.token_file,
                             .insecure = options.insecure,
                             .max_receive_bytes = kMaxMessageBytes,
                             .min_backoff_ms = 100,
                             .max_backoff_ms = 1000,
                             .attempt_ms = static_cast<int>(attempt_seconds * 1000)}));
  auto state = std::make_unique<State>();
  state->stub = v1::FarmService::NewStub(channel);
  state->peer = address.text();
  state->timeout_seconds = options.timeout_seconds;
  return std::unique_ptr<FarmClient>(new FarmClient(std::move(state)));
}

std::unique_ptr<FarmClient> FarmClient::over(std::shared_ptr<grpc::Channel> channel, double timeout_seconds) {
  auto state = std::make_unique<State>();
  state->stub = v1::FarmService::NewStub(std::move(channel));
  state->peer = "this process";
  state->remote = false;
  state->timeout_seconds = timeout_seconds;
  return std::unique_ptr<FarmClient>(new FarmClient(std::move(state)));
}

Result<v1::GetServerInfoResponse> FarmClient::check_server() {
  CANDELA_ASSIGN(v1::GetServerInfoResponse info,
                 state_->unary<v1::GetServerInfoResponse>(&v1::FarmService::Stub::GetServerInfo,
                                                          v1::GetServerInfoRequest{}));
  if (info.protocol() != kProtocol)
    return refused_error(
               fmt::format(
                   "the master at {} (version {}) speaks protocol {}, this client (version {}) speaks {}",
                   state_->peer, info.version(), info.protocol(), version(), kProtocol))
        .with_mend("install one version on both");
  return info;
}

Result<std::vector<std::string>> FarmClient::find_missing(const std::vector<std::string>& sha256) {
  std::vector<std::string> missing;
  for (std::size_t begin = 0; begin < sha256.size(); begin += kHashesPerCall) {
    v1::FindMissingBlobsRequest request;
    for (std::size_t i = begin; i < std::min(sha256.size(), begin + kHashesPerCall); ++i)
      request.add_sha256(sha256[i]);
    CANDELA_ASSIGN(
        const v1::FindMissingBlobsResponse response,
        state_->unary<v1::FindMissingBlobsResponse>(&v1::FarmService::Stub::FindMissingBlobs, request));
    missing.insert(missing.end(), response.sha256().begin(), response.sha256().end());
  }
  return missing;
}

Result<void> FarmClient::upload_blob(const std::string& sha256, std::uint64_t size_bytes,
                                     const std::filesystem::path& file,
                                     const std::function<void(std::uint64_t)>& sent) {
  const auto changed = [&] {
    return input_error("the file changed while it was being sent")
        .at(file.string(), 0)
        .with_mend("submit again");
  };
  std::uint64_t furthest = 0;  // of all attempts
  Outage outage;
  Backoff backoff;
  for (;;) {
    std::ifstream in(file, std::ios::binary);
    if (!in) return input_error(fmt::format("cannot open: {}", std::strerror(errno))).at(file.string(), 0);
    grpc::ClientContext context;
    wire::StallGuard guard(context, state_->stall());
    v1::UploadBlobResponse response;
    const auto writer = state_->stub->UploadBlob(&context, &response);
    // Hash and size go alone: the master soon cuts off who has not said them, and a slow link is full of
    // data.
    v1::UploadBlobRequest header;
    header.set_sha256(sha256);
    header.set_size_bytes(size_bytes);
    const bool begun = writer->Write(header);

    Sha256 hash;
    std::uint64_t done = 0;
    bool intact = true;
    if (begun) do {  // an empty file is one empty chunk
        v1::UploadBlobRequest chunk;
        const std::uint64_t want = std::min<std::uint64_t>(wire::kStreamBytes, size_bytes - done);
        std::string data(want, '\0');
        in.read(data.data(), static_cast<std::streamsize>(want));
        intact = static_cast<std::uint64_t>(in.gcount()) == want;
        if (!intact) break;
        hash.update(data);
        done += want;
        // The last chunk leaves only if the whole is what was promised.
        if (done == size_bytes &&
            (hash.finish_hex() != sha256 || in.peek() != std::ifstream::traits_type::eof())) {
          intact = false;
          break;
        }
        chunk.set_data(std::move(data));
        if (!writer->Write(chunk)) break;  // the status says why
        guard.allow(state_->stall());
        if (std::exchange(furthest, std::max(furthest, done)) < done) outage.end();
        if (sent) sent(done);
      } while (done < size_bytes);
    if (!intact) {
      context.TryCancel();
      [[maybe_unused]] const grpc::Status cancelled = writer->Finish();
      return changed();
    }
    writer->WritesDone();
    guard.allow(wire::answer_limit(size_bytes));
    const grpc::Status status = guard.judge(writer->Finish());
    if (status.ok()) return {};
    if (!broke_off(status)) return state_->error_of(status);
    const double pause = std::max(backoff.next_seconds(), wire::retry_ms(status, 0) / 1000.0);
    if (outage.seconds() + pause >= state_->timeout_seconds) return state_->error_of(status);
    sleep_seconds(pause);
  }
}

Result<v1::SubmitResponse> FarmClient::submit(const v1::SubmitRequest& request) {
  return state_->unary<v1::SubmitResponse>(&v1::FarmService::Stub::Submit, request);
}

Result<v1::ListJobsResponse> FarmClient::list_jobs(const JobQuery& query) {
  constexpr std::uint64_t kPage = 500;
  v1::ListJobsResponse all;
  v1::ListJobsRequest request;
  request.mutable_states()->Assign(query.states.begin(), query.states.end());
  request.set_page_token(query.page_token);
  request.set_name(query.name);
  request.set_submitter(query.submitter);
  request.set_fold(query.fold);
  request.set_group_id(query.group_id);
  const auto size = [&] { return static_cast<std::uint64_t>(all.jobs_size() + all.groups_size()); };
  for (;;) {
    const std::uint64_t left = query.limit - size();
    request.set_page_size(static_cast<std::uint32_t>(std::min(left, kPage)));
    CANDELA_ASSIGN(v1::ListJobsResponse page,
                   state_->unary<v1::ListJobsResponse>(&v1::FarmService::Stub::ListJobs, request));
    for (v1::JobStatus& job : *page.mutable_jobs()) *all.add_jobs() = std::move(job);
    for (v1::GroupStatus& group : *page.mutable_groups()) *all.add_groups() = std::move(group);
    all.set_total(page.total());
    all.set_next_page_token(page.next_page_token());
    // A page may be empty where its jobs have changed; a master that repeats a token is not followed for
    // ever.
    if (page.next_page_token().empty() || page.next_page_token() == request.page_token() ||
        size() >= query.limit)
      return all;
    request.set_page_token(page.next_page_token());
  }
}

Result<v1::JobStatus> FarmClient::get_job(const std::string& id) {
  return state_->call(&v1::FarmService::Stub::GetJob, id);
}

Result<v1::FindJobsResponse> FarmClient::find_jobs(const std::vector<std::string>& words) {
  v1::FindJobsRequest request;
  request.mutable_words()->Assign(words.begin(), words.end());
  v1::FindJobsResponse response;
  bool unknown_call = false;
  const Result<void> done = state_->repeat([&](grpc::ClientContext& context) {
    response.Clear();
    const grpc::Status status = state_->stub->FindJobs(&context, request, &response);
    unknown_call = status.error_code() == grpc::StatusCode::UNIMPLEMENTED;
    return status;
  });
  if (!done.ok() && !unknown_call) return done.error();
  if (!done.ok()) {
    response.Clear();
    for (const std::string& word : words) {
      v1::FoundJobs& found = *response.add_found();
      found.set_word(word);
      found.set_total(1);
      found.add_jobs()->set_id(word);
    }
  }
  return response;
}

Result<v1::GroupStatus> FarmClient::get_group(const std::string& id) {
  return state_->call(&v1::FarmService::Stub::GetGroup, id);
}

Result<v1::GroupStatus> FarmClient::steer_group(v1::SteerGroupRequest request) {
  if (request.has_extend() && request.extend().idempotency_token().empty())
    request.mutable_extend()->set_idempotency_token(random_token());
  return state_->unary<v1::GroupStatus>(&v1::FarmService::Stub::SteerGroup, request);
}

Result<v1::JobStatus> FarmClient::pause_job(const std::string& id) {
  return state_->call(&v1::FarmService::Stub::PauseJob, id);
}
Result<v1::JobStatus> FarmClient::resume_job(const std::string& id) {
  return state_->call(&v1::FarmService::Stub::ResumeJob, id);
}
Result<v1::JobStatus> FarmClient::cancel_job(const std::string& id) {
  return state_->call(&v1::FarmService::Stub::CancelJob, id);
}

Result<v1::JobStatus> FarmClient::set_priority(const std::string& id, std::int32_t priority) {
  v1::SetPriorityRequest request;
  request.set_job_id(id);
  request.set_priority(priority);
  return state_->unary<v1::JobStatus>(&v1::FarmService::Stub::SetPriority, request);
}

Result<v1::JobStatus> FarmClient::repair_job(const std::string& id) {
  v1::JobRequest request;
  request.set_job_id(id);
  v1::JobStatus response;
  CANDELA_TRY(state_->repeat([&](grpc::ClientContext& context) {
    context.set_deadline(deadline_in(state_->timeout_seconds + kReadingSeconds));
    return state_->stub->RepairJob(&context, request, &response);
  }));
  return response;
}

Result<void> FarmClient::verify_jobs(const std::string& id,
                                     const std::function<void(const v1::JobReport&)>& on_report) {
  CANDELA_TRY(check_server());
  v1::VerifyJobsRequest request;
  request.set_job_id(id);
  bool any = false;
  const auto begin = Clock::now();
  Backoff backoff;
  for (;;) {
    grpc::ClientContext context;
    context.set_deadline(deadline_in(kVerifyingSeconds));
    const auto reader = state_->stub->VerifyJobs(&context, request);
    for (v1::JobReport report; reader->Read(&report); any = true) on_report(report);
    const grpc::Status status = reader->Finish();
    if (status.ok()) return {};
    // Reports that came are not asked for again.
    const double pause = backoff.next_seconds();
    if (any || !may_repeat(status) || seconds_since(begin) + pause >= state_->timeout_seconds)
      return state_->error_of(status);
    sleep_seconds(pause);
  }
}

Result<v1::JobStatus> FarmClient::extend_job(const v1::ExtendJobRequest& request) {
  // Only a master that cannot be found leaves the job surely as it was. The call itself has a token, by which
  // a master knows one that it has done, so it can be repeated.
  CANDELA_TRY(check_server());
  v1::ExtendJobRequest call = request;
  if (call.idempotency_token().empty()) call.set_idempotency_token(random_token());
  v1::JobStatus response;
  bool unknown = false;  // whether some attempt was made
  const Result<void> done = state_->repeat([&](grpc::ClientContext& context) {
    response.Clear();
    const grpc::Status status = state_->stub->ExtendJob(&context, call, &response);
    unknown = unknown || (!status.ok() && status.error_code() != grpc::StatusCode::RESOURCE_EXHAUSTED);
    return status;
  });
  if (done.ok()) return response;
  Error error = done.error();
  if (error.kind != ErrorKind::unreachable || !unknown) return error;
  error.kind = ErrorKind::failed;  // whoever repeats the command may extend the job twice
  error.mend =
      fmt::format("the job may or may not be extended: look with `candela show {}` first", request.job_id());
  return error;
}

Result<v1::ListEventsResponse> FarmClient::list_events(const std::string& job_id, std::uint32_t limit) {
  v1::ListEventsRequest request;
  request.set_job_id(job_id);
  request.set_limit(limit);
  return state_->unary<v1::ListEventsResponse>(&v1::FarmService::Stub::ListEvents, request);
}

Result<v1::ListWorkersResponse> FarmClient::list_workers() {
  return state_->unary<v1::ListWorkersResponse>(&v1::FarmService::Stub::ListWorkers,
                                                v1::ListWorkersRequest{});
}

Result<v1::WorkerStatus> FarmClient::drain_worker(const std::string& id) {
  return state_->call(&v1::FarmService::Stub::DrainWorker, id);
}

Result<v1::WorkerStatus> FarmClient::pause_worker(const std::string& id) {
  return state_->call(&v1::FarmService::Stub::PauseWorker, id);
}

Result<v1::WorkerStatus> FarmClient::resume_worker(const std::string& id) {
  return state_->call(&v1::FarmService::Stub::ResumeWorker, id);
}

Result<v1::TrustResponse> FarmClient::distrust_worker(const std::string& id) {
  return state_->call(&v1::FarmService::Stub::DistrustWorker, id);
}

Result<v1::TrustResponse> FarmClient::trust_worker(const std::string& word) {
  return state_->call(&v1::FarmService::Stub::TrustWorker, word);
}

Result<std::string> FarmClient::fetch_image(const std::string& id, const ImageRequest& image) {
  v1::FetchImageRequest request;
  request.set_job_id(id);
  request.set_error_layer(image.error_layer);
  request.set_image_only(image.image_only);
  request.set_chain_layers(image.chain_layers);
  request.set_partial(image.partial);
  request.set_state_layers(image.state_layers);
  request.set_estimator(image.estimator);
  request.set_half(image.half);
  request.set_variance_layer(image.variance_layer);
  std::string data, sha256;
  std::uint64_t total = 0;
  Outage outage;
  Backoff backoff;
  for (;;) {
    grpc::ClientContext context;
    wire::StallGuard guard(context, data.empty() ? kImageMade : state_->stall());
    request.set_sha256(sha256);
    request.set_offset(data.size());
    const auto reader = state_->stub->FetchImage(&context, request);
    v1::FetchImageChunk chunk;
    bool first = true, sound = true;
    while (sound && reader->Read(&chunk)) {
      if (first && (chunk.sha256() != sha256 || chunk.offset() != data.size())) {
        data.clear();  // the master has another image by now, and sends that
        sha256 = chunk.sha256();
        sound = chunk.offset() == 0;
      }
      if (first) total = chunk.total_bytes();
      first = false;
      sound = sound && total <= kMaxImageBytes && data.size() + chunk.data().size() <= total;
      if (sound) data += chunk.data();
      guard.allow(state_->stall());
      outage.end();
      backoff.reset();
    }
    if (!sound) context.TryCancel();
    const grpc::Status status = guard.judge(reader->Finish());
    if (!sound || (status.ok() && (data.size() != total || sha256_hex(data) != sha256)))
      return failed_error(
          fmt::format("the master at {} sent other bytes of an image than it said", state_->peer));
    if (status.ok()) return data;
    const bool nothing_came = first && status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
    if (nothing_came || !broke_off(status)) return state_->error_of(status);
    const double pause = std::max(backoff.next_seconds(), wire::retry_ms(status, 0) / 1000.0);
    if (outage.seconds() + pause >= state_->timeout_seconds) return state_->error_of(status);
    sleep_seconds(pause);
  }
}

Result<v1::JobStatus> FarmClient::watch_job(const std::string& id, std::uint32_t interval_ms,
                                            const std::function<void(const v1::JobStatus&)>& on_status,
                                            const StopSignals* stop, const std::function<bool()>& give_up) {
  v1::WatchJobRequest request;
  request.set_job_id(id);
  request.set_interval_ms(interval_ms);
  const auto should_stop = [&] {
    return (stop != nullptr && stop->pending() != 0) || (give_up && give_up());
  };

  v1::JobStatus last;
  auto last_answer = Clock::now();
  Backoff backoff;
  for (;;) {
    if (should_stop()) return last;
    grpc::ClientContext context;
    // Never longer than the timeout without noticing that nobody answers, never so short that streams churn.
    context.set_deadline(deadline_in(std::max(kWatchSeconds, state_->timeout_seconds)));
    const auto reader = state_->stub->WatchJob(&context, request);

    // A blocked Read wakes by cancelling its context from elsewhere.
    std::atomic<bool> reading{true};
    std::atomic<bool> stopped{false};
    std::atomic<bool> answered{false};
    std::thread watcher([&] {
      const auto stream_begin = Clock::now();
      while (reading) {
        const bool silent = !answered && seconds_since(stream_begin) > state_->timeout_seconds;
        if (should_stop() || silent) {
          stopped = !silent;
          context.TryCancel();
          return;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
    });
    v1::JobStatus status_now;
    while (reader->Read(&status_now)) {
      answered = true;
      last_answer = Clock::now();
      backoff.reset();
      last = status_now;
      if (on_status) on_status(last);
      status_now.Clear();
    }
    reading = false;
    watcher.join();
    const grpc::Status status = reader->Finish();
    if (has_ended(last) || stopped) return last;
    if (answered && status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED)
      continue;  // our own clock: a new stream
    const bool lost = status.ok() || may_repeat(status) ||
                      status.error_code() == grpc::StatusCode::CANCELLED ||
                      status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
    if (!lost) return state_->error_of(status);
    const double pause = backoff.next_seconds();
    if (seconds_since(last_answer) + pause >= state_->timeout_seconds)
      return state_->error_of(status.ok() || status.error_code() == grpc::StatusCode::CANCELLED
                                  ? grpc::Status(grpc::StatusCode::UNAVAILABLE, "no answer in time")
                                  : status);
    sleep_seconds(pause);
  }
}

bool has_ended(const v1::JobStatus& status) {
  return status.state() == v1::JOB_STATE_DONE || status.state() == v1::JOB_STATE_FAILED ||
         status.state() == v1::JOB_STATE_CANCELLED;
}

}  // namespace candela::client
