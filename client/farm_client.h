// The client's end of proto/candela/v1/client.proto: every call has a deadline, what may be repeated is
// repeated with backoff for a bounded time, and every failure comes back as an Error that names the master.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "candela/v1/client.pb.h"
#include "common/base/result.h"

namespace grpc {
class Channel;
}

namespace candela::client {

class StopSignals;

// Selects an image of a job, and its layers.
struct ImageRequest {
  bool error_layer = false;
  bool image_only = false;     // without the job's further layers
  bool chain_layers = false;   // with what an image of Markov chains is made of
  bool partial = false;        // of an ended job that has lost samples, what is left; refused otherwise
  bool state_layers = false;   // with what describes the newest state of a job of epochs
  std::string estimator = {};  // one that the job's development offers; empty: the job's own
  v1::FetchImageRequest::Half half = v1::FetchImageRequest::HALF_UNSPECIFIED;
  bool variance_layer = false;
};

struct ConnectionOptions {
  std::string master;                     // HOST:PORT
  std::string tls_cert, tls_key, tls_ca;  // PEM files; all three or none
  std::string token_file;                 // of a master without TLS; empty: the one that this user's made
  bool insecure = false;                  // allow a non-loopback master without TLS
  double timeout_seconds = 10;            // until an answer, retries included
};

// An idempotency token.
std::string random_token();

class FarmClient {
 public:
  // Dials nothing yet: bad addresses and credentials are told here, an absent master by the first call.
  static Result<std::unique_ptr<FarmClient>> create(const ConnectionOptions& options);
  // Over a channel that is there already, such as the embedded farm's.
  static std::unique_ptr<FarmClient> over(std::shared_ptr<grpc::Channel> channel, double timeout_seconds);
  ~FarmClient();

  // Refused where the master speaks another protocol than we.
  Result<v1::GetServerInfoResponse> check_server();

  Result<std::vector<std::string>> find_missing(const std::vector<std::string>& sha256);
  // Streams the file in chunks of at most 1 MiB, hashing as it goes. A file whose bytes are no longer those
  // of `sha256` is an input error and nothing is stored. `sent` hears of bytes as they leave (of this blob,
  // again from 0 on a retry). Goes on as long as bytes leave, however slowly.
  Result<void> upload_blob(const std::string& sha256, std::uint64_t size_bytes,
                           const std::filesystem::path& file, const std::function<void(std::uint64_t)>& sent);
  // Precondition: request.idempotency_token is not empty, for it may be sent twice.
  Result<v1::SubmitResponse> submit(const v1::SubmitRequest& request);

  // The newest `limit` jobs (with `fold` and groups), the newest first: of these states (none: all), and
  // after the place that `page_token` tells (empty: from the newest). The answer's next_page_token goes on.
  struct JobQuery {
    std::uint64_t limit = ~std::uint64_t{0};
    std::string page_token = {};
    std::vector<v1::JobState> states = {};
    std::string name = {};       // a pattern of a shell
    std::string submitter = {};  // with TLS the master takes that of the certificate
    bool fold = false;           // groups in place of their frames
    std::string group_id = {};   // the frames of this one
  };
  Result<v1::ListJobsResponse> list_jobs(const JobQuery& query);
  Result<v1::JobStatus> get_job(const std::string& id);
  // Asks for the jobs that each word may mean. For a master without this call each word is an id.
  Result<v1::FindJobsResponse> find_jobs(const std::vector<std::string>& words);
  Result<v1::GroupStatus> get_group(const std::string& id);
  // An extension gets a token, by which a repeated call adds once.
  Result<v1::GroupStatus> steer_group(v1::SteerGroupRequest request);
  Result<v1::JobStatus> pause_job(const std::string& id);
  Result<v1::JobStatus> resume_job(const std::string& id);
  Result<v1::JobStatus> cancel_job(const std::string& id);
  Result<v1::JobStatus> set_priority(const std::string& id, std::int32_t priority);
  // Queues what an ended job has lost, or takes in the job of a folder that the master's store does not know.
  Result<v1::JobStatus> repair_job(const std::string& id);
  // Calls `on_report` for each job (of `id`, or of all if it is empty) as the master has read its files.
  Result<void> verify_jobs(const std::string& id, const std::function<void(const v1::JobReport&)>& on_report);
  // Sent once only, since it adds: after a lost connection the error says to look.
  Result<v1::JobStatus> extend_job(const v1::ExtendJobRequest& request);
  Result<v1::ListEventsResponse> list_events(const std::string& job_id, std::uint32_t limit);
  Result<v1::ListWorkersResponse> list_workers();
  // Marks it and returns at once; when its last lease is gone the worker's state is "drained".
  Result<v1::WorkerStatus> drain_worker(const std::string& id);
  Result<v1::WorkerStatus> pause_worker(const std::string& id);
  Result<v1::WorkerStatus> resume_worker(const std::string& id);
  Result<v1::TrustResponse> distrust_worker(const std::string& id);
  Result<v1::TrustResponse> trust_worker(const std::string& word);  // an id, HOST/NAME, or NAME

  // The image of what is merged now, the bytes of an EXR file. Goes on as long as bytes come, however slowly;
  // after a lost connection from the byte it has.
  Result<std::string> fetch_image(const std::string& id, const ImageRequest& image);

  // Calls `on_status` now, at each change, and at the end of the job. Returns the last status: of an ended
  // job, or, where `stop` is given and a signal came or `give_up` returned true, of one that goes on. A
  // master that is away for longer than the timeout is an error; a shorter absence is waited out.
  Result<v1::JobStatus> watch_job(const std::string& id, std::uint32_t interval_ms,
                                  const std::function<void(const v1::JobStatus&)>& on_status,
                                  const StopSignals* stop, const std::function<bool()>& give_up = {});

 private:
  struct State;
  explicit FarmClient(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

bool has_ended(const v1::JobStatus& status);  // done, failed or cancelled

}  // namespace candela::client
