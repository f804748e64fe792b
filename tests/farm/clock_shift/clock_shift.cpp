// A wall clock that can be set for some processes alone: loaded before libc (LD_PRELOAD), it adds the seconds
// that the file $CANDELA_CLOCK_SHIFT holds (an int64, read anew each time) to the time of day. Clocks that
// never jump are left alone. Waits until a time of day wait by this clock too, those that had begun before it
// was set included: the kernel's own clock does not know of the shift.
#include <dlfcn.h>
#include <fcntl.h>
#include <linux/futex.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdarg>
#include <cstdint>
#include <cstdlib>
#include <ctime>

namespace {

const volatile std::int64_t* map_shift() {
  static const std::int64_t none = 0;
  const char* path = std::getenv("CANDELA_CLOCK_SHIFT");
  const int fd = path == nullptr ? -1 : ::open(path, O_RDONLY | O_CLOEXEC);
  if (fd < 0) return &none;
  void* place = ::mmap(nullptr, sizeof(std::int64_t), PROT_READ, MAP_SHARED, fd, 0);
  ::close(fd);
  return place == MAP_FAILED ? &none : static_cast<const std::int64_t*>(place);
}

std::int64_t shift() {
  static const volatile std::int64_t* const seconds = map_shift();
  return *seconds;
}

using GetTime = int (*)(clockid_t, timespec*);
int real_time(clockid_t clock, timespec* time) {
  static const auto real = reinterpret_cast<GetTime>(::dlsym(RTLD_NEXT, "clock_gettime"));
  return real(clock, time);
}

template <class Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

// A wait looks at the shift again after this time.
constexpr std::int64_t kSliceNanoseconds = 100'000'000;
constexpr std::int64_t kNanoseconds = 1'000'000'000;

// A part of a wait until a time of the shifted clock, by the kernel's.
struct Slice {
  timespec until;
  bool last;
};
Slice slice_until(const timespec& shifted) {
  timespec now{};
  real_time(CLOCK_REALTIME, &now);
  const timespec deadline{shifted.tv_sec - shift(), shifted.tv_nsec};
  timespec end{now.tv_sec, now.tv_nsec + kSliceNanoseconds};
  end.tv_sec += end.tv_nsec / kNanoseconds;
  end.tv_nsec %= kNanoseconds;
  const bool last =
      deadline.tv_sec < end.tv_sec || (deadline.tv_sec == end.tv_sec && deadline.tv_nsec <= end.tv_nsec);
  return {last ? timespec{std::max<std::time_t>(deadline.tv_sec, 0), deadline.tv_nsec} : end, last};
}

using TimedWait = int (*)(pthread_cond_t*, pthread_mutex_t*, const timespec*);
using ClockWait = int (*)(pthread_cond_t*, pthread_mutex_t*, clockid_t, const timespec*);
using Syscall = long (*)(long, ...);

// The end of a slice is a spurious wakeup: a notice that came between two slices would be lost otherwise.
template <class Wait>
int wait_a_slice(const timespec& until, Wait wait) {
  const Slice slice = slice_until(until);
  const int result = wait(&slice.until);
  return result == ETIMEDOUT && !slice.last ? 0 : result;
}

}  // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  const int result = real_time(clock, time);
  if (result == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) time->tv_sec += shift();
  return result;
}

int gettimeofday(timeval* time, void*) noexcept {
  timespec now{};
  const int result = clock_gettime(CLOCK_REALTIME, &now);
  *time = {now.tv_sec, now.tv_nsec / 1000};
  return result;
}

time_t time(time_t* out) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  if (out != nullptr) *out = now.tv_sec;
  return now.tv_sec;
}

int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* until) {
  static const auto real = next<TimedWait>("pthread_cond_timedwait");
  // A condition does not tell its clock. No monotonic one has counted so many seconds.
  constexpr std::time_t kMonotonic = 500'000'000;
  if (until->tv_sec < kMonotonic) return real(condition, mutex, until);
  return wait_a_slice(*until, [&](const timespec* end) { return real(condition, mutex, end); });
}

int pthread_cond_clockwait(pthread_cond_t* condition, pthread_mutex_t* mutex, clockid_t clock,
                           const timespec* until) {
  static const auto real = next<ClockWait>("pthread_cond_clockwait");
  if (clock != CLOCK_REALTIME) return real(condition, mutex, clock, until);
  return wait_a_slice(*until, [&](const timespec* end) { return real(condition, mutex, clock, end); });
}

// The condition variables of Abseil, which gRPC uses, are futexes.
long syscall(long number, ...) noexcept {
  static const auto real = next<Syscall>("syscall");
  va_list arguments;
  va_start(arguments, number);
  long a[6];
  for (long& one : a) one = va_arg(arguments, long);
  va_end(arguments);
  const auto* const until = reinterpret_cast<const timespec*>(a[3]);
  if (number != SYS_futex || (a[1] & FUTEX_CLOCK_REALTIME) == 0 || until == nullptr)
    return real(number, a[0], a[1], a[2], a[3], a[4], a[5]);
  while (true) {
    const Slice slice = slice_until(*until);
    const long result = real(number, a[0], a[1], a[2], &slice.until, a[4], a[5]);
    if (result != -1 || errno != ETIMEDOUT || slice.last) return result;
  }
}

}  // extern "C"
