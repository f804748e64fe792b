#include "client/signals.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstddef>

namespace candela::client {
namespace {

constexpr std::array<int, 3> kSignals = {SIGINT, SIGTERM, SIGHUP};

// A signal handler can reach nothing but globals: the number of the signal, and the pipe whose readable end
// wakes sleepers.
std::atomic<int> first_signal{0};
static_assert(std::atomic<int>::is_always_lock_free, "used in a signal handler");
std::array<int, 2> wake_pipe = {-1, -1};
std::array<struct sigaction, kSignals.size()> previous{};

extern "C" void on_signal(int number) {
  int expected = 0;
  if (!first_signal.compare_exchange_strong(expected, number)) ::_exit(128 + number);
  const int saved = errno;
  // The byte stays in the pipe, so that every later poll returns at once.
  [[maybe_unused]] const ssize_t written = ::write(wake_pipe[1], "x", 1);
  errno = saved;
}

}  // namespace

StopSignals::StopSignals() {
  first_signal = 0;
  if (::pipe2(wake_pipe.data(), O_CLOEXEC | O_NONBLOCK) != 0) wake_pipe = {-1, -1};
  struct sigaction action {};
  action.sa_handler = on_signal;
  sigemptyset(&action.sa_mask);
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    ::sigaction(kSignals[i], nullptr, &previous[i]);
    // nohup and shells' background jobs ignore signals on purpose.
    if (previous[i].sa_handler != SIG_IGN) ::sigaction(kSignals[i], &action, nullptr);
  }
}

StopSignals::~StopSignals() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) ::sigaction(kSignals[i], &previous[i], nullptr);
  for (int& fd : wake_pipe) {
    if (fd >= 0) ::close(fd);
    fd = -1;
  }
}

int StopSignals::pending() const {
  return first_signal;
}

bool StopSignals::wait_for(std::chrono::milliseconds time) const {
  if (pending() != 0) return true;
  struct pollfd entry {
    wake_pipe[0], POLLIN, 0
  };
  ::poll(&entry, 1, static_cast<int>(time.count()));
  return pending() != 0;
}

}  // namespace candela::client
