// A worker as a library: leases units from a master, renders them, pushes deltas.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "common/base/result.h"

namespace grpc {
class Channel;
}

namespace candela::worker {

struct WorkerOptions {
  std::string master;                     // HOST:PORT; ignored where a channel is given
  std::filesystem::path cache_dir;
  std::uint64_t cache_limit_bytes = 20ULL << 30;
  unsigned threads = 0;                   // 0: all cores
  std::string name;                       // empty: the host's name
  std::string tls_cert, tls_key, tls_ca;  // PEM files; all three or none
  bool insecure = false;                  // allow a non-loopback master without TLS
  std::uint64_t scene_memory_bytes = 0;   // compiled scenes kept; 0: half the machine's memory
  double give_up_seconds = 0;             // without reaching a master; 0: never
  bool compress_in_process = true;
};

class Worker {
 public:
  virtual ~Worker() = default;  // drains
  // Starts threads and returns at once. With `channel` null it dials options.master, with backoff and jitter, for ever
  // (or give_up_seconds). A refusal at registration (other protocol or build) ends it with an error from wait().
  static Result<std::unique_ptr<Worker>> start(const WorkerOptions& options, std::shared_ptr<grpc::Channel> channel);

  // Finish or hand back: stops rendering, returns all leases, delivers what is finished, deregisters. Idempotent.
  virtual void drain() = 0;
  // Returns when the worker has ended: drained (by us or by the master), given up, or refused.
  virtual Result<void> wait() = 0;
};

}  // namespace candela::worker
