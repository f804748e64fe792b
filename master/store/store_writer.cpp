// The write-behind queue in front of the store.
#include <algorithm>
#include <chrono>
#include <iterator>

#include "common/base/enum_names.h"
#include "common/base/memory_limit.h"
#include "master/store/store.h"

namespace candela::master {

std::string_view name(JobState state) {
  return name_of_value<JobState::cancelled>({"queued", "running", "paused", "done", "failed", "cancelled"},
                                            state, "unknown");
}

StoreWriter::StoreWriter(Store& store, std::function<void(const std::string&)> on_error)
    : store_(store), on_error_(std::move(on_error)), thread_([this] { run(); }) {}

StoreWriter::~StoreWriter() {
  {
    const Lock lock(mutex_);
    stop_ = true;
  }
  work_.notify_all();
  thread_.join();
}

void StoreWriter::enqueue(std::vector<Change>& changes) {
  if (changes.empty()) return;
  {
    const Lock lock(mutex_);
    // A deque takes all its room before it moves the first of them.
    queue_.insert(queue_.end(), std::make_move_iterator(changes.begin()),
                  std::make_move_iterator(changes.end()));
    enqueued_ += changes.size();
  }
  changes.clear();
  work_.notify_one();
}

Result<void> StoreWriter::flush() {
  Lock lock(mutex_);
  const std::uint64_t target = enqueued_;
  const std::uint64_t failures_before = failures_;
  if (done_ >= target) return {};
  urgent_ = true;  // an earlier error is tried again now, not after its pause
  work_.notify_one();
  written_.wait(lock,
                [&]() CANDELA_REQUIRES(mutex_) { return done_ >= target || failures_ != failures_before; });
  if (done_ >= target) return {};
  return *error_;
}

std::size_t StoreWriter::backlog() const {
  const Lock lock(mutex_);
  return queue_.size();
}

void StoreWriter::run() {
  constexpr std::size_t kBatch = 1000;
  constexpr auto kPause = std::chrono::seconds(1);
  Lock lock(mutex_);
  for (;;) {
    work_.wait(lock, [&]() CANDELA_REQUIRES(mutex_) { return stop_ || !queue_.empty(); });
    if (queue_.empty()) return;
    const std::size_t n = std::min(queue_.size(), kBatch);
    // Only this thread removes from the queue, so the copy and the head agree after the lock was given up.
    urgent_ = false;
    constexpr std::string_view kWhat = "the store cannot be written";
    std::vector<Change> batch;
    Result<void> result = within_memory(kWhat, [&]() CANDELA_REQUIRES(mutex_) -> Result<void> {
      batch.assign(queue_.begin(), queue_.begin() + static_cast<std::ptrdiff_t>(n));
      return {};
    });
    if (result.ok()) {
      lock.unlock();
      result = within_memory(kWhat, [&, taken = std::move(batch)] { return store_.write(taken); });
      lock.lock();
    }
    if (result.ok()) {
      const bool recovered = error_.has_value();
      queue_.erase(queue_.begin(), queue_.begin() + static_cast<std::ptrdiff_t>(n));
      done_ += n;
      error_.reset();
      written_.notify_all();
      if (recovered) {
        lock.unlock();
        on_error_({});
        lock.lock();
      }
      continue;
    }
    error_ = result.error();
    ++failures_;
    const std::string text = error_->to_string();
    written_.notify_all();
    lock.unlock();
    on_error_(text);
    lock.lock();
    if (stop_) return;  // a last attempt was made; film and set of units are safe in the checkpoints
    work_.wait_for(lock, kPause, [&]() CANDELA_REQUIRES(mutex_) { return stop_ || urgent_; });
  }
}

}  // namespace candela::master
