// Work that is watched: steps are counted, a stop ends it, other threads and other work are not concerned.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <thread>

#include "common/base/daemon.h"
#include "common/base/work_monitor.h"

namespace candela {
namespace {

// Claim: without a monitor a step is nothing; with one it counts, in the scope of its WatchedWork and in its
// thread alone, and throws once the work is to stop.
TEST(WorkMonitor, CountsAndStops) {
  work_step();
  WorkMonitor outer, inner;
  {
    const WatchedWork watch(&outer);
    work_step();
    {
      const WatchedWork again(&inner);
      inner.stop = true;
      EXPECT_THROW(work_step(), WorkStopped);
      EXPECT_EQ(watched_work(), &inner);
    }
    for (std::size_t i = 0; i < 3000; ++i) work_step(i);
    std::thread([] { work_step(); }).join();
    work_phase(WorkPhase::building);
  }
  EXPECT_EQ(outer.steps, 5U) << "one, those of 0, 1024 and 2048, and one of a phase";
  EXPECT_EQ(outer.phase, WorkPhase::building);
  EXPECT_EQ(inner.steps, 1U);
  work_step();
}

// Claim: a process begins again with other arguments though one of its threads never ends; files that it had
// open are closed.
TEST(Process, BeginsAgainWhateverItsThreadsDo) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    std::thread([] {
      for (volatile int i = 0;;) i = i + 1;
    }).detach();
    std::string name = "tests", list = "--gtest_list_tests", only = "--gtest_filter=Nothing.*";
    char* arguments[] = {name.data(), list.data(), only.data(), nullptr};
    begin_again(arguments);
    std::_Exit(17);
  }
  ::close(ends[1]);
  char byte = 0;
  EXPECT_EQ(::read(ends[0], &byte, 1), 0) << "its end of the pipe is closed";
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  ::close(ends[0]);
}

}  // namespace
}  // namespace candela
