// Notices: what the farm tells a receiver by HTTP POST (docs/notices.md). One thread sends them, in their
// order. Nobody waits for it: whoever has a notice puts it into a bounded queue.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "common/base/mutex.h"
#include "master/http/post.h"
#include "master/jobs/farm_counters.h"
#include "master/scheduler/scheduler.h"

namespace candela::master {

class Farm;

struct Notice {
  std::string event;  // "job-done", ...
  std::int64_t unix_ms = 0;
  std::string text;                 // one line for people
  std::string subject, about = {};  // "job" and its JSON, or the like; empty: the farm
};

// Notices of changes that the scheduler has made. Frames of a group tell only their failures; the group tells
// its end. Precondition: the lock of the scheduler is held.
std::vector<Notice> notices_of(const Scheduler& scheduler, std::span<const Change> changes, Now now);

// A look at the farm for notices that no change of the scheduler makes.
struct FarmLook {
  bool work = false;  // a job would get a lease
  std::size_t workers = 0;
  std::uint64_t disk_bytes = 0, free_bytes = 0;  // of the data folder's disk; 0 and 0: unknown
};
FarmLook look_at(const Scheduler& scheduler, Now now);

// Tells once that work waits without any worker, and that the disk is nearly full; again after it was over.
class FarmWatch {
 public:
  static constexpr double kNoWorkerSeconds = 60;
  std::vector<Notice> look(const FarmLook& look, Now now);

 private:
  std::optional<double> without_workers_;  // since when
  bool told_workers_ = false, told_disk_ = false;
};

struct NoticeOptions {
  std::string url, secret;
  std::size_t max_waiting = 1000;  // the oldest goes when another comes
  double timeout_seconds = 10;
  double first_pause = 1, max_pause = 300;  // after a failed try; each pause is twice the one before
  double keep_seconds = 3600;               // a notice that fails when it is older is given up
  double last_seconds = 2;                  // for what waits when the master stops
  double look_seconds = 5;                  // between looks of the FarmWatch
};

class Notices {
 public:
  Notices(NoticeOptions options, const Poster& poster);
  ~Notices();  // as stop()
  Notices(const Notices&) = delete;
  Notices& operator=(const Notices&) = delete;

  void tell(std::vector<Notice> notices);
  // Starts to send. `farm` (may be null: nobody watches it, and nothing is counted there) must live until
  // stop().
  void start(Farm* farm);
  // Tries what waits once more, for a bounded time.
  void stop();
  std::size_t waiting() const;

 private:
  struct Waiting {
    std::string id, event, body;
    double told = 0;  // by the steady clock
  };
  void run();
  void watch(double now);
  // False: the notice stays.
  bool send(const Waiting& notice);
  void count(std::atomic<std::uint64_t> NoticeCounters::*counter, std::uint64_t n = 1);

  const NoticeOptions options_;
  const Poster& poster_;
  Farm* farm_ = nullptr;
  FarmWatch watch_;           // of the thread
  std::string last_trouble_;  // of the thread: logged last; empty: none
  mutable Mutex mutex_;
  std::condition_variable wake_;
  std::deque<Waiting> queue_ CANDELA_GUARDED_BY(mutex_);
  std::uint64_t dropped_ CANDELA_GUARDED_BY(mutex_) = 0;  // and not yet counted
  bool stopping_ CANDELA_GUARDED_BY(mutex_) = false;
  std::atomic<double> give_up_at_;  // by the steady clock
  std::thread thread_;
};

}  // namespace candela::master
