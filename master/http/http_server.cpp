// One thread, one poll(): a connection that says nothing costs a few bytes and no thread, and the oldest of
// such connections is closed when a new one needs its place.
#include "master/http/http_server.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <list>
#include <thread>
#include <utility>
#include <vector>

#include "common/wire/wire.h"
#include "master/farm.h"

namespace candela::master {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kMaxConnections = 64;
constexpr std::size_t kMaxRequestBytes = 8192;
constexpr auto kRequestTime = std::chrono::seconds(2);  // from connection to the whole request
constexpr auto kAnswerTime = std::chrono::seconds(10);  // from there until the client has taken the answer
constexpr auto kPause = std::chrono::milliseconds(50);  // after an error of accept() that will pass

class Descriptor {
 public:
  explicit Descriptor(int fd = -1) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  int get() const { return fd_; }

 private:
  int fd_;
};

struct Answer {
  int code = 200;
  std::string_view reason = "OK", type = "text/plain; charset=utf-8";
  std::string body;
};

std::string text_of(const Answer& answer, bool with_body) {
  std::string text = fmt::format(
      "HTTP/1.1 {} {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nCache-Control: no-store\r\n"
      "Connection: close\r\n{}\r\n",
      answer.code, answer.reason, answer.type, answer.body.size(),
      answer.code == 405 ? "Allow: GET, HEAD\r\n" : "");
  if (with_body) text += answer.body;
  return text;
}

Answer answer_to(Farm& farm, std::string_view path) {
  if (path == "/healthz") {
    const std::string trouble = farm.stopping() ? "stopping" : farm.trouble();
    if (trouble.empty()) return {.body = "ok\n"};
    return {.code = 503, .reason = "Service Unavailable", .body = trouble + "\n"};
  }
  if (path == "/metrics")
    return {.type = "text/plain; version=0.0.4; charset=utf-8", .body = metrics_text(farm)};
  return {.code = 404, .reason = "Not Found", .body = "there are /healthz and /metrics\n"};
}

// `head` is what came up to the empty line: "GET /healthz?x HTTP/1.1" and the fields, which say nothing to
// us.
std::string respond(Farm& farm, std::string_view head) {
  const std::string_view line = head.substr(0, head.find_first_of("\r\n"));
  const std::size_t first = line.find(' '), last = line.rfind(' ');
  if (first == last || !line.substr(last + 1).starts_with("HTTP/1."))
    return text_of({.code = 400, .reason = "Bad Request", .body = "this is not HTTP/1\n"}, true);
  const std::string_view method = line.substr(0, first), target = line.substr(first + 1, last - first - 1);
  if (method != "GET" && method != "HEAD")
    return text_of({.code = 405, .reason = "Method Not Allowed", .body = "only GET and HEAD\n"}, true);
  try {
    return text_of(answer_to(farm, target.substr(0, target.find('?'))), method == "GET");
  } catch (const std::exception&) {  // out of memory, most of all
    return text_of({.code = 500, .reason = "Internal Server Error", .body = "no answer could be made\n"},
                   true);
  }
}

class Server final : public HttpServer {
 public:
  Server(Farm& farm, Descriptor listener, Descriptor stop, int port)
      : farm_(farm), listener_(std::move(listener)), stop_(std::move(stop)), port_(port) {
    thread_ = std::thread([this] { run(); });
  }
  ~Server() override {
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = ::write(stop_.get(), &one, sizeof one);
    thread_.join();
  }
  int port() const override { return port_; }

 private:
  struct Connection {
    Descriptor socket;
    Clock::time_point deadline;
    std::string in, out;  // out: empty until the request is whole
    std::size_t sent = 0;
    bool over = false;
  };

  void run() {
    std::vector<pollfd> polled;
    for (;;) {
      polled.assign({{stop_.get(), POLLIN, 0}, {listener_.get(), POLLIN, 0}});
      auto next = Clock::now() + std::chrono::hours(1);
      for (const Connection& c : connections_) {
        polled.push_back({c.socket.get(), static_cast<short>(c.out.empty() ? POLLIN : POLLOUT), 0});
        next = std::min(next, c.deadline);
      }
      const auto wait = std::chrono::ceil<std::chrono::milliseconds>(next - Clock::now()).count();
      if (::poll(polled.data(), polled.size(), static_cast<int>(std::max<std::int64_t>(wait, 0))) < 0 &&
          errno != EINTR)
        std::this_thread::sleep_for(kPause);
      if (polled[0].revents != 0) return;
      auto entry = polled.begin() + 2;
      const auto now = Clock::now();
      for (Connection& c : connections_) {
        if ((entry++)->revents != 0) step(c);
        c.over = c.over || now >= c.deadline;
      }
      connections_.remove_if([](const Connection& c) { return c.over; });
      if (polled[1].revents != 0) take_one();
    }
  }

  void take_one() {
    Descriptor socket(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (socket.get() < 0) {
      if (errno == EAGAIN || errno == EINTR || errno == ECONNABORTED) return;
      if (connections_.empty())
        std::this_thread::sleep_for(kPause);
      else
        connections_.pop_front();  // out of descriptors: the oldest gives way
      return;
    }
    // Whoever sent its request at once, as honest clients do, is answered before it can have to give way.
    Connection& c = connections_.emplace_back();
    c.socket = std::move(socket);
    c.deadline = Clock::now() + kRequestTime;
    step(c);
    if (c.over)
      connections_.pop_back();
    else if (connections_.size() > kMaxConnections)
      connections_.pop_front();
  }

  // Reads or writes what can be read or written now.
  void step(Connection& c) {
    while (c.out.empty()) {
      char buffer[2048];
      const ssize_t n = ::recv(c.socket.get(), buffer, sizeof buffer, 0);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0 && errno == EAGAIN) return;
      if (n <= 0) {
        c.over = true;
        return;
      }
      c.in.append(buffer, static_cast<std::size_t>(n));
      if (c.in.find("\r\n\r\n") == std::string::npos && c.in.find("\n\n") == std::string::npos) {
        if (c.in.size() <= kMaxRequestBytes) continue;
        c.out =
            text_of({.code = 431, .reason = "Request Header Fields Too Large", .body = "too long\n"}, true);
      } else {
        c.out = respond(farm_, c.in);
      }
      c.deadline = Clock::now() + kAnswerTime;
    }
    while (c.sent < c.out.size()) {
      const ssize_t n = ::send(c.socket.get(), c.out.data() + c.sent, c.out.size() - c.sent, MSG_NOSIGNAL);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0 && errno == EAGAIN) return;
      if (n < 0) break;
      c.sent += static_cast<std::size_t>(n);
    }
    ::shutdown(c.socket.get(), SHUT_WR);
    c.over = true;
  }

  Farm& farm_;
  Descriptor listener_, stop_;
  const int port_;
  std::list<Connection> connections_;  // in the order they came; of the thread
  std::thread thread_;
};

// A listening socket of one of the address's meanings, and its port; -1 with errno where there is none.
std::pair<Descriptor, int> listen_on(const wire::Address& address) {
  std::pair<Descriptor, int> result;
  addrinfo hints{}, *found = nullptr;
  hints.ai_family = address.host == "localhost" ? AF_INET : AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  if (::getaddrinfo(address.host.c_str(), std::to_string(address.port).c_str(), &hints, &found) != 0) {
    errno = EADDRNOTAVAIL;
    return result;
  }
  int error = EADDRNOTAVAIL;
  for (const addrinfo* a = found; a != nullptr && result.first.get() < 0; a = a->ai_next) {
    Descriptor socket(::socket(a->ai_family, a->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, a->ai_protocol));
    const int on = 1;
    sockaddr_storage bound{};
    socklen_t size = sizeof bound;
    if (socket.get() < 0 || ::setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0 ||
        ::bind(socket.get(), a->ai_addr, a->ai_addrlen) != 0 || ::listen(socket.get(), SOMAXCONN) != 0 ||
        ::getsockname(socket.get(), reinterpret_cast<sockaddr*>(&bound), &size) != 0) {
      error = errno;
      continue;
    }
    const int port = bound.ss_family == AF_INET6 ? ntohs(reinterpret_cast<sockaddr_in6&>(bound).sin6_port)
                                                 : ntohs(reinterpret_cast<sockaddr_in&>(bound).sin_port);
    result = {std::move(socket), port};
  }
  ::freeaddrinfo(found);
  errno = error;
  return result;
}

}  // namespace

Result<std::unique_ptr<HttpServer>> HttpServer::start(Farm& farm, const std::string& listen) {
  CANDELA_ASSIGN(const wire::Address address, wire::parse_address(listen, "--http"));
  auto [listener, port] = listen_on(address);
  Descriptor stop(listener.get() < 0 ? -1 : ::eventfd(0, EFD_CLOEXEC));
  if (listener.get() < 0 || stop.get() < 0)
    return usage_error(fmt::format("cannot listen on {}: {}", address.text(), std::strerror(errno)))
        .with_field("--http")
        .with_mend("choose another port, or stop what holds it");
  return std::unique_ptr<HttpServer>(
      std::make_unique<Server>(farm, std::move(listener), std::move(stop), port));
}

}  // namespace candela::master
