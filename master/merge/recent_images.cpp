#include "master/merge/recent_images.h"

#include <algorithm>

#include "common/base/hash.h"

namespace candela::master {

EncodedImagePtr RecentImages::keep(std::string bytes, double now_seconds) {
  auto image = std::make_shared<EncodedImage>();
  image->sha256 = sha256_hex(bytes);
  image->bytes = std::move(bytes);
  if (EncodedImagePtr known = find(image->sha256, now_seconds)) return known;
  if (image->bytes.size() > limit_bytes_) return image;
  const Lock lock(mutex_);
  entries_.push_front({image, now_seconds});
  bytes_ += image->bytes.size();
  while (bytes_ > limit_bytes_) drop_oldest();
  return image;
}

EncodedImagePtr RecentImages::find(const std::string& sha256, double now_seconds) {
  const Lock lock(mutex_);
  const auto found = std::find_if(entries_.begin(), entries_.end(),
                                  [&](const Entry& e) { return e.image->sha256 == sha256; });
  if (found == entries_.end()) return nullptr;
  entries_.splice(entries_.begin(), entries_, found);
  entries_.front().last = now_seconds;
  return entries_.front().image;
}

void RecentImages::expire(double now_seconds) {
  const Lock lock(mutex_);
  while (!entries_.empty() && now_seconds - entries_.back().last > limit_seconds_) drop_oldest();
}

std::uint64_t RecentImages::bytes() const {
  const Lock lock(mutex_);
  return bytes_;
}

void RecentImages::drop_oldest() {
  bytes_ -= entries_.back().image->bytes.size();
  entries_.pop_back();
}

}  // namespace candela::master
