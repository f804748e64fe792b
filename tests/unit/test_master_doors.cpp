// The master's doors to the network, where who comes without a word keeps nobody out, and the threads behind
// them that do long work.
#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <list>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "master/merge/bulk_threads.h"
#include "master/merge/push_gate.h"
#include "tests/token_channel.h"
#include "tests/unit/master_fixture.h"

namespace candela::master {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

// A master on real sockets.
class DoorsTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(log::initialise("test", "off", "text").ok());
    MasterOptions o;
    o.data_dir = folder.path();
    o.listen = "127.0.0.1:0";
    o.http_listen = "127.0.0.1:0";
    auto started = Master::start(o);
    ASSERT_TRUE(started.ok()) << started.error().to_string();
    master = std::move(*started);
  }
  std::shared_ptr<grpc::Channel> dial() const {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    return test::token_channel(fmt::format("127.0.0.1:{}", master->port()), folder.path(), arguments);
  }

  test::TemporaryFolder folder;
  std::unique_ptr<Master> master;
};

// A TCP connection to the port of health and metrics.
class Socket {
 public:
  explicit Socket(int port) : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  }
  ~Socket() { ::close(fd_); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  void send(const std::string& text) const {
    EXPECT_EQ(::send(fd_, text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
  }
  // The next step.
  std::string some() const {
    char buffer[4096];
    const ssize_t n = ::recv(fd_, buffer, sizeof buffer, 0);
    return n > 0 ? std::string(buffer, static_cast<std::size_t>(n)) : "";
  }
  // All until the other side closes.
  std::string rest() const {
    std::string text;
    char buffer[4096];
    for (ssize_t n = 0; (n = ::recv(fd_, buffer, sizeof buffer, 0)) > 0;)
      text.append(buffer, static_cast<std::size_t>(n));
    return text;
  }

 private:
  int fd_;
};

std::string get(int port, const std::string& path) {
  const Socket socket(port);
  socket.send("GET " + path + " HTTP/1.1\r\nHost: x\r\n\r\n");
  return socket.rest();
}

// Claim: one client has some pages and no more, and is told the limit and what to do; a page that it closes
// makes room for the next.
TEST_F(DoorsTest, OneClientHasSomePages) {
  const auto open = [&](std::list<Socket>& pages) {
    pages.emplace_back(master->http_port());
    pages.back().send("GET /api/stream HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " +
                      *wire::read_token_file(folder.path() / "token") + "\r\n\r\n");
    return pages.back().some();
  };
  std::list<Socket> pages;
  std::string answer = open(pages);
  while (answer.starts_with("HTTP/1.1 200") && pages.size() < 60) answer = open(pages);
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 503")) << answer;
  EXPECT_NE((answer + pages.back().rest()).find("close some of them"), std::string::npos) << answer;
  EXPECT_GE(pages.size(), 10U);
  EXPECT_LT(pages.size(), 40U) << "nothing is left for others";
  EXPECT_TRUE(get(master->http_port(), "/healthz").ends_with("ok\n"));
  pages.pop_back();
  pages.pop_back();
  std::list<Socket> again;
  for (int i = 0; i < 500 && !(answer = open(again)).starts_with("HTTP/1.1 200"); ++i) {
    again.clear();
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200")) << answer;
}

// Claim: one client may watch so many jobs at a time and no more; its other calls are answered, and the error
// names the client, the number and the mend.
TEST_F(DoorsTest, OneClientWatchesSomeJobs) {
  const auto channel = dial();
  const auto farm = v1::FarmService::NewStub(channel);
  JobSettings settings;
  settings.width = settings.height = 8;
  v1::WatchJobRequest request;
  request.set_job_id(test::submit(*farm, kScene, test::submission(kScene, settings, 2)));
  request.set_interval_ms(60000);
  struct Watch {
    grpc::ClientContext context;
    std::unique_ptr<grpc::ClientReader<v1::JobStatus>> stream;
  };
  std::list<Watch> watches;
  grpc::Status refused;
  v1::JobStatus status;
  for (int i = 0; i < 300; ++i) {
    Watch& watch = watches.emplace_back();
    watch.stream = farm->WatchJob(&watch.context, request);
    if (watch.stream->Read(&status)) continue;
    refused = watch.stream->Finish();
    watches.pop_back();
    break;
  }
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_GE(watches.size(), 16U);
  EXPECT_LT(watches.size(), 200U) << "nothing is left for others";
  for (const std::string& word :
       {fmt::format("user {}", ::getuid()), std::to_string(watches.size()), std::string("candela list")})
    EXPECT_NE(refused.error_message().find(word), std::string::npos) << refused.error_message();
  grpc::ClientContext context;
  v1::ListJobsResponse jobs;
  EXPECT_TRUE(farm->ListJobs(&context, {}, &jobs).ok());
  for (Watch& watch : watches) {
    watch.context.TryCancel();
    watch.stream->Finish();
  }
}

// Claim: any number of connections that say nothing, or half a request, delays neither health nor metrics;
// such connections are closed after a short while.
TEST_F(DoorsTest, SilentConnectionsDelayNoHealth) {
  std::list<Socket> silent;
  for (int i = 0; i < 100; ++i) {
    silent.emplace_back(master->http_port());
    if (i % 2 == 1) silent.back().send("GET /heal");
  }
  const auto begin = Clock::now();
  for (int i = 0; i < 10; ++i) {
    EXPECT_NE(get(master->http_port(), "/healthz").find("HTTP/1.1 200 OK\r\n"), std::string::npos);
    silent.emplace_back(master->http_port());
  }
  EXPECT_NE(get(master->http_port(), "/metrics").find("candela_jobs"), std::string::npos);
  EXPECT_LT(seconds_since(begin), 5);  // four threads that waited 5 s for each took more than a minute
  for (const Socket& socket : silent) EXPECT_EQ(socket.rest(), "");
  EXPECT_LT(seconds_since(begin), 30);
}

// Claim: what is no request for a page that there is gets the status that says so.
TEST_F(DoorsTest, HttpAnswers) {
  const std::pair<std::string, std::string> cases[] = {
      {"GET /healthz?full HTTP/1.0\r\n\r\n", "HTTP/1.1 200 OK\r\n"},
      {"HEAD /metrics HTTP/1.1\r\n\r\n", "HTTP/1.1 200 OK\r\n"},
      {"GET / HTTP/1.1\r\nHost: localhost:1\r\n\r\n", "HTTP/1.1 200 OK\r\n"},
      {"GET /nothing HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", "HTTP/1.1 404 "},
      {"GET /%2 HTTP/1.1\r\nHost: [::1]:1\r\n\r\n", "HTTP/1.1 400 "},
      // A page of another site, whose name was made to lead here, cannot read this master.
      {"GET /api/jobs HTTP/1.1\r\nHost: localhost\r\n\r\n", "HTTP/1.1 401 "},  // without a token
      {"GET /api/stream HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer x\r\n\r\n", "HTTP/1.1 401 "},
      {"GET /api/jobs HTTP/1.1\r\nHost: evil.example\r\n\r\n", "HTTP/1.1 421 "},
      {"POST /api/check HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9999\r\n\r\n", "HTTP/1.1 413 "},
      {"POST /api/check HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n", "HTTP/1.1 400 "},
      {"POST /api/check HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n", "HTTP/1.1 411 "},
      {"POST /api/check HTTP/1.1\r\nHost: localhost\r\n\r\n", "HTTP/1.1 403 "},  // there is no token
      {"POST /healthz HTTP/1.1\r\n\r\n", "HTTP/1.1 405 "},
      {"hello\r\n\r\n", "HTTP/1.1 400 "},
      {"\r\n\r\n", "HTTP/1.1 400 "},
      {"GET /healthz HTTP/1.1\r\nX: " + std::string(20000, 'x') + "\r\n\r\n", "HTTP/1.1 431 "},
  };
  for (const auto& [request, status] : cases) {
    const Socket socket(master->http_port());
    socket.send(request);
    EXPECT_TRUE(socket.rest().starts_with(status)) << request.substr(0, 40);
  }
  EXPECT_TRUE(get(master->http_port(), "/healthz").ends_with("\r\n\r\nok\n"));
}

// Streams of one kind that were opened and say nothing.
template <class Request, class Response>
struct SilentStreams {
  struct One {
    grpc::ClientContext context;
    Response response;
    std::unique_ptr<grpc::ClientWriter<Request>> writer;
    grpc::Status finish() { return std::exchange(writer, nullptr)->Finish(); }
  };
  template <class Open>
  void add(Open&& open) {
    One& one = all.emplace_back();
    one.context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    one.writer = open(&one.context, &one.response);
  }
  ~SilentStreams() {
    for (One& one : all) {
      one.context.TryCancel();
      if (one.writer) one.finish();
    }
  }
  std::list<One> all;
};

// Claim: 1300 streams of deltas and uploads without a word starve no other call: clients are answered,
// workers register and deliver, and each of the streams is cut off.
TEST_F(DoorsTest, StreamsWithoutASessionStarveNobody) {
  const auto stranger = dial();
  const auto workers = v1::WorkerService::NewStub(stranger);
  const auto uploads = v1::FarmService::NewStub(stranger);
  SilentStreams<v1::DeltaChunk, v1::PushDeltaResponse> deltas;
  SilentStreams<v1::UploadBlobRequest, v1::UploadBlobResponse> blobs;
  for (int i = 0; i < 1300; ++i) {
    if (i % 4 != 0)
      deltas.add([&](auto* context, auto* response) { return workers->PushDelta(context, response); });
    else
      blobs.add([&](auto* context, auto* response) { return uploads->UploadBlob(context, response); });
  }
  const auto begin = Clock::now();
  const auto honest = dial();
  const auto farm = v1::FarmService::NewStub(honest);
  for (int i = 0; i < 20; ++i) {
    grpc::ClientContext context;
    v1::ListJobsResponse jobs;
    const grpc::Status status = farm->ListJobs(&context, {}, &jobs);
    EXPECT_TRUE(status.ok()) << status.error_message();
  }
  JobSettings settings;
  settings.width = kWidth;
  settings.height = kHeight;
  const std::string id = test::submit(*farm, kScene, test::submission(kScene, settings, 2));
  TestWorker worker(honest);
  ASSERT_TRUE(worker.enrol().ok()) << worker.status.error_message();
  ASSERT_TRUE(worker.step());
  ASSERT_TRUE(worker.step());
  EXPECT_LT(seconds_since(begin), 15);
  for (auto& one : deltas.all) {
    const grpc::StatusCode code = one.finish().error_code();
    EXPECT_TRUE(code == grpc::StatusCode::CANCELLED || code == grpc::StatusCode::INVALID_ARGUMENT) << code;
  }
  EXPECT_LT(seconds_since(begin), 40) << "the last ones were cut off by their own deadline";
}

// Claim: who waits without a word gives way to the next, the oldest first, and to time; who has said who it
// is waits for as long as it moves.
TEST(PushGate, UnknownSendersAreFewAndShort) {
  PushGate gate(1 << 20, 1);
  std::vector<int> cancelled;
  std::list<std::unique_ptr<PushGate::Ticket>> tickets;
  const int limit = static_cast<int>(PushGate::kMaxUnknown);
  for (int i = 0; i < limit + 2; ++i)
    tickets.push_back(gate.enter_unknown(100 + 0.001 * i, [&cancelled, i] { cancelled.push_back(i); }));
  EXPECT_EQ(cancelled, (std::vector<int>{0, 1}));
  cancelled.clear();
  auto known =
      gate.enter("w", 1000, PushGate::Order::at_once, 100, [&cancelled] { cancelled.push_back(-1); });
  ASSERT_TRUE(known.ok());
  const auto silent = gate.enter_silent(100, [&cancelled] { cancelled.push_back(-2); });
  gate.cancel_hung(101, 20);
  EXPECT_TRUE(cancelled.empty());
  gate.cancel_hung(103, 20);
  EXPECT_EQ(cancelled.size(), static_cast<std::size_t>(limit));
  cancelled.clear();
  for (int t = 110; t < 1000; t += 10) {
    silent->progress(t);
    gate.cancel_hung(t, 20);
  }
  EXPECT_EQ(cancelled, std::vector<int>{-1}) << "only the delta that did not move";
}

// Claim: deltas that wait for their turn leave threads of the server to other calls, and who has no place is
// told to come again later the longer the queue takes.
TEST(PushGate, DeltasUnderWayAreBounded) {
  PushGate gate(1 << 30, 1);
  EXPECT_EQ(gate.retry_seconds(PushGate::Order::yields), 0.25);
  std::list<std::unique_ptr<PushGate::Ticket>> tickets;
  for (std::size_t i = 0; i < PushGate::kMaxDeltas; ++i) {
    auto ticket = gate.enter("w" + std::to_string(i), 10, PushGate::Order::at_once, 0, [] {});
    ASSERT_TRUE(ticket.ok()) << i;
    tickets.push_back(std::move(*ticket));
  }
  const auto refused = gate.enter("another", 10, PushGate::Order::at_once, 0, [] {});
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().kind, ErrorKind::resource);
  for (int i = 0; i < 20; ++i) {
    const PushGate::MergeTurn turn(gate, PushGate::Order::at_once);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_GT(gate.retry_seconds(PushGate::Order::yields), 0.5);
  EXPECT_LE(gate.retry_seconds(PushGate::Order::yields), 4.0);
  tickets.pop_back();
  EXPECT_TRUE(gate.enter("another", 10, PushGate::Order::at_once, 0, [] {}).ok());
}

// Claim: deltas that yield to a more urgent job leave it a quarter of the places and of the bytes, are merged
// after its own, and are merged when it has none.
TEST(PushGate, UrgentDeltasGoFirst) {
  using Order = PushGate::Order;
  PushGate gate(1000, 1);
  std::list<std::unique_ptr<PushGate::Ticket>> tickets;
  const auto enter = [&](Order order, std::uint64_t bytes) {
    auto ticket = gate.enter("w" + std::to_string(tickets.size()), bytes, order, 0, [] {});
    if (ticket.ok()) tickets.push_back(std::move(*ticket));
    return ticket.ok();
  };
  EXPECT_TRUE(enter(Order::yields, 700));
  EXPECT_FALSE(enter(Order::yields, 100));
  EXPECT_TRUE(enter(Order::at_once, 200));
  EXPECT_FALSE(enter(Order::at_once, 200)) << "the queue is bounded for all";
  tickets.clear();
  std::size_t places = 0;
  while (enter(Order::yields, 1)) ++places;
  EXPECT_EQ(places, PushGate::kMaxDeltas - PushGate::kMaxDeltas / 4);
  EXPECT_TRUE(enter(Order::at_once, 1));
  EXPECT_LT(gate.retry_seconds(Order::at_once), 1.0);

  std::vector<std::string> merged;
  std::mutex mutex;
  std::vector<std::thread> threads;
  {
    const PushGate::MergeTurn under_way(gate, Order::yields);
    const auto wait_for_a_turn = [&](Order order, const char* name) {
      threads.emplace_back([&, order, name] {
        const PushGate::MergeTurn turn(gate, order);
        const std::lock_guard lock(mutex);
        merged.emplace_back(name);
      });
    };
    for (int i = 0; i < 3; ++i) wait_for_a_turn(Order::yields, "other");
    std::this_thread::sleep_for(std::chrono::milliseconds(50));  // they wait already
    for (int i = 0; i < 3; ++i) wait_for_a_turn(Order::at_once, "urgent");
    while (gate.waiting_at_once() < 3) std::this_thread::yield();
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(merged, (std::vector<std::string>{"urgent", "urgent", "urgent", "other", "other", "other"}));
}

// Claim: a delta at 25 KB/s is slow, and no attack.
TEST(PushGate, SlowSendersThatMoveAreNotCutOff) {
  PushGate gate(64 << 20, 1);
  int cancelled = 0;
  auto slow = gate.enter("w", 10 << 20, PushGate::Order::at_once, 0, [&] { ++cancelled; });
  ASSERT_TRUE(slow.ok());
  const double seconds = (10 << 20) / 25e3;
  for (double t = 0; t < seconds; t += 2.6) {  // a chunk of 64 KiB
    (*slow)->progress(t);
    gate.cancel_hung(t, 20);
  }
  EXPECT_EQ(cancelled, 0);
  for (double t = seconds; t < 2 * seconds; t += 2.6) {
    (*slow)->progress(t);
    gate.cancel_hung(t, 20);
  }
  EXPECT_EQ(cancelled, 1) << "one that trickles is";
}

int niceness() {
  return ::getpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()));
}

// Claim: work runs on a thread of the niceness that was asked for, results and exceptions come back, and the
// caller keeps its own priority.
TEST(BulkThreads, RunWorkAtTheirPriority) {
  const int own = niceness();
  for (const int asked : {0, 5}) {
    BulkThreads bulk(1, asked);
    EXPECT_EQ(bulk.run([] { return niceness(); }), std::min(own + asked, 19));
    EXPECT_EQ(bulk.run([] { return std::string("text"); }), "text");
    EXPECT_THROW(bulk.run([]() -> int { throw std::runtime_error("no"); }), std::runtime_error);
    EXPECT_NE(bulk.run([] { return std::this_thread::get_id(); }), std::this_thread::get_id());
    bool done = false;
    bulk.run([&] { done = true; });
    EXPECT_TRUE(done);
  }
  EXPECT_EQ(niceness(), own);
}

// Claim: as many run at once as there are threads, and all callers are served.
TEST(BulkThreads, ServeAllCallers) {
  BulkThreads bulk(2, 0);
  std::atomic<int> running{0}, most{0}, served{0};
  std::vector<std::thread> callers;
  for (int i = 0; i < 16; ++i)
    callers.emplace_back([&] {
      for (int k = 0; k < 20; ++k) {
        const int result = bulk.run([&] {
          const int now = ++running;
          int before = most;
          while (before < now && !most.compare_exchange_weak(before, now)) {
          }
          std::this_thread::yield();
          --running;
          return k;
        });
        served += result == k ? 1 : 0;
      }
    });
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(served, 16 * 20);
  EXPECT_LE(most, 2);
}

}  // namespace
}  // namespace candela::master
