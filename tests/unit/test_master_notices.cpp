// Notices: which there are, and how they reach receivers that fail, hang or refuse.
#include <sys/stat.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "common/base/hash.h"
#include "master/farm.h"
#include "master/http/notices.h"
#include "tests/unit/http_receiver.h"
#include "tests/unit/master_fixture.h"
#include "tests/unit/scheduler_fixture.h"

namespace candela::master {
namespace {

using test::HttpReceiver;

Notice notice(const std::string& event) {
  return {event, 7, "a \"text\" <of> \u202e people", "job", "{\"id\":\"j1\"}"};
}

NoticeOptions quick(const std::string& url) {
  return {.url = url, .secret = "a secret of the test", .first_pause = 0.01, .max_pause = 0.05};
}

const Poster& poster() {
  const auto loaded = load_poster();
  EXPECT_TRUE(loaded.ok()) << loaded.error().to_string();
  return **loaded;
}

bool eventually(const std::function<bool()>& holds) {
  for (int i = 0; i < 2000; ++i) {
    if (holds()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

// Claim: the signature is HMAC with SHA-256: cases 1, 2 and 6 of RFC 4231.
TEST(Notices, SignAsTheStandardSays) {
  EXPECT_EQ(hmac_sha256_hex(std::string(20, '\x0b'), "Hi There"),
            "b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7");
  EXPECT_EQ(hmac_sha256_hex("Jefe", "what do ya want for nothing?"),
            "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
  EXPECT_EQ(
      hmac_sha256_hex(std::string(131, '\xaa'), "Test Using Larger Than Block-Size Key - Hash Key First"),
      "60e431591ee0b67f0d8a26aacbf5b77f8e0bc6213728c5140546040f0ee37f54");
}

// Claim: a receiver that fails twice gets the same notice a third time, signed, and then the next one.
TEST(Notices, ComeAgainToAReceiverThatFails) {
  HttpReceiver receiver({500, 503});
  Notices notices(quick(receiver.url()), poster());
  notices.start(nullptr);
  notices.tell({notice("job-done"), notice("job-failed")});
  const auto requests = receiver.wait_for(4);
  ASSERT_EQ(requests.size(), 4U);
  EXPECT_EQ(requests[0].body, requests[1].body);
  EXPECT_EQ(requests[1].body, requests[2].body);
  for (const auto& request : requests) {
    EXPECT_TRUE(request.head.starts_with("POST /notices HTTP/1.1\r\n")) << request.head;
    EXPECT_EQ(request.field("Candela-Signature"),
              "sha256=" + hmac_sha256_hex("a secret of the test", request.body));
    EXPECT_EQ(request.field("Content-Type"), "application/json");
    const auto json = nlohmann::json::parse(request.body);
    EXPECT_EQ(json.at("id"), request.field("Candela-Notice"));
    EXPECT_EQ(json.at("event"), request.field("Candela-Event"));
    EXPECT_EQ(json.at("text"), "a \"text\" <of> \\u202e people");
    EXPECT_EQ(json.at("unix_ms"), 7);
    EXPECT_EQ(json.at("job").at("id"), "j1");
  }
  EXPECT_EQ(requests[0].field("Candela-Event"), "job-done");
  EXPECT_EQ(requests[3].field("Candela-Event"), "job-failed");
  EXPECT_NE(requests[0].field("Candela-Notice"), requests[3].field("Candela-Notice"));
  EXPECT_TRUE(eventually([&] { return notices.waiting() == 0; }));
}

// Claim: a receiver that takes a notice and never answers delays nobody: notices are taken at once, no more
// wait than may, the newest of them, and the end comes soon. It is tried again when its time is over.
TEST(Notices, DoNotWaitForAReceiverThatHangs) {
  HttpReceiver receiver({HttpReceiver::kSilence, HttpReceiver::kSilence});
  NoticeOptions options = quick(receiver.url());
  options.timeout_seconds = 0.3;
  options.max_waiting = 10;
  options.last_seconds = 0.2;
  std::vector<HttpReceiver::Request> requests;
  {
    Notices notices(options, poster());
    notices.start(nullptr);
    notices.tell({notice("first")});
    ASSERT_EQ(receiver.wait_for(1).size(), 1U);
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 0; i < 500; ++i) notices.tell({notice("later-" + std::to_string(i))});
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    EXPECT_LT(took.count(), 0.25) << "telling has waited for the receiver";
    EXPECT_LE(notices.waiting(), 10U);
    requests = receiver.wait_for(12);
  }
  ASSERT_GE(requests.size(), 12U);
  std::set<std::string> events;
  for (const auto& request : requests) events.insert(request.field("Candela-Event"));
  for (int i = 490; i < 500; ++i) EXPECT_TRUE(events.contains("later-" + std::to_string(i))) << i;
  EXPECT_FALSE(events.contains("later-100"));

  HttpReceiver silent(std::deque<int>(100, HttpReceiver::kSilence));
  options.url = silent.url();
  options.timeout_seconds = 60;
  Notices notices(options, poster());
  notices.start(nullptr);
  notices.tell({notice("first"), notice("second")});
  ASSERT_EQ(silent.wait_for(1).size(), 1U);
  const auto begin = std::chrono::steady_clock::now();
  notices.stop();
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  EXPECT_LT(took.count(), 20) << "the end has waited for the receiver";
}

// Claim: nobody at the address is no loss: the notice comes when somebody is. An answer that refuses the
// notice ends it, and redirections are not followed.
TEST(Notices, OutlastAReceiverThatIsAwayOrRefuses) {
  HttpReceiver receiver({404, 302}, true);
  Notices notices(quick("http://127.0.0.1:" + std::to_string(receiver.port()) + "/"), poster());
  notices.start(nullptr);
  notices.tell({notice("waits")});
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_EQ(notices.waiting(), 1U);
  receiver.come();
  ASSERT_EQ(receiver.wait_for(1).size(), 1U);
  EXPECT_TRUE(eventually([&] { return notices.waiting() == 0; })) << "404 is final";
  notices.tell({notice("redirected")});
  const auto requests = receiver.wait_for(3);
  ASSERT_EQ(requests.size(), 3U);
  EXPECT_EQ(requests[0].field("Candela-Event"), "waits");
  for (std::size_t i = 1; i < 3; ++i) {
    EXPECT_EQ(requests[i].field("Candela-Event"), "redirected");
    EXPECT_TRUE(requests[i].head.starts_with("POST / ")) << requests[i].head;
  }
}

// Claim: a notice that fails when it is old is given up, so that it does not keep others back for ever.
TEST(Notices, AreGivenUpWhenTheyAreOld) {
  HttpReceiver receiver({500});
  NoticeOptions options = quick(receiver.url());
  options.keep_seconds = 0;
  Notices notices(options, poster());
  notices.start(nullptr);
  notices.tell({notice("old"), notice("next")});
  const auto requests = receiver.wait_for(2);
  ASSERT_EQ(requests.size(), 2U);
  EXPECT_EQ(requests[1].field("Candela-Event"), "next");
}

// Claim: only http and https addresses are taken, and plain HTTP to another machine is told.
TEST(Notices, KnowTheirTargets) {
  for (const char* bad : {"", "x", "ftp://h/", "file:///etc/passwd", "https://", "http://a b/", "gopher://h",
                          "http://h/\r\nX: y", "javascript:1", "http:///x", "https:///render.example.org/"})
    EXPECT_FALSE(poster().check(bad).error.empty()) << bad;
  for (const char* good : {"http://127.0.0.1:1/x", "https://render.example.org/a?b=c", "http://localhost/",
                           "http://[::1]:80/", "http://127.1.2.3/"}) {
    EXPECT_EQ(poster().check(good).error, "") << good;
    EXPECT_FALSE(poster().check(good).in_clear) << good;
  }
  for (const char* clear : {"http://render.example.org/", "http://127.example.org/", "http://10.0.0.1/"})
    EXPECT_TRUE(poster().check(clear).in_clear) << clear;
}

class NoticesOf : public SchedulerFixture {
 protected:
  void submit(const std::string& id, std::optional<int> frame = {}) {
    JobRow j = row(id, 8);
    j.name = "name of " + id;
    if (frame) j.frame = FrameRow{"g", "shot", *frame, 3};
    s->submit(std::move(j), now());
  }
  std::vector<std::string> events() {
    std::vector<std::string> out;
    for (Notice& n : notices_of(*s, s->take_changes(), now())) {
      out.push_back(n.event);
      last = std::move(n);
    }
    return out;
  }
  Notice last;
};

// Claim: the ends of jobs are told, once each, with the fields that a list has; a worker that is lost is,
// one that leaves is not.
TEST_F(NoticesOf, JobsAndWorkers) {
  using Events = std::vector<std::string>;
  worker("w");
  submit("a");
  submit("b");
  EXPECT_EQ(events(), Events{});
  s->fail_job("a", "no light", now());
  EXPECT_EQ(events(), Events{"job-failed"});
  EXPECT_EQ(last.text, "job name of a (a) has failed: no light");
  const auto json = nlohmann::json::parse(last.about);
  EXPECT_EQ(json.at("id"), "a");
  EXPECT_EQ(json.at("state"), "failed");
  EXPECT_EQ(json.at("message"), "no light");
  ASSERT_TRUE(s->cancel("b", now()).ok());
  EXPECT_EQ(events(), Events{"job-cancelled"});
  EXPECT_EQ(last.text, "job name of b (b) was cancelled");
  at(clock + 40);
  s->tick(now());
  EXPECT_EQ(events(), Events{"worker-lost"});
  EXPECT_EQ(last.subject, "worker");
  EXPECT_EQ(nlohmann::json::parse(last.about).at("state"), "lost");
  s->tick(now());
  EXPECT_EQ(events(), Events{});
  worker("v");
  s->deregister("v", now());
  EXPECT_EQ(events(), Events{});
}

// Claim: of a group its end is told, once, when all its frames are there and have ended; of its frames their
// failures.
TEST_F(NoticesOf, GroupsTellTheirEnd) {
  using Events = std::vector<std::string>;
  submit("f1", 1);
  submit("f2", 2);
  ASSERT_TRUE(s->cancel("f1", now()).ok());
  ASSERT_TRUE(s->cancel("f2", now()).ok());
  EXPECT_EQ(events(), Events{}) << "the third frame is not there yet";
  submit("f3", 3);
  s->fail_job("f3", "no light", now());
  EXPECT_EQ(events(), (Events{"job-failed", "group-failed"}));
  EXPECT_EQ(last.text, "group shot (g) has failed: 0 of 3 frames are done; frame 3: no light");
  const auto json = nlohmann::json::parse(last.about);
  EXPECT_EQ(json.at("id"), "g");
  EXPECT_EQ(json.at("states").at("cancelled"), 2);
}

// Claim: work without a worker is told after a minute, once, and again after a worker was there; work that
// nobody waits for is not.
TEST(FarmWatch, TellsOnceThatThereIsNoWorker) {
  FarmWatch watch;
  double clock = 0;
  const auto told = [&](bool work, std::size_t workers, double seconds) {
    clock += seconds;
    const auto notices = watch.look({work, workers, 0, 0}, {clock, 0});
    EXPECT_TRUE(notices.empty() || notices.front().event == "no-worker");
    return notices.size();
  };
  EXPECT_EQ(told(true, 0, 5), 0U);
  EXPECT_EQ(told(true, 0, 50), 0U);
  EXPECT_EQ(told(true, 0, 11), 1U);
  EXPECT_EQ(told(true, 0, 500), 0U);
  EXPECT_EQ(told(true, 2, 5), 0U);
  EXPECT_EQ(told(true, 0, 5), 0U);
  EXPECT_EQ(told(true, 0, 61), 1U);
  EXPECT_EQ(told(false, 0, 5), 0U);
  EXPECT_EQ(told(false, 0, 500), 0U);
  EXPECT_EQ(told(true, 0, 5), 0U);
}

// Claim: a disk below a twentieth, or below 10 GiB if that is less, is told once; again only after it had
// clearly more.
TEST(FarmWatch, TellsOnceThatTheDiskIsNearlyFull) {
  constexpr std::uint64_t kGiB = 1ULL << 30;
  const auto told = [](FarmWatch& watch, std::uint64_t size, double free_gib) {
    return watch.look({false, 0, size * kGiB, static_cast<std::uint64_t>(free_gib * double{kGiB})}, {0, 0})
        .size();
  };
  FarmWatch small, large;
  EXPECT_EQ(told(small, 20, 1.01), 0U);
  EXPECT_EQ(told(small, 20, 0.99), 1U);
  EXPECT_EQ(told(small, 20, 0.5), 0U);
  EXPECT_EQ(told(small, 20, 1.1), 0U);
  EXPECT_EQ(told(small, 20, 0.9), 0U) << "it never was clearly better";
  EXPECT_EQ(told(small, 20, 1.3), 0U);
  EXPECT_EQ(told(small, 20, 0.9), 1U);
  EXPECT_EQ(told(large, 4000, 10.1), 0U);
  EXPECT_EQ(told(large, 4000, 9.9), 1U);
}

class NotifyingMaster : public MasterTest {
 protected:
  void SetUp() override {
    ASSERT_TRUE(log::initialise("test", "off", "text").ok());
    notify = receiver.url();
    start();
  }
  HttpReceiver receiver{std::deque<int>{500}};
};

// Claim: a master tells of a job that is done, signed with the secret that only its user can read, although
// the receiver failed first; a cancelled group of frames is one notice.
TEST_F(NotifyingMaster, TellsOfItsJobs) {
  const std::string id = submit(4);
  TestWorker worker(channel);
  ASSERT_TRUE(worker.enrol().ok());
  while (worker.step()) {
  }
  ASSERT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  auto requests = receiver.wait_for(2);
  ASSERT_EQ(requests.size(), 2U);
  const auto json = nlohmann::json::parse(requests[1].body);
  EXPECT_EQ(json.at("event"), "job-done");
  EXPECT_EQ(json.at("job").at("id"), id);
  EXPECT_EQ(json.at("job").at("state"), "done");
  EXPECT_EQ(json.at("job").at("iterations"), 4);
  const auto file = folder.path() / "notify-secret";
  const auto secret = wire::read_token_file(file);
  ASSERT_TRUE(secret.ok());
  EXPECT_EQ(requests[1].field("Candela-Signature"), "sha256=" + hmac_sha256_hex(*secret, requests[1].body));
  struct stat facts {};
  ASSERT_EQ(::stat(file.c_str(), &facts), 0);
  EXPECT_EQ(facts.st_mode & 0777U, 0600U);

  std::string group;
  for (int frame = 1; frame <= 3; ++frame) {
    v1::SubmitRequest request = submission(100);
    request.mutable_frame()->set_group_name("shot");
    request.mutable_frame()->set_group_token("token");
    request.mutable_frame()->set_frame(frame);
    request.mutable_frame()->set_frames(3);
    group = show(test::submit(*farm, kScene, request)).frame().group_id();
  }
  v1::SteerGroupRequest cancel;
  cancel.set_group_id(group);
  cancel.set_action(v1::SteerGroupRequest::ACTION_CANCEL);
  v1::GroupStatus cancelled;
  grpc::ClientContext context;
  ASSERT_TRUE(farm->SteerGroup(&context, cancel, &cancelled).ok());
  requests = receiver.wait_for(3);
  ASSERT_EQ(requests.size(), 3U);
  EXPECT_EQ(nlohmann::json::parse(requests[2].body).at("event"), "group-cancelled");
}

// Claim: a master with a bad address or secret for notices does not start, and says why.
TEST(NotifyOptions, AreCheckedFirst) {
  const test::TemporaryFolder folder;
  const auto error_of = [&](const std::string& url, const std::string& file) {
    MasterOptions o;
    o.data_dir = folder.path() / "data";
    o.listen.clear();
    o.notify = url;
    o.notify_secret_file = file;
    const auto started = Master::start(o);
    return started.ok() ? std::string() : started.error().to_string();
  };
  const std::string file = (folder.path() / "secret").string();
  std::ofstream(file) << "0123456789abcdef0123\n";
  ::chmod(file.c_str(), 0644);
  EXPECT_NE(error_of("ftp://h/", "").find("--notify"), std::string::npos);
  EXPECT_NE(error_of("", file).find("--notify-secret-file"), std::string::npos);
  const std::string open = error_of("http://127.0.0.1:1/", file);
  EXPECT_NE(open.find("--notify-secret-file"), std::string::npos) << open;
  EXPECT_NE(open.find("chmod 600"), std::string::npos) << open;
  EXPECT_FALSE(error_of("http://127.0.0.1:1/", file + ".missing").empty());
  ::chmod(file.c_str(), 0600);
  EXPECT_EQ(error_of("http://127.0.0.1:1/", file), "");
}

}  // namespace
}  // namespace candela::master
