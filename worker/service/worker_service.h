// A worker as a library: leases units from a master, renders them, pushes deltas.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "common/base/result.h"

namespace grpc {
class Channel;
}

namespace candela::worker {

struct WorkerOptions {
  std::string master;  // HOST:PORT; ignored where a channel is given
  std::filesystem::path cache_dir;
  // BlobCache::Beside; empty: files come from the master alone.
  std::function<std::filesystem::path(const std::string& sha256)> blobs_beside;
  std::uint64_t cache_limit_bytes = 20ULL << 30;
  unsigned threads = 0;                   // 0: all cores
  std::string name;                       // empty: the host's name
  std::string tls_cert, tls_key, tls_ca;  // PEM files; all three or none
  std::filesystem::path token_file;       // of a master without TLS; empty: the one that this user's made
  bool insecure = false;                  // allow a non-loopback master without TLS
  std::uint64_t scene_memory_bytes = 0;   // compiled scenes kept; 0: half the machine's memory
  std::uint64_t reading_memory_bytes =
      0;  // that a scene may take while it is read; 0: ReadingBudget's default
  // Decoded texels of a scene beyond this lie in an unlinked file; 0: a quarter of the machine's memory.
  std::uint64_t texture_memory_bytes = 0;
  std::filesystem::path scratch_dir;  // of that file; empty: the cache's folder
  double give_up_seconds = 0;         // without reaching a master; 0: never
};

class Worker {
 public:
  // Drains, and waits for all threads.
  virtual ~Worker() = default;
  // Starts threads and returns at once. With `channel` null it dials options.master, with backoff and jitter,
  // for ever (or give_up_seconds). A refusal at registration (other protocol or build) ends it with an error
  // from wait().
  static Result<std::unique_ptr<Worker>> start(const WorkerOptions& options,
                                               std::shared_ptr<grpc::Channel> channel);

  // Asks for the end and returns at once: the unit under way is cut short if its iteration is within two
  // seconds of its end, else stopped and handed back; finished deltas are delivered (for at most twenty
  // seconds), then the worker deregisters and wait() returns. Idempotent; from any thread, not from a signal
  // handler.
  virtual void drain() = 0;
  // Returns when the worker has ended: drained (by us or by the master), given up, or refused.
  virtual Result<void> wait() = 0;
  // After wait(): the renderer was told to stop and did not. Only the end of the process ends it; a new one
  // is wanted in its place.
  virtual bool must_begin_again() const = 0;
};

}  // namespace candela::worker
