// One thread, one poll(): a connection that says nothing costs a few bytes and no thread, and the oldest of
// such connections is closed when a new one needs its place.
#include "master/http/http_server.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <list>
#include <map>
#include <new>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "common/base/descriptor.h"
#include "common/base/mutex.h"
#include "common/wire/address.h"
#include "common/wire/peer.h"
#include "master/farm.h"
#include "master/http/http_message.h"
#include "master/http/live_page.h"
#include "master/http/routes.h"

namespace candela::master {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kMaxConnections = 64;
constexpr std::size_t kMaxStreams = 48;                 // of them, of events
constexpr std::size_t kMaxPeerStreams = 16;             // of one client
constexpr std::size_t kMaxStreamBytes = 4 << 20;        // that a stream's client has not taken
constexpr auto kRequestTime = std::chrono::seconds(2);  // from connection to the whole request
constexpr auto kAnswerTime = std::chrono::seconds(10);  // from there until the client has taken the answer
constexpr double kSlowBytes = 64 << 10;  // a second, that a client of a large answer takes at least
constexpr auto kLaterTime = std::chrono::seconds(60);  // for an answer that reads files
constexpr std::size_t kMaxAtOnce = 4 << 20;            // of a large answer, before others have their turn
constexpr std::size_t kUploadAtOnce = 256 << 10;       // of an upload, before others have their turn
constexpr auto kLingerTime = std::chrono::seconds(2);
constexpr auto kStreamTime = std::chrono::seconds(15);  // to take what was sent; then a sign of life
constexpr auto kPause = std::chrono::milliseconds(50);  // after an error of accept() that will pass

HttpAnswer health_of(Farm& farm) {
  const std::string trouble = farm.stopping() ? "stopping" : farm.trouble();
  if (trouble.empty()) return {.body = "ok\n"};
  return {.code = 503, .body = trouble + "\n"};
}

// Nothing: the page answers later.
std::optional<HttpAnswer> answer_to(Farm& farm, LivePage& page, const HttpRequest& request,
                                    std::uint64_t connection) {
  const bool changes =
      (request.method == "POST" || request.method == "PUT") && request.path.starts_with("/api/");
  if (request.method != "GET" && request.method != "HEAD" && !changes)
    return error_answer(405, "only GET and HEAD");
  try {
    const RouteMatch match = find_route(request.method, request.path);
    if (match.route != nullptr && match.route->action == HttpAction::health) return health_of(farm);
    if (match.route != nullptr && match.route->action == HttpAction::metrics)
      return HttpAnswer{.type = "text/plain; version=0.0.4; charset=utf-8", .body = metrics_text(farm)};
    return page.answer(request, match, connection);
  } catch (const std::exception&) {  // out of memory, most of all
    return error_answer(500, "no answer could be made");
  }
}

class Server final : public HttpServer {
 public:
  Server(Farm& farm, Descriptor listener, Descriptor wake, int port, const PageOptions& page)
      : farm_(farm), listener_(std::move(listener)), wake_(std::move(wake)), port_(port) {
    page_ = std::make_unique<LivePage>(farm, page,
                                       LivePage::Out{[this](std::uint64_t id, HttpAnswer a) {
                                                       put({id, "", std::move(a), ""});
                                                     },
                                                     [this](const std::string& topic, std::string text) {
                                                       put({0, topic, {}, std::move(text)});
                                                     }});
    thread_ = std::thread([this] { run(); });
  }
  ~Server() override {
    stopping_ = true;
    wake();
    thread_.join();
    page_.reset();
  }
  int port() const override { return port_; }

 private:
  struct Connection {
    std::uint64_t id = 0;
    Descriptor socket;
    Clock::time_point deadline;
    std::string in, out;                             // out: empty until there is an answer
    std::shared_ptr<const std::string> shared = {};  // what follows `out`
    std::size_t sent = 0;                            // of both
    std::size_t size() const { return out.size() + (shared ? shared->size() : 0); }
    bool waits = false;  // the page answers later
    bool head = false;
    std::unique_ptr<BlobUpload> upload = {};  // takes what comes
    bool sized = false;                       // its deadline knows the size of its body
    bool lingers = false;    // what the client still sends is passed over, so that it reads the answer
    bool shut = false;       // the answer is sent, and the client may still send
    std::string topic = {};  // of a stream
    bool over = false;
    std::string peer = {};  // of a stream
  };
  // An answer to a connection, or a text for all streams of a topic.
  struct Message {
    std::uint64_t connection;
    std::string topic;
    HttpAnswer answer;
    std::string text;
  };

  void wake() {
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = ::write(wake_.get(), &one, sizeof one);
  }
  void put(Message message) {
    {
      const Lock lock(mutex_);
      messages_.push_back(std::move(message));
    }
    wake();
  }

  void run() {
    ::pthread_setname_np(::pthread_self(), "http");  // by which tests tell what it costs
    std::vector<pollfd> polled;
    for (;;) {
      polled.assign({{wake_.get(), POLLIN, 0}, {listener_.get(), POLLIN, 0}});
      auto next = Clock::now() + std::chrono::hours(1);
      for (const Connection& c : connections_) {
        // A stream, or a client that waits, sends nothing but the end of the connection.
        const bool writes = c.sent < c.size();
        polled.push_back({c.socket.get(), static_cast<short>(writes ? POLLOUT : POLLIN), 0});
        next = std::min(next, c.deadline);
      }
      const auto wait = std::chrono::ceil<std::chrono::milliseconds>(next - Clock::now()).count();
      if (::poll(polled.data(), polled.size(), static_cast<int>(std::max<std::int64_t>(wait, 0))) < 0 &&
          errno != EINTR)
        std::this_thread::sleep_for(kPause);
      if (stopping_) return;
      auto entry = polled.begin() + 2;
      const auto now = Clock::now();
      for (Connection& c : connections_) {
        if ((entry++)->revents != 0) step_or_end(c);
        if (now < c.deadline) continue;
        // A stream that has nothing to send is kept alive; one whose client takes nothing ends.
        if (!c.topic.empty() && c.sent == c.out.size())
          append(c, ": alive\n\n");
        else
          c.over = true;
      }
      try {
        if (polled[0].revents != 0) take_messages();
        drop_finished();
        if (polled[1].revents != 0) take_one();
      } catch (const std::bad_alloc&) {  // whoever misses a message connects again
        for (Connection& c : connections_) c.over = c.over || !c.topic.empty() || c.waits;
      }
    }
  }
  // A connection that there is no memory for ends alone.
  void step_or_end(Connection& c) {
    try {
      step(c);
    } catch (const std::bad_alloc&) {
      c.over = true;
    }
  }

  void drop_finished() {
    for (auto c = connections_.begin(); c != connections_.end();) {
      if (!c->over) {
        ++c;
        continue;
      }
      if (!c->topic.empty()) {
        --streams_;
        page_->closed(c->topic);
      }
      c = connections_.erase(c);
    }
  }

  void take_messages() {
    std::uint64_t count = 0;
    [[maybe_unused]] const ssize_t n = ::read(wake_.get(), &count, sizeof count);
    std::vector<Message> messages;
    {
      const Lock lock(mutex_);
      messages.swap(messages_);
    }
    for (const Message& m : messages)
      for (Connection& c : connections_) {
        if (c.over) continue;
        if (m.topic.empty() && c.id == m.connection && c.waits) {
          answer(c, m.answer);
          step(c);
        } else if (!m.topic.empty() && c.topic == m.topic) {
          append(c, m.text);
        }
      }
  }

  // Sends more to a stream. A client that is too far behind begins anew.
  void append(Connection& c, std::string_view text) {
    if (c.sent == c.out.size()) {
      c.out.clear();
      c.sent = 0;
      c.deadline = Clock::now() + kStreamTime;
    }
    c.out += text;
    if (c.out.size() > kMaxStreamBytes)
      c.over = true;
    else
      step(c);
  }

  void answer(Connection& c, const HttpAnswer& answer) {
    c.waits = false;
    c.deadline = Clock::now() + kAnswerTime;
    if (!answer.topic.empty() && !c.head) {
      if (const std::string refusal = no_stream(c); !refusal.empty()) {
        c.out = to_text(error_answer(503, refusal));
        return;
      }
      ++streams_;
      c.topic = answer.topic;
      page_->opened(c.topic);
    }
    if (!answer.shared || c.head) {
      c.out = to_text(answer, !c.head);
      return;
    }
    c.out = head_text(answer);
    c.shared = answer.shared;
    c.deadline += std::chrono::seconds(static_cast<int>(static_cast<double>(c.shared->size()) / kSlowBytes));
  }

  // Why the connection cannot be a stream; empty: it can. Where all places are taken, the newest stream of
  // the client with the most ends for a client with fewer.
  std::string no_stream(Connection& c) {
    sockaddr_storage address{};
    socklen_t size = sizeof address;
    std::string peer = "unknown";
    if (::getpeername(c.socket.get(), reinterpret_cast<sockaddr*>(&address), &size) == 0)
      peer = wire::peer_name(address);
    std::map<std::string, std::size_t> streams;
    for (const Connection& other : connections_)
      if (!other.peer.empty() && !other.over) ++streams[other.peer];
    const std::size_t mine = streams[peer];
    if (mine >= kMaxPeerStreams)
      return fmt::format("this client ({}) has {} pages open, as many as one may: close some of them", peer,
                         mine);
    if (streams_ >= kMaxStreams) {
      const auto most = std::max_element(streams.begin(), streams.end(),
                                         [](const auto& a, const auto& b) { return a.second < b.second; });
      if (most->second < mine + 2)
        return fmt::format("{} pages are open, as many as this master serves: try again later", streams_);
      const auto newest =
          std::find_if(connections_.rbegin(), connections_.rend(),
                       [&](const Connection& other) { return other.peer == most->first && !other.over; });
      newest->over = true;
    }
    c.peer = peer;
    return {};
  }

  void take_one() {
    Descriptor socket(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (socket.get() < 0) {
      if (errno == EAGAIN || errno == EINTR || errno == ECONNABORTED) return;
      if (connections_.empty())
        std::this_thread::sleep_for(kPause);
      else
        give_way();  // out of descriptors
      return;
    }
    // Whoever sent its request at once, as honest clients do, is answered before it can have to give way.
    Connection& c = connections_.emplace_back();
    c.id = ++last_id_;
    c.socket = std::move(socket);
    c.deadline = Clock::now() + kRequestTime;
    step(c);
    if (!c.over && connections_.size() > kMaxConnections) give_way();
    drop_finished();
  }

  // The oldest connection that is no stream and no upload. (There is one: these are fewer than connections
  // may be.)
  void give_way() {
    const auto oldest = std::find_if(connections_.begin(), connections_.end(), [](const Connection& c) {
      return c.topic.empty() && !c.upload && !c.over;
    });
    if (oldest != connections_.end()) oldest->over = true;
    drop_finished();
  }

  // Takes what has come of a blob.
  void take_upload(Connection& c) {
    std::array<char, 16384> buffer{};
    for (std::size_t taken = 0; c.upload && taken < kUploadAtOnce;) {
      const std::size_t most = std::min<std::uint64_t>(buffer.size(), c.upload->left());
      const ssize_t n = ::recv(c.socket.get(), buffer.data(), most, 0);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0 && errno == EAGAIN) return;
      c.over = n <= 0;
      if (c.over) return;
      taken += static_cast<std::size_t>(n);
      add_to_upload(c, {buffer.data(), static_cast<std::size_t>(n)});
    }
  }
  // After the last byte the page answers later.
  void add_to_upload(Connection& c, std::string_view data) {
    const auto refused = c.upload->add(data);
    c.deadline = Clock::now() + kAnswerTime;
    if (refused) {
      c.upload.reset();
      answer(c, *refused);
    } else if (c.upload->left() == 0) {
      c.waits = true;
      c.deadline = Clock::now() + kLaterTime;
      page_->finish_upload(std::move(c.upload), c.id);
    }
  }

  std::optional<HttpAnswer> begin_upload(Connection& c, const HttpRequest& request) {
    try {
      return page_->begin_upload(request, c.upload);
    } catch (const std::exception&) {
      return error_answer(500, "no answer could be made");
    }
  }

  // Reads or writes what can be read or written now.
  void step(Connection& c) {
    if (c.shut) {
      std::array<char, 16384> buffer{};
      for (int i = 0; i < 16; ++i) {
        const ssize_t n = ::recv(c.socket.get(), buffer.data(), buffer.size(), 0);
        if (n < 0 && (errno == EAGAIN || errno == EINTR)) return;
        if (n > 0) continue;
        c.over = true;
        return;
      }
      return;
    }
    if (c.upload) take_upload(c);
    if (c.upload || c.over) return;
    while (c.out.empty() || (!c.topic.empty() && c.sent == c.out.size())) {
      char buffer[2048];
      const ssize_t n = ::recv(c.socket.get(), buffer, sizeof buffer, 0);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0 && errno == EAGAIN) return;
      if (n <= 0) {
        c.over = true;
        return;
      }
      if (c.waits || !c.topic.empty()) return;  // it has been read whole: more means nothing
      c.in.append(buffer, static_cast<std::size_t>(n));
      ParsedRequest parsed = parse_request(c.in, [&](const HttpRequest& head) {
        const std::size_t most = page_->body_limit(head);
        // A large body has the time that a slow line needs.
        const std::uint64_t bytes = std::min<std::uint64_t>(head.body_bytes, most);
        if (!c.sized)
          c.deadline += std::chrono::seconds(static_cast<int>(static_cast<double>(bytes) / kSlowBytes));
        c.sized = true;
        return most;
      });
      if (parsed.bytes == 0) continue;
      c.head = parsed.request.method == "HEAD";
      const bool put = !parsed.error && parsed.request.method == "PUT";
      c.lingers = put || parsed.error;
      const auto now = parsed.error ? parsed.error
                       : put        ? begin_upload(c, parsed.request)
                                    : answer_to(farm_, *page_, parsed.request, c.id);
      if (c.upload) {
        const std::string first = c.in.substr(parsed.bytes, c.upload->left());
        c.in.clear();
        add_to_upload(c, first);
        take_upload(c);
        if (c.upload || c.over) return;
        continue;
      }
      if (now) {
        answer(c, *now);
      } else {
        c.waits = true;
        c.deadline = Clock::now() + kLaterTime;
      }
    }
    const std::size_t turn = c.sent + kMaxAtOnce;
    while (c.sent < c.size()) {
      if (c.sent >= turn) return;
      const bool head = c.sent < c.out.size();
      const std::string_view rest = head ? std::string_view(c.out).substr(c.sent)
                                         : std::string_view(*c.shared).substr(c.sent - c.out.size());
      const ssize_t n = ::send(c.socket.get(), rest.data(), rest.size(), MSG_NOSIGNAL);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0 && errno == EAGAIN) return;
      if (n < 0) {
        c.over = true;
        return;
      }
      c.sent += static_cast<std::size_t>(n);
    }
    if (!c.topic.empty()) return;
    ::shutdown(c.socket.get(), SHUT_WR);
    c.shut = c.lingers;
    c.over = !c.lingers;
    c.deadline = Clock::now() + kLingerTime;
  }

  Farm& farm_;
  Descriptor listener_, wake_;
  const int port_;
  std::atomic<bool> stopping_{false};
  Mutex mutex_;
  std::vector<Message> messages_ CANDELA_GUARDED_BY(mutex_);
  // The thread has these:
  std::list<Connection> connections_;  // in the order they came
  std::size_t streams_ = 0;
  std::uint64_t last_id_ = 0;
  std::unique_ptr<LivePage> page_;
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

Result<std::unique_ptr<HttpServer>> HttpServer::start(Farm& farm, const std::string& listen,
                                                      const std::string& page_token,
                                                      const std::string& read_token) {
  CANDELA_ASSIGN(const wire::Address address, wire::parse_address(listen, "--http"));
  auto [listener, port] = listen_on(address);
  Descriptor wake(listener.get() < 0 ? -1 : ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (listener.get() < 0 || wake.get() < 0)
    return usage_error(fmt::format("cannot listen on {}: {}", address.text(), std::strerror(errno)))
        .with_field("--http")
        .with_mend("choose another port, or stop what holds it");
  return std::unique_ptr<HttpServer>(
      std::make_unique<Server>(farm, std::move(listener), std::move(wake), port,
                               PageOptions{page_token, read_token, address.loopback}));
}

}  // namespace candela::master
