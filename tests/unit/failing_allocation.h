// Allocations that fail on demand, and how much memory is taken. The binary needs failing_allocation.inc in
// one of its sources: it replaces operator new.
#pragma once

#include <cstddef>
#include <cstdint>

namespace candela::test {

struct Allocations {
  // The allocation of at least `min_bytes` after `skip` such ones fails, and each such one after it.
  bool armed = false;
  std::size_t min_bytes = 0;
  std::uint64_t skip = 0;
  std::uint64_t failed = 0;
  std::int64_t live_bytes = 0;  // of this thread, as the allocator rounds them
};
Allocations& allocations();  // of this thread

// While it lives allocations of this thread fail.
class FailingAllocations {
 public:
  FailingAllocations(std::size_t min_bytes, std::uint64_t skip) {
    allocations() = {true, min_bytes, skip, 0, allocations().live_bytes};
  }
  ~FailingAllocations() { allocations().armed = false; }
  FailingAllocations(const FailingAllocations&) = delete;
  FailingAllocations& operator=(const FailingAllocations&) = delete;
  static std::uint64_t failed() { return allocations().failed; }
};

}  // namespace candela::test
