// Mutexes and locks that clang's thread safety analysis knows: a field says which mutex guards it, a function
// which mutex its caller holds. tests/architecture/check_locks.sh has clang prove it; GCC sees plain
// std::mutex. In a lambda the attributes stand after the parameters: [&]() CANDELA_REQUIRES(mutex_) {...}.
#pragma once

#include <mutex>

#if defined(__clang__)
#define CANDELA_THREAD_SAFETY(attribute) __attribute__((attribute))
#else
#define CANDELA_THREAD_SAFETY(attribute)
#endif
#define CANDELA_GUARDED_BY(mutex) CANDELA_THREAD_SAFETY(guarded_by(mutex))
#define CANDELA_REQUIRES(mutex) CANDELA_THREAD_SAFETY(requires_capability(mutex))
// For what the analysis cannot see; a comment says what holds.
#define CANDELA_UNANALYZED CANDELA_THREAD_SAFETY(no_thread_safety_analysis)

namespace candela {

class CANDELA_THREAD_SAFETY(capability("mutex")) Mutex {
 public:
  void lock() CANDELA_THREAD_SAFETY(acquire_capability()) { mutex_.lock(); }
  void unlock() CANDELA_THREAD_SAFETY(release_capability()) { mutex_.unlock(); }

 private:
  friend class Lock;
  std::mutex mutex_;
};

// Holds a mutex while it lives; may give it up in between. A std::condition_variable waits with it.
class CANDELA_THREAD_SAFETY(scoped_lockable) Lock {
 public:
  explicit Lock(Mutex& mutex) CANDELA_THREAD_SAFETY(acquire_capability(mutex)) : lock_(mutex.mutex_) {}
  ~Lock() CANDELA_THREAD_SAFETY(release_capability()) {}
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;
  void lock() CANDELA_THREAD_SAFETY(acquire_capability()) { lock_.lock(); }
  void unlock() CANDELA_THREAD_SAFETY(release_capability()) { lock_.unlock(); }
  // Runs `f` without the mutex: what it guards may have changed afterwards.
  template <class F>
  auto without(F&& f) CANDELA_UNANALYZED {
    struct Again {
      std::unique_lock<std::mutex>& lock;
      ~Again() { lock.lock(); }
    };
    lock_.unlock();
    const Again again{lock_};
    return f();
  }
  operator std::unique_lock<std::mutex>&() { return lock_; }

 private:
  std::unique_lock<std::mutex> lock_;
};

}  // namespace candela
