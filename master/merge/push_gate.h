// The bounded queue in front of the merge: how many bytes of deltas may be under way, how many are merged at
// a time, and who sits on a place without sending. A hung sender holds its own call only: it is cancelled
// after an inactivity limit. Each stream holds a thread of the server, so streams whose sender is not known
// yet are few and short.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <string>

#include "common/base/mutex.h"
#include "common/base/result.h"

namespace candela::master {

class PushGate {
 public:
  PushGate(std::uint64_t limit_bytes, unsigned merge_threads);

  class Ticket;
  // `yields`: a job of a higher priority than the delta's has work to do.
  enum class Order : std::uint8_t { at_once, yields };
  // A place for a delta of `bytes`. ErrorKind::resource where the queue is full (a delta larger than the
  // whole queue is taken when nothing else is under way), kMaxDeltas are under way, or this worker has two
  // deltas under way. Deltas that yield have three quarters of the queue, so that an urgent job, for which a
  // thousand units were cut short, does not wait behind these. `cancel` ends the sender's call; it is called
  // at most once, from cancel_hung() or enter_unknown(), never after the ticket's end.
  Result<std::unique_ptr<Ticket>> enter(const std::string& worker_id, std::uint64_t bytes, Order order,
                                        double now_seconds, std::function<void()> cancel);
  // Far below the number of the server's threads: while deltas wait for their turn, other calls go on.
  static constexpr std::size_t kMaxDeltas = 256;
  // When the sender of a delta that had no place is to come again: the time in which those under way are
  // merged, of 0.25 to 4 seconds; at once: the quarter of it that is kept.
  double retry_seconds(Order order) const;
  // A place that only guards against silence, and is always there.
  std::unique_ptr<Ticket> enter_silent(double now_seconds, std::function<void()> cancel);
  // A place for a stream that has not shown a valid session or header: it has kUnknownSeconds for that. Where
  // kMaxUnknown such streams wait already, the oldest of them is cancelled: who sends its header at once is
  // not kept out by any number of streams that do not.
  static constexpr double kUnknownSeconds = 2;
  static constexpr std::size_t kMaxUnknown = 256;
  std::unique_ptr<Ticket> enter_unknown(double now_seconds, std::function<void()> cancel);
  // Cancels those that sent nothing for `idle_seconds`, deltas that after `idle_seconds` are slower than 16
  // KiB/s, and unknown senders whose time is over.
  void cancel_hung(double now_seconds, double idle_seconds);

  std::uint64_t bytes_under_way() const;
  std::size_t waiting_at_once() const;  // for a turn to merge
  std::size_t count() const;

  // Waits for one of the merge_threads places to decode and merge. Who yields lets the others go first.
  class MergeTurn {
   public:
    MergeTurn(PushGate& gate, Order order);
    ~MergeTurn();
    MergeTurn(const MergeTurn&) = delete;
    MergeTurn& operator=(const MergeTurn&) = delete;

   private:
    PushGate& gate_;
    std::chrono::steady_clock::time_point begun_;
  };

 private:
  struct Entry {
    std::string worker_id;
    std::uint64_t bytes = 0;
    double started = 0, last = 0;
    bool unknown = false;
    std::function<void()> cancel;  // empty once called, or once everything has arrived
  };

  const std::uint64_t limit_bytes_;
  mutable Mutex mutex_;
  std::list<Entry> entries_ CANDELA_GUARDED_BY(mutex_);
  std::uint64_t bytes_ CANDELA_GUARDED_BY(mutex_) = 0;
  std::size_t deltas_ CANDELA_GUARDED_BY(mutex_) = 0;  // entries with a worker

  mutable Mutex turn_mutex_;
  std::condition_variable turn_free_;
  unsigned free_turns_ CANDELA_GUARDED_BY(turn_mutex_);
  std::size_t waiting_at_once_ CANDELA_GUARDED_BY(turn_mutex_) = 0;
  double turn_seconds_ CANDELA_GUARDED_BY(turn_mutex_) = 0;  // running mean
};

class PushGate::Ticket {
 public:
  Ticket(PushGate& gate, std::list<Entry>::iterator entry) : gate_(gate), entry_(entry) {}
  ~Ticket();
  Ticket(const Ticket&) = delete;
  Ticket& operator=(const Ticket&) = delete;
  void progress(double now_seconds);
  void all_here();  // nothing more to wait for from the sender

 private:
  PushGate& gate_;
  std::list<Entry>::iterator entry_;
};

}  // namespace candela::master
