// Threads for long work of a master.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "master/merge/bulk_threads.h"

namespace candela::master {
namespace {

int niceness() {
  return ::getpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()));
}

// Claim: work runs on a thread of the niceness that was asked for, results and exceptions come back, and the
// caller keeps its own priority.
TEST(BulkThreads, RunWorkAtTheirPriority) {
  const int own = niceness();
  for (const int asked : {0, 5}) {
    BulkThreads bulk(1, asked);
    EXPECT_EQ(bulk.run([] { return niceness(); }), asked == 0 ? own : 5);
    EXPECT_EQ(bulk.run([] { return std::string("text"); }), "text");
    EXPECT_THROW(bulk.run([]() -> int { throw std::runtime_error("no"); }), std::runtime_error);
    EXPECT_NE(bulk.run([] { return std::this_thread::get_id(); }), std::this_thread::get_id());
    bool done = false;
    bulk.run([&] { done = true; });
    EXPECT_TRUE(done);
  }
  EXPECT_EQ(niceness(), own);
}

// Claim: as many run at once as there are threads, and all callers are served.
TEST(BulkThreads, ServeAllCallers) {
  BulkThreads bulk(2, 0);
  std::atomic<int> running{0}, most{0}, served{0};
  std::vector<std::thread> callers;
  for (int i = 0; i < 16; ++i)
    callers.emplace_back([&] {
      for (int k = 0; k < 20; ++k) {
        const int result = bulk.run([&] {
          const int now = ++running;
          int before = most;
          while (before < now && !most.compare_exchange_weak(before, now)) {
          }
          std::this_thread::yield();
          --running;
          return k;
        });
        served += result == k ? 1 : 0;
      }
    });
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(served, 16 * 20);
  EXPECT_LE(most, 2);
}

}  // namespace
}  // namespace candela::master
