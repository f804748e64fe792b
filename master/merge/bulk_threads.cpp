#include "master/merge/bulk_threads.h"

#include <sys/resource.h>
#include <unistd.h>

#include "common/base/memory_limit.h"

namespace candela::master {

BulkThreads::BulkThreads(unsigned count, int niceness) {
  for (unsigned i = 0; i < count; ++i) threads_.emplace_back([this, niceness] { loop(niceness); });
}

BulkThreads::~BulkThreads() {
  {
    const Lock lock(mutex_);
    ended_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void BulkThreads::put(std::function<void()> work) {
  {
    const Lock lock(mutex_);
    waiting_.push_back(std::move(work));
  }
  changed_.notify_one();
}

void BulkThreads::loop(int niceness) {
  // Beside the master's own, which may have been started with another than 0. On Linux setpriority() changes
  // one thread. If it fails, the thread keeps its priority.
  if (niceness != 0)
    static_cast<void>(::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()),
                                    ::getpriority(PRIO_PROCESS, 0) + niceness));
  const LargeWork large;
  for (;;) {
    std::function<void()> work;
    {
      Lock lock(mutex_);
      changed_.wait(lock, [&]() CANDELA_REQUIRES(mutex_) { return ended_ || !waiting_.empty(); });
      if (waiting_.empty()) return;
      work = std::move(waiting_.front());
      waiting_.pop_front();
    }
    work();
  }
}

}  // namespace candela::master
