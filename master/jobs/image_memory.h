// The memory of images under way: so many at a time as fit, and one in any case.
#pragma once

#include <cstdint>
#include <utility>

#include "common/base/mutex.h"
#include "common/base/result.h"
#include "common/stages/memory_need.h"

namespace candela::master {

class ImageMemory {
 public:
  explicit ImageMemory(std::uint64_t limit_bytes) : limit_bytes_(limit_bytes) {}

  // The memory goes back with it.
  class Place {
   public:
    Place(ImageMemory& memory, std::uint64_t bytes) : memory_(&memory), bytes_(bytes) {}
    ~Place() {
      if (memory_ != nullptr) memory_->give(bytes_);
    }
    Place(Place&& other) noexcept : memory_(std::exchange(other.memory_, nullptr)), bytes_(other.bytes_) {}
    Place& operator=(Place&& other) noexcept {
      std::swap(memory_, other.memory_);
      std::swap(bytes_, other.bytes_);
      return *this;
    }

   private:
    ImageMemory* memory_;
    std::uint64_t bytes_;
  };
  // Errors (resource): other images have the memory.
  Result<Place> take(std::uint64_t bytes) {
    const Lock lock(mutex_);
    if (taken_ > 0 && (bytes > limit_bytes_ || taken_ > limit_bytes_ - bytes))
      return resource_error("images under way have " + memory_text(taken_) +
                            " of the master's memory, and this one needs " + memory_text(bytes) + " of " +
                            memory_text(limit_bytes_))
          .with_mend("ask again in a moment");
    taken_ += bytes;
    return Place(*this, bytes);
  }

 private:
  void give(std::uint64_t bytes) {
    const Lock lock(mutex_);
    taken_ -= bytes;
  }
  const std::uint64_t limit_bytes_;
  Mutex mutex_;
  std::uint64_t taken_ CANDELA_GUARDED_BY(mutex_) = 0;
};

}  // namespace candela::master
