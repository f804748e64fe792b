// Memory of deltas that were merged, for those that come. A delta of a large film is tens of megabytes:
// memory that comes fresh from the system costs a page fault and zeros for every 4 KiB, as much as half of a
// merge.
#pragma once

#include <cstddef>
#include <deque>
#include <new>
#include <string>
#include <utility>

#include "common/base/mutex.h"

namespace candela::master {

class BufferPool {
 public:
  explicit BufferPool(std::size_t limit_bytes) : limit_bytes_(limit_bytes) {}

  // Empty memory that goes back to its pool, which must outlive it.
  class Buffer {
   public:
    Buffer(BufferPool& pool, std::string bytes) : pool_(pool), bytes_(std::move(bytes)) {}
    ~Buffer() { pool_.give(std::move(bytes_)); }
    Buffer(const Buffer&) = delete;
    Buffer& operator=(const Buffer&) = delete;
    std::string& operator*() { return bytes_; }

   private:
    BufferPool& pool_;
    std::string bytes_;
  };

  // With room for `size` bytes. Memory of more than twice the size is left to larger deltas.
  Buffer take(std::size_t size) {
    std::string found;
    {
      const Lock lock(mutex_);
      for (auto it = kept_.begin(); it != kept_.end(); ++it) {  // the warmest first
        if (it->capacity() < size || it->capacity() / 2 > size) continue;
        found = std::move(*it);
        kept_bytes_ -= found.capacity();
        kept_.erase(it);
        break;
      }
    }
    found.clear();
    found.reserve(size);
    return Buffer(*this, std::move(found));
  }
  std::size_t kept_bytes() const {
    const Lock lock(mutex_);
    return kept_bytes_;
  }

 private:
  void give(std::string bytes) {
    if (bytes.capacity() < kMinBytes || bytes.capacity() > limit_bytes_) return;
    const Lock lock(mutex_);
    const std::size_t capacity = bytes.capacity();
    try {
      kept_.push_front(std::move(bytes));
    } catch (const std::bad_alloc&) {  // a destructor calls this
      return;
    }
    kept_bytes_ += capacity;
    while (kept_bytes_ > limit_bytes_) {
      kept_bytes_ -= kept_.back().capacity();
      kept_.pop_back();
    }
  }

  static constexpr std::size_t kMinBytes = 64 << 10;  // smaller memory costs nothing
  const std::size_t limit_bytes_;
  mutable Mutex mutex_;
  std::deque<std::string> kept_ CANDELA_GUARDED_BY(mutex_);
  std::size_t kept_bytes_ CANDELA_GUARDED_BY(mutex_) = 0;  // their capacity
};

}  // namespace candela::master
