// The memory that a master needs for a job, from its settings and its plan of work: asked before the memory
// is taken.
#pragma once

#include <cstdint>
#include <string>

#include "common/base/result.h"
#include "common/job/job.h"
#include "common/stages/work_plan.h"

namespace candela {

// Bytes. Every pixel has sums of 64 bits: most jobs have them in all tiles after a few iterations.
struct MemoryNeed {
  std::uint64_t film = 0;        // both halves, all layers
  std::uint64_t statistics = 0;  // statistics_bytes() of decision.h
  std::uint64_t chains = 0;      // the bootstrap's table, and a record for each chain
  // For a time, and for one job after another: a copy of the film and its checkpoint, or an image.
  std::uint64_t working = 0;

  std::uint64_t held() const { return film + statistics + chains; }
  std::uint64_t all() const { return held() + working; }
  bool operator==(const MemoryNeed&) const = default;
};

// The state of a chain in its record, until one is known.
inline constexpr std::uint64_t kGuessedRecordBytes = 512;

// Preconditions: the size is within Limits, and validate() holds for the plan. `record_bytes`: of the largest
// chain record that is known, encoded.
MemoryNeed memory_need(const WorkPlan& plan, std::uint32_t width, std::uint32_t height,
                       std::uint64_t record_bytes = kGuessedRecordBytes);

// Fails (input) if the job needs more than a master may ever take for jobs. The error has the figures.
Result<void> check_memory(const MemoryNeed& need, const JobSettings& settings, std::uint64_t limit_bytes);

// "12.9 GB", "48 MB", rounded up: for people.
std::string memory_text(std::uint64_t bytes);

}  // namespace candela
