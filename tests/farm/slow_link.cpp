#include "tests/farm/slow_link.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <deque>
#include <stdexcept>

namespace candela::farm {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

constexpr int kSocketBytes = 32 << 10;        // small, so that the sender feels how slow the link is
constexpr std::size_t kInFlight = 256 << 10;  // bytes in the network's own buffers
constexpr std::size_t kStep = 4 << 10;

sockaddr_in loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

int small_socket() {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  for (const int option : {SO_RCVBUF, SO_SNDBUF})
    ::setsockopt(fd, SOL_SOCKET, option, &kSocketBytes, sizeof kSocketBytes);
  return fd;
}

// One direction of a connection.
struct Way {
  struct Piece {
    Clock::time_point due;
    std::string bytes;
  };
  int from = -1, to = -1;
  std::atomic<std::uint64_t>& count;
  std::deque<Piece> pieces{};
  std::size_t in_flight = 0;
  std::uint64_t sent = 0;
  Clock::time_point next_write{};
  bool ended = false, closed = false;  // nothing more to read; nothing more to write

  void read(double delay) {
    std::string bytes(kStep, '\0');
    const ssize_t n = ::recv(from, bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (n < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (n <= 0) {
      ended = true;
      return;
    }
    bytes.resize(static_cast<std::size_t>(n));
    in_flight += bytes.size();
    pieces.push_back(
        {Clock::now() + std::chrono::duration_cast<Clock::duration>(Seconds(delay)), std::move(bytes)});
  }
  // False where the other side is gone.
  bool write(double rate) {
    const auto now = Clock::now();
    while (!pieces.empty() && pieces.front().due <= now && next_write <= now) {
      std::string& bytes = pieces.front().bytes;
      const ssize_t n = ::send(to, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
      if (n < 0 && (errno == EAGAIN || errno == EINTR)) return true;
      if (n < 0) return false;
      const auto size = static_cast<std::size_t>(n);
      count += size;
      sent += size;
      in_flight -= size;
      if (rate > 0)
        next_write = std::max(now - std::chrono::milliseconds(50), next_write) +
                     std::chrono::duration_cast<Clock::duration>(Seconds(static_cast<double>(size) / rate));
      bytes.erase(0, size);
      if (bytes.empty()) pieces.pop_front();
    }
    if (ended && pieces.empty() && !closed) {
      ::shutdown(to, SHUT_WR);
      closed = true;
    }
    return true;
  }
};

}  // namespace

SlowLink::SlowLink(const std::string& target, const LinkOptions& options)
    : options_(options),
      target_port_(std::stoi(target.substr(target.rfind(':') + 1))),
      listener_(small_socket()),
      delay_seconds_(options.delay_seconds) {
  sockaddr_in address = loopback(0);
  socklen_t size = sizeof address;
  if (::bind(listener_, reinterpret_cast<sockaddr*>(&address), size) != 0 || ::listen(listener_, 64) != 0 ||
      ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) != 0)
    throw std::runtime_error("cannot listen for a slow link");
  address_ = "127.0.0.1:" + std::to_string(ntohs(address.sin_port));
  thread_ = std::thread([this] { accept_loop(); });
}

SlowLink::~SlowLink() {
  over_ = true;
  thread_.join();
  for (std::thread& connection : connections_) connection.join();
  ::close(listener_);
}

void SlowLink::accept_loop() {
  while (!over_) {
    pollfd polled{listener_, POLLIN, 0};
    if (::poll(&polled, 1, 20) <= 0) continue;
    const int caller = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (caller >= 0) connections_.emplace_back([this, caller] { serve(caller); });
  }
}

void SlowLink::serve(int caller) {
  const int target = small_socket();
  const sockaddr_in address = loopback(target_port_);
  bool alive = ::connect(target, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  Way down{target, caller, to_caller_}, up{caller, target, to_target_};
  while (alive && !over_ && !(down.closed && up.closed)) {
    if (cut_) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      continue;
    }
    std::array<pollfd, 2> polled{};
    int count = 0;
    for (const Way* way : {&down, &up})
      if (!way->ended && way->in_flight < kInFlight)
        polled[static_cast<std::size_t>(count++)] = {way->from, POLLIN, 0};
    ::poll(polled.data(), static_cast<nfds_t>(count), 2);
    for (Way* way : {&down, &up}) {
      if (!way->ended && way->in_flight < kInFlight) way->read(delay_seconds_);
      alive = alive && way->write(options_.bytes_per_second);
    }
    if (options_.break_after_bytes > 0 && down.sent >= options_.break_after_bytes) {
      ++breaks_;
      break;
    }
  }
  ::close(caller);
  ::close(target);
}

}  // namespace candela::farm
