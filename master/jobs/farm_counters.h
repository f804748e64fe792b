// Counters since the start, for /metrics.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "master/jobs/delta_verdict.h"

namespace candela::master {

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
  std::atomic<std::uint64_t> blobs{0}, blob_bytes{0};  // that were kept by the latest collection
};

}  // namespace candela::master
