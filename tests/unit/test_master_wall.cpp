// The list of jobs as a wall: its order, the farm's load over the day, thumbnails, and how they are sent.
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "common/image/image.h"
#include "master/http/http_message.h"
#include "master/http/page_json.h"
#include "master/http/thumbnails.h"
#include "master/http/wall.h"
#include "tests/temporary_folder.h"
#include "tests/unit/scheduler_fixture.h"

namespace candela::master {
namespace {

class Wall : public SchedulerFixture {
 protected:
  void add(const std::string& id, std::int32_t priority, std::int64_t submitted) {
    JobRow r = row(id, 100);
    r.priority = priority;
    r.submitted_unix_ms = submitted;
    s->submit(r, now());
  }
  void ended(const std::string& id, JobState state, std::int64_t finished) {
    JobRow r = row(id, 100);
    r.state = state;
    r.finished_unix_ms = finished;
    s->restore(r, {}, {}, {}, {}, now());
  }
};

// Claim: failed jobs come first, the newest first; then running, queued and paused ones; then those that are
// done and cancelled, the newest first. Only queued jobs have a turn.
TEST_F(Wall, StatesComeInTheOrderOfWhatMatters) {
  worker("w");
  add("runs", 0, 1);
  ASSERT_TRUE(lease("w"));
  add("waits", 0, 2);
  add("stands", 0, 3);
  ASSERT_TRUE(s->pause("stands", now()).ok());
  ended("cancelled", JobState::cancelled, 900);
  ended("done-old", JobState::done, 100);
  ended("done-new", JobState::done, 200);
  ended("failed-old", JobState::failed, 5);
  ended("failed-new", JobState::failed, 6);
  EXPECT_EQ(wall_order(wall_places(*s)),
            (std::vector<std::string>{"failed-new", "failed-old", "runs", "waits", "stands", "done-new",
                                      "done-old", "cancelled"}));
  for (const auto& [id, job] : s->jobs()) EXPECT_EQ(turn_of(job).has_value(), id == "waits") << id;
}

// Claim: a day is kept and no more, the oldest first.
TEST_F(Wall, HistoryIsBounded) {
  FarmHistory history;
  history.look(*s, now());
  for (std::size_t i = 0; i < FarmHistory::kMaxPoints + 7; ++i) {
    const Now t = at(clock + FarmHistory::kStepSeconds);
    EXPECT_TRUE(history.keep_if_due(history.look(*s, t), t));
  }
  const std::vector<FarmPoint> points = history.points();
  ASSERT_EQ(points.size(), FarmHistory::kMaxPoints);
  EXPECT_EQ(points.back().unix_ms, now().unix_ms);
  for (std::size_t i = 1; i < points.size(); ++i) EXPECT_EQ(points[i].unix_ms - points[i - 1].unix_ms, 60000);
}

// Claim: the queue is the thread seconds of what is left over the threads that are there; a job that has not
// been measured costs as others of its scene, else as others of its integrator; jobs with a time limit run
// beside each other; paused ones and those without a limit are no part of it.
TEST_F(Wall, QueueIsTheTimeOfWhatIsLeft) {
  const auto submit = [&](const std::string& id, const std::string& scene, std::uint64_t iterations,
                          double seconds_each) {
    JobRow r = row(id, iterations);
    r.bundle_sha256 = scene;
    r.settings.integrator = "path";
    r.thread_seconds_per_iteration = seconds_each;
    s->submit(r, now());
  };
  EXPECT_EQ(load_of(*s, now()).queue_seconds, 0);
  submit("known", "kitchen", 100, 3);
  EXPECT_TRUE(std::isinf(load_of(*s, now()).queue_seconds));  // nobody would render it
  worker("w1");
  worker("w2");
  EXPECT_DOUBLE_EQ(load_of(*s, now()).queue_seconds, 100 * 3 / 2.0);
  submit("like-it", "kitchen", 10, 0);
  EXPECT_DOUBLE_EQ(load_of(*s, now()).queue_seconds, (100 * 3 + 10 * 3) / 2.0);
  submit("other", "atrium", 10, 7);
  submit("unknown", "garden", 10, 0);  // the mean of what is measured of its integrator
  EXPECT_DOUBLE_EQ(load_of(*s, now()).queue_seconds, (100 * 3 + 10 * 3 + 10 * 7 + 10 * (3 + 7) / 2.0) / 2.0);
  ASSERT_TRUE(s->pause("known", now()).ok());
  ASSERT_TRUE(s->pause("other", now()).ok());
  ASSERT_TRUE(s->pause("unknown", now()).ok());
  submit("endless", "kitchen", 0, 3);
  FarmLoad load = load_of(*s, now());
  EXPECT_DOUBLE_EQ(load.queue_seconds, 10 * 3 / 2.0);
  EXPECT_EQ(load.endless, 1U);
  for (const double seconds : {500.0, 400.0}) {
    JobRow r = row("timed-" + std::to_string(seconds), 0);
    r.stop.time_seconds = seconds;
    s->submit(r, now());
  }
  EXPECT_DOUBLE_EQ(load_of(*s, now()).queue_seconds, 500);
  EXPECT_EQ(load.workers, 2U);
  EXPECT_EQ(load.busy, 0U);
  ASSERT_TRUE(lease("w1"));
  EXPECT_EQ(load_of(*s, now()).busy, 1U);
}

Picture flat(std::uint32_t width, std::uint32_t height, float value) {
  return {width, height, std::vector<float>(std::size_t{3} * width * height, value), {.iterations = 4}};
}

image::Image shown(const std::string& png) {
  const test::TemporaryFolder folder;
  std::ofstream(folder.path() / "a.png", std::ios::binary) << png;
  auto image = image::read_image(folder.path() / "a.png");
  EXPECT_TRUE(image.ok());
  return image.ok() ? *image : image::Image{};
}

// Claim: thumbnails have the picture's shape, and its colors if these are near 1; a scene far from there is
// exposed. A pixel counts by its area.
TEST(Thumbnails, ShowThePicture) {
  const auto made = make_thumbnails(flat(1000, 400, 0.5F), "7");
  ASSERT_TRUE(made.ok());
  EXPECT_EQ(made->revision, "7");
  for (std::size_t k = 0; k < kThumbnailSides.size(); ++k) {
    const image::Image image = shown(*made->png[k]);
    EXPECT_EQ(image.width, kThumbnailSides[k]);
    EXPECT_EQ(image.height, (kThumbnailSides[k] * 400 + 500) / 1000);
    for (const float v : image.rgb) ASSERT_NEAR(v, 0.5F, 0.01F);
  }
  for (const float far : {0.001F, 1000.0F}) {
    const auto exposed = make_thumbnails(flat(40, 30, far), "7");
    ASSERT_TRUE(exposed.ok());
    const image::Image image = shown(*exposed->png[0]);
    EXPECT_EQ(image.width, 40U);  // smaller ones stay
    EXPECT_EQ(image.height, 30U);
    EXPECT_NEAR(image.rgb.front(), 1, 0.02);
  }
  // Columns of 0 and 1 in turn, 300 to 96: every pixel is about their mean.
  std::vector<float> stripes(std::size_t{3} * 300 * 200);
  for (std::size_t i = 0; i < stripes.size(); ++i) stripes[i] = (i / 3) % 2 == 0 ? 1.0F : 0.0F;
  const auto mixed = make_thumbnails(Picture(300, 200, stripes, {.iterations = 1}), "1");
  ASSERT_TRUE(mixed.ok());
  for (const float v : shown(*mixed->png[0]).rgb) ASSERT_NEAR(v, 0.5F, 0.17F);
}

// Claim: on disk they are found by their revision alone, and a file that was cut is none.
TEST(Thumbnails, AreKeptByRevision) {
  const test::TemporaryFolder folder;
  EXPECT_FALSE(read_thumbnails(folder.path(), "0-8"));
  const auto made = make_thumbnails(flat(64, 64, 0.25F), "0-8");
  ASSERT_TRUE(made.ok());
  ASSERT_TRUE(write_thumbnails(folder.path(), *made).ok());
  const auto read = read_thumbnails(folder.path(), "0-8");
  ASSERT_TRUE(read);
  for (std::size_t k = 0; k < kThumbnailSides.size(); ++k) EXPECT_EQ(*read->png[k], *made->png[k]);
  EXPECT_FALSE(read_thumbnails(folder.path(), "0-9"));
  const auto file = folder.path() / "thumbnails.bin";
  std::filesystem::resize_file(file, 20);
  EXPECT_FALSE(read_thumbnails(folder.path(), "0-8"));
}

// Claim: the memory of thumbnails is bounded; the ones that were asked for last stay.
TEST(Thumbnails, MemoryKeepsTheLast) {
  const auto png = std::make_shared<const std::string>(std::string(1000, 'x'));
  ThumbnailMemory memory(10000);
  for (int i = 0; i < 5; ++i) memory.keep(std::to_string(i), {"1", {png, png}});
  EXPECT_TRUE(memory.find("0"));
  memory.keep("5", {"1", {png, png}});
  EXPECT_TRUE(memory.find("0"));
  EXPECT_FALSE(memory.find("1"));
  EXPECT_LE(memory.bytes(), 10000U);
  memory.keep("5", {"2", {png, png}});
  EXPECT_EQ(memory.find("5")->revision, "2");
  EXPECT_EQ(memory.bytes(), 10000U);
}

// Claim: the revision stays while a job that runs gets a few iterations more, changes by the time it has
// twice as many, and is another when it ends; before the first merge there is none.
TEST(Thumbnails, RevisionFollowsTheJob) {
  Job job;
  job.row.state = JobState::running;
  EXPECT_EQ(thumbnail_revision(job), "");
  std::set<std::string> seen;
  for (std::uint64_t n = 1; n <= 4096; ++n) {
    job.row.iterations = n;
    seen.insert(thumbnail_revision(job));
    if ((n & (n - 1)) == 0) {
      Job half;
      half.row.state = JobState::running;
      half.row.iterations = n / 2;
      EXPECT_NE(thumbnail_revision(half), thumbnail_revision(job)) << n;
    }
  }
  EXPECT_LT(seen.size(), 30U);
  job.row.state = JobState::done;
  EXPECT_FALSE(seen.contains(thumbnail_revision(job)));
  const std::string before = thumbnail_revision(job);
  job.first_token = 9;  // it began anew
  EXPECT_NE(thumbnail_revision(job), before);
}

// Claim: what lasts may be kept for ever by the browser alone; a file has its name; everything else is not
// kept.
TEST(HttpAnswers, SayHowLongTheyHold) {
  HttpAnswer answer{.type = "image/png", .shared = std::make_shared<const std::string>("bytes")};
  EXPECT_NE(head_text(answer).find("Cache-Control: no-store\r\n"), std::string::npos);
  EXPECT_NE(head_text(answer).find("Content-Length: 5\r\n"), std::string::npos);
  EXPECT_EQ(to_text(answer), head_text(answer) + "bytes");
  EXPECT_EQ(to_text(answer, false), head_text(answer));
  answer.lasting = true;
  answer.file = "a.png";
  const std::string head = head_text(answer);
  EXPECT_NE(head.find("Cache-Control: private, max-age=31536000, immutable\r\n"), std::string::npos);
  EXPECT_EQ(head.find("no-store"), std::string::npos);
  EXPECT_NE(head.find("Content-Disposition: attachment; filename=\"a.png\"\r\n"), std::string::npos);
}

}  // namespace
}  // namespace candela::master
