// Low-priority threads for work of tens of milliseconds and more: hashes, merges, checkpoints, images. On
// busy processors the kernel preempts a thread that holds the scheduler's lock for such work, and every lease
// waits; low priority makes this rare.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/base/mutex.h"

namespace candela::master {

class BulkThreads {
 public:
  // niceness: 0 to 19, as nice(1) has it.
  BulkThreads(unsigned count, int niceness);
  // Work that has begun is finished; nobody may call run() any more.
  ~BulkThreads();
  BulkThreads(const BulkThreads&) = delete;
  BulkThreads& operator=(const BulkThreads&) = delete;

  // Runs `work` on one of the threads, waits for it and returns its result; exceptions come through.
  // Preconditions: `work` takes no lock that a lease waits for, and calls no run().
  template <class F>
  auto run(F&& work) {
    std::packaged_task<std::invoke_result_t<F>()> task(std::forward<F>(work));
    auto result = task.get_future();
    put([&task] { task(); });
    return result.get();
  }

 private:
  void put(std::function<void()> work);
  void loop(int niceness);

  Mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> waiting_ CANDELA_GUARDED_BY(mutex_);
  bool ended_ CANDELA_GUARDED_BY(mutex_) = false;
  std::vector<std::thread> threads_;
};

}  // namespace candela::master
