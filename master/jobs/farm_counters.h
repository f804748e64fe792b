// Counters since the start, for /metrics.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "master/jobs/delta_verdict.h"

namespace candela::master {

// Counters of notices (master/http/notices.h).
struct NoticeCounters {
  std::atomic<std::uint64_t> sent{0};     // taken by the receiver
  std::atomic<std::uint64_t> refused{0};  // by the receiver, for good
  std::atomic<std::uint64_t> dropped{0};  // too old or too many
  std::atomic<std::uint64_t> retries{0};  // failed tries of notices that stayed
};

struct FarmCounters {
  std::array<std::atomic<std::uint64_t>, kDeltaVerdicts> verdicts{};  // index: index_of(DeltaVerdict)
  std::atomic<std::uint64_t> delta_bytes{0};
  std::atomic<std::uint64_t> queue_full{0};
  std::atomic<std::uint64_t> leases{0};
  std::atomic<std::uint64_t> checkpoints{0};
  std::atomic<std::uint64_t> checkpoint_failures{0};
  std::atomic<std::uint64_t> merge_microseconds{0};
  std::atomic<std::uint64_t> upload_bytes{0};
  std::atomic<std::uint64_t> damaged_blobs{0};
  std::atomic<std::uint64_t> jobs_removed{0};
  std::atomic<std::uint64_t> blobs_collected{0}, blob_bytes_collected{0};
  NoticeCounters notices;
  std::atomic<std::uint64_t> blobs{0}, blob_bytes{0};  // that were kept by the latest collection
};

}  // namespace candela::master
