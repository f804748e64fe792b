// Images that were sent a short time ago, so that a transfer that broke off can go on with the very same
// bytes while the job's film has moved on.
#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <string>

#include "common/base/mutex.h"

namespace candela::master {

struct EncodedImage {
  std::string sha256, bytes;
};
using EncodedImagePtr = std::shared_ptr<const EncodedImage>;

class RecentImages {
 public:
  // Kept: so many bytes in all, each image for so long after it was last asked for. What is larger than all
  // of it is not kept: the next transfer encodes anew, which gives the same bytes once a job has ended.
  explicit RecentImages(std::uint64_t limit_bytes = 256ULL << 20, double limit_seconds = 600)
      : limit_bytes_(limit_bytes), limit_seconds_(limit_seconds) {}

  EncodedImagePtr keep(std::string bytes, double now_seconds);
  EncodedImagePtr find(const std::string& sha256, double now_seconds);  // null: not here, or no more
  void expire(double now_seconds);
  std::uint64_t bytes() const;

 private:
  struct Entry {
    EncodedImagePtr image;
    double last = 0;
  };
  void drop_oldest() CANDELA_REQUIRES(mutex_);

  const std::uint64_t limit_bytes_;
  const double limit_seconds_;
  mutable Mutex mutex_;
  std::list<Entry> entries_ CANDELA_GUARDED_BY(mutex_);  // the last asked for first
  std::uint64_t bytes_ CANDELA_GUARDED_BY(mutex_) = 0;
};

}  // namespace candela::master
