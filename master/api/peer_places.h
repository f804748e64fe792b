// A bounded number of places, for calls that hold a thread. No client has more than its part, and where all
// places are taken the client that has most of them gives one to a client with fewer.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "common/base/mutex.h"
#include "common/base/result.h"

namespace candela::master {

class PeerPlaces {
 public:
  // The name of calls of this process, which have all places.
  static inline const std::string kThisProcess = "this process";

  // `what`: plural noun for errors. `mend`: what somebody with too many can do.
  PeerPlaces(std::string what, std::size_t total, std::size_t each, std::string mend)
      : what_(std::move(what)), mend_(std::move(mend)), total_(total), each_(each) {}

  class Place {
   public:
    Place(PeerPlaces& places, std::string peer)
        : places_(&places), peer_(std::move(peer)), revoked_(std::make_shared<std::atomic<bool>>(false)) {}
    ~Place() {
      if (places_ != nullptr) places_->leave(peer_, revoked_);
    }
    Place(Place&& other) noexcept
        : places_(std::exchange(other.places_, nullptr)),
          peer_(std::move(other.peer_)),
          revoked_(std::move(other.revoked_)) {}
    Place& operator=(Place&&) = delete;
    // Another client needs it: leave soon.
    bool revoked() const { return *revoked_; }

   private:
    friend class PeerPlaces;
    PeerPlaces* places_;
    std::string peer_;
    std::shared_ptr<std::atomic<bool>> revoked_;
  };

  // Errors (resource): the client has its part, or all places are taken by clients with as few.
  // `yields`: whoever holds the place asks revoked().
  Result<Place> enter(const std::string& peer, bool yields = false) {
    const Lock lock(mutex_);
    const std::size_t mine = count(peer);
    if (peer != kThisProcess && mine >= each_)
      return resource_error(
                 fmt::format("this client ({}) has {} {}, as many as one client may", peer, mine, what_))
          .with_mend(mend_);
    if (taken_ >= total_ && !revoke_of_another(mine))
      return resource_error(
                 fmt::format("there are {} {}, as many as this master has places for", taken_, what_))
          .with_mend("try again later");
    Place place(*this, peer);
    if (yields) held_[peer].push_back(place.revoked_);
    ++counts_[peer];
    ++taken_;
    return place;
  }

 private:
  using Flag = std::shared_ptr<std::atomic<bool>>;

  std::size_t count(const std::string& peer) const CANDELA_REQUIRES(mutex_) {
    const auto it = counts_.find(peer);
    return it == counts_.end() ? 0 : it->second;
  }
  bool revoke_of_another(std::size_t mine) CANDELA_REQUIRES(mutex_) {
    auto most = held_.end();
    for (auto it = held_.begin(); it != held_.end(); ++it)
      if (!it->second.empty() && (most == held_.end() || count(it->first) > count(most->first))) most = it;
    if (most == held_.end() || count(most->first) < mine + 2) return false;
    *most->second.back() = true;
    most->second.pop_back();
    release(most->first);
    return true;
  }
  void release(const std::string& peer) CANDELA_REQUIRES(mutex_) {
    const auto it = counts_.find(peer);
    if (--it->second == 0) counts_.erase(it);
    --taken_;
  }
  void leave(const std::string& peer, const Flag& flag) {
    const Lock lock(mutex_);
    if (*flag) return;  // released when it was revoked
    if (const auto it = held_.find(peer); it != held_.end()) {
      it->second.remove(flag);
      if (it->second.empty()) held_.erase(it);
    }
    release(peer);
  }

  const std::string what_, mend_;
  const std::size_t total_, each_;
  Mutex mutex_;
  std::map<std::string, std::size_t> counts_ CANDELA_GUARDED_BY(mutex_);
  std::map<std::string, std::list<Flag>> held_
      CANDELA_GUARDED_BY(mutex_);  // of places that yield, the newest last
  std::size_t taken_ CANDELA_GUARDED_BY(mutex_) = 0;
};

}  // namespace candela::master
