// Workers without renderers: a thousand of them in one process, each with a connection, a session and leases
// of its own. They speak the worker's side of the protocol as candela-worker does (one unit rendered, one
// prefetched, one delivered), wait where it renders, and hand in recorded deltas.
#pragma once

#include <grpcpp/grpcpp.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tests/scale/recording.h"

namespace candela::scale {

struct SwarmOptions {
  std::string address;
  std::size_t workers = 1000;
  unsigned threads_per_worker = 16;  // as told to the master
  double seconds_per_iteration = 1;  // of a worker of middle speed
  double spread = 2;                 // the fastest worker is so many times as fast as the slowest
  double ramp_seconds = 2;           // in which the workers register
};

// All that happened, or within a window between two calls of counts().
struct SwarmCounts {
  std::uint64_t leases = 0, empty_answers = 0, pilots = 0, merged = 0, other_verdicts = 0, queue_full = 0;
  std::uint64_t failed_calls = 0, revoked = 0, cut = 0, delta_bytes = 0;
  std::map<std::string, double> busy_seconds;                         // of rendering, by job
  std::vector<float> lease_seconds, heartbeat_seconds, push_seconds;  // of calls that were answered
  std::string last_failure;
};

class SwarmWorker;

class Swarm {
 public:
  Swarm(const SwarmOptions& options, const Recording& recording);
  ~Swarm();  // leaves at once, as if the machine lost its power
  Swarm(const Swarm&) = delete;
  Swarm& operator=(const Swarm&) = delete;

  // Which of the recordings is handed in for a unit.
  static std::size_t recording_of(std::uint64_t unit_id, const Recording& recording) {
    return static_cast<std::size_t>(unit_id % recording.count());
  }
  // Since the call before this one.
  SwarmCounts counts();
  std::size_t registered() const { return registered_; }
  // Deltas of this job are packed before all others.
  void hurry(std::string job);

 private:
  friend class SwarmWorker;
  void poll();
  void pack_loop();
  // Runs `make` on the thread that makes deltas, which is not to hold up calls that are being timed.
  // first: before all others.
  void pack(bool first, std::function<void()> make);
  bool hurries(const std::string& job);
  // A tag of the completion queue.
  void* tag(std::function<void(bool ok)> done);

  const SwarmOptions options_;
  const Recording& recording_;
  grpc::CompletionQueue queue_;
  std::atomic<bool> over_{false};
  std::atomic<std::size_t> registered_{0}, under_way_{0};
  std::mutex mutex_;  // of the counts; taken after a worker's
  SwarmCounts counts_;
  std::mutex pack_mutex_;  // of the three below; taken after a worker's
  std::condition_variable packing_;
  std::deque<std::function<void()>> to_pack_;
  std::string hurried_;
  std::vector<std::unique_ptr<SwarmWorker>> workers_;
  std::vector<std::thread> threads_;
};

}  // namespace candela::scale
