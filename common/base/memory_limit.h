// Finds the limit of a process's memory, and keeps a reserve for when the system has no more.
//
// Allocations of a service are of two kinds. Small ones (a row, a message) must not fail, for many change
// more than one thing; large ones (films, checkpoints, images) may, and are made within a LargeWork. A
// MemoryReserve gives its bytes to small ones when the system has no more; a large one then fails with
// std::bad_alloc, which within_memory() turns into an error.
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <string>
#include <string_view>
#include <type_traits>

#include "common/base/mutex.h"
#include "common/base/result.h"

namespace candela {

// The memory that this process may take: the least of the machine's, of the limits of its control groups
// (versions 1 and 2), and of its address space (less what it has taken).
std::uint64_t memory_limit_bytes();
// The least limit of memory of the control groups that `groups`, the text of /proc/self/cgroup, names below
// `root`, /sys/fs/cgroup; no limit: the largest number.
std::uint64_t group_memory_limit(std::string_view groups, const std::string& root);

// While one lives, allocations of its thread do not take the reserve.
class LargeWork {
 public:
  LargeWork();
  ~LargeWork();
  LargeWork(const LargeWork&) = delete;
  LargeWork& operator=(const LargeWork&) = delete;
  static bool here();  // on this thread
};

// While one lives, the thread's allocations are small work, whatever it is in: under a lock that others wait
// for, where much changes together.
class SmallWork {
 public:
  SmallWork();
  ~SmallWork();
  SmallWork(const SmallWork&) = delete;
  SmallWork& operator=(const SmallWork&) = delete;

 private:
  int large_works_;
};

// One at a time in a process: it is the process's std::new_handler.
class MemoryReserve {
 public:
  explicit MemoryReserve(std::size_t bytes);
  ~MemoryReserve();
  MemoryReserve(const MemoryReserve&) = delete;
  MemoryReserve& operator=(const MemoryReserve&) = delete;
  // Takes the reserve again if it was given away. True if it was since the last call.
  bool refill();
};

// "out of memory": what could not be done for want of it.
Error out_of_memory(std::string_view what);

// The result of `f`, which is a Result, or an error (resource) if memory runs out in it. `what` cannot be
// done then, as in "the film cannot be read". `f` may need a mutex that the caller holds.
template <class F>
std::invoke_result_t<F> within_memory(std::string_view what, F&& f) CANDELA_UNANALYZED {
  try {
    const LargeWork large;
    return f();
  } catch (const std::bad_alloc&) {
    return out_of_memory(what);
  }
}

}  // namespace candela
