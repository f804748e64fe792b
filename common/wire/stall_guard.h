// Transfers over slow links: a stream may take as long as it needs while it moves, and ends where it does
// not.
#pragma once

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <thread>

#include "common/base/mutex.h"

namespace candela::wire {

// Bytes of a blob, an image or a delta in one message. A message is the smallest sign of progress that both
// sides see: at 8 KiB/s this one takes 8 s.
inline constexpr std::size_t kStreamBytes = 64 << 10;
// A stream in which no message moves for this long counts as hung.
inline constexpr std::chrono::seconds kStall{30};

// From the last byte that was written of `size_bytes` to the answer: up to 4 MiB wait in the buffers of a
// link, perhaps at 16 KiB/s, and the other side stores or merges what came.
constexpr std::chrono::seconds answer_limit(std::uint64_t size_bytes) {
  constexpr std::uint64_t kBuffered = 4 << 20, kSlowest = 16 << 10, kHandled = 10 << 20;
  return std::chrono::seconds(60 + std::min(size_bytes, kBuffered) / kSlowest + size_bytes / kHandled);
}

// Cancels a call in which nothing moves. The context must outlive the guard.
class StallGuard {
 public:
  using Clock = std::chrono::steady_clock;

  StallGuard(grpc::ClientContext& context, Clock::duration limit);
  ~StallGuard();
  StallGuard(const StallGuard&) = delete;
  StallGuard& operator=(const StallGuard&) = delete;

  // Something moved: from now on so long until the next sign.
  void allow(Clock::duration limit);
  // The status of the call, DEADLINE_EXCEEDED if this guard ended it.
  grpc::Status judge(const grpc::Status& status);

 private:
  void watch();

  grpc::ClientContext& context_;
  Mutex mutex_;
  std::condition_variable changed_;
  Clock::time_point deadline_ CANDELA_GUARDED_BY(mutex_);
  bool over_ CANDELA_GUARDED_BY(mutex_) = false, fired_ CANDELA_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace candela::wire
