#include "master/http/notices.h"

#include <fmt/format.h>
#include <pthread.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <limits>
#include <set>
#include <utility>

#include "common/base/hash.h"
#include "common/base/log.h"
#include "common/base/module.h"
#include "common/base/text.h"
#include "common/wire/json.h"
#include "master/api/messages.h"
#include "master/farm.h"
#include "master/http/page_json.h"

namespace candela::master {
namespace {

constexpr int kNoticeIdCharacters = 16;
// A disk is nearly full below the smaller of both; it is so no more at this multiple.
constexpr double kFreeShare = 0.05, kFreeAgain = 1.2;
constexpr std::uint64_t kFreeBytes = 10ULL << 30;

double notice_clock() {
  return JobTable::now().seconds;
}

std::string named(const std::string& name, const std::string& id) {
  return name.empty() ? id : fmt::format("{} ({})", name, id);
}

std::string_view past_of(JobState state) {
  return state == JobState::done ? "is done" : state == JobState::failed ? "has failed" : "was cancelled";
}

Notice job_notice(const Scheduler& s, const Job& job, Now now) {
  const JobRow& row = job.row;
  const std::string message = s.message_of(job, now);
  return {fmt::format("job-{}", name(row.state)), now.unix_ms,
          fmt::format("job {} {}{}", named(row.name, row.id), past_of(row.state),
                      message.empty() ? "" : ": " + message),
          "job", job_line_json(s, job, now)};
}

std::optional<Notice> group_notice(const Scheduler& s, const std::string& id, Now now) {
  const auto group = s.groups().find(id);
  if (group == s.groups().end()) return std::nullopt;
  for (const std::string& frame : group->second.jobs)
    if (!has_ended(s.job(frame)->row.state)) return std::nullopt;
  const GroupStatus status = status_of_group(s, id, now);
  if (status.frames < status.frames_submitted) return std::nullopt;  // more frames are to come
  const auto count = [&](JobState state) {
    const auto it = status.states.find(state);
    return it == status.states.end() ? 0U : it->second;
  };
  return Notice{fmt::format("group-{}", name(status.name.state)), now.unix_ms,
                fmt::format("group {} {}: {} of {} frames are done{}", named(status.name.name, id),
                            past_of(status.name.state), count(JobState::done), status.frames,
                            status.message.empty() ? "" : "; " + status.message),
                "group", wire::page_json(to_message(status))};
}

}  // namespace

Result<const Poster*> load_poster() {
  CANDELA_ASSIGN(void* const entry, load_from_module("notices", "candela_poster_1"));
  return reinterpret_cast<const Poster* (*)()>(entry)();
}

std::vector<Notice> notices_of(const Scheduler& s, std::span<const Change> changes, Now now) {
  std::vector<Notice> out;
  std::set<std::string> groups;
  for (const Change& change : changes) {
    const auto* added = std::get_if<AddEvent>(&change);
    if (added == nullptr) continue;
    const EventRow& event = added->row;
    if (event.kind == "done" || event.kind == "failed" || event.kind == "cancelled") {
      const Job* job = s.job(event.job_id);
      if (job == nullptr || name(job->row.state) != event.kind) continue;
      if (job->row.frame) groups.insert(job->row.frame->group_id);
      if (!job->row.frame || job->row.state == JobState::failed) out.push_back(job_notice(s, *job, now));
    } else if (event.kind == "lost" && event.job_id.empty()) {
      const auto worker = s.workers().find(event.worker_id);
      if (worker != s.workers().end())
        out.push_back({"worker-lost", now.unix_ms, "worker " + event.message, "worker",
                       worker_line_json(s, worker->second, now)});
    }
  }
  for (const std::string& id : groups)
    if (auto notice = group_notice(s, id, now)) out.push_back(std::move(*notice));
  return out;
}

FarmLook look_at(const Scheduler& s, Now now) {
  FarmLook out;
  for (const auto& [id, job] : s.jobs()) {
    out.work = job.open_for_leases();
    if (out.work) break;
  }
  for (const auto& [id, worker] : s.workers()) {
    const std::string state = s.worker_state_name(worker, now);
    out.workers += state == "idle" || state == "busy" || state == "set-aside" || state == "stuck" ? 1 : 0;
  }
  return out;
}

std::vector<Notice> FarmWatch::look(const FarmLook& look, Now now) {
  std::vector<Notice> out;
  if (!look.work || look.workers > 0) {
    without_workers_.reset();
    told_workers_ = false;
  } else if (!without_workers_) {
    without_workers_ = now.seconds;
  } else if (!told_workers_ && now.seconds - *without_workers_ >= kNoWorkerSeconds) {
    told_workers_ = true;
    out.push_back(
        {"no-worker", now.unix_ms,
         fmt::format("jobs wait, and no worker has taken part for {:.0f} s", now.seconds - *without_workers_),
         ""});
  }
  const double enough =
      std::min(kFreeShare * static_cast<double>(look.disk_bytes), static_cast<double>(kFreeBytes));
  const auto room = static_cast<double>(look.free_bytes);
  if (look.disk_bytes > 0 && !told_disk_ && room < enough) {
    told_disk_ = true;
    out.push_back(
        {"disk-nearly-full", now.unix_ms,
         fmt::format("the master's disk is nearly full: {:.2f} of {:.2f} GB are free", room * 1e-9,
                     static_cast<double>(look.disk_bytes) * 1e-9),
         "disk",
         JsonObject().count("size_bytes", look.disk_bytes).count("free_bytes", look.free_bytes).text()});
  } else if (room >= kFreeAgain * enough) {
    told_disk_ = false;
  }
  return out;
}

Notices::Notices(NoticeOptions options, const Poster& poster)
    : options_(std::move(options)), poster_(poster), give_up_at_(std::numeric_limits<double>::infinity()) {}

Notices::~Notices() {
  stop();
}

void Notices::start(Farm* farm) {
  farm_ = farm;
  thread_ = std::thread([this] { run(); });
}

void Notices::stop() {
  {
    const Lock lock(mutex_);
    if (!stopping_) give_up_at_ = notice_clock() + options_.last_seconds;
    stopping_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

std::size_t Notices::waiting() const {
  const Lock lock(mutex_);
  return queue_.size();
}

void Notices::tell(std::vector<Notice> notices) {
  if (notices.empty()) return;
  std::vector<Waiting> made;
  for (const Notice& notice : notices) {
    std::string id = random_id("n", kNoticeIdCharacters);
    JsonObject body;
    body.add("id", id).add("event", notice.event).number("unix_ms", notice.unix_ms).add("text", notice.text);
    if (!notice.subject.empty()) body.json(notice.subject, notice.about);
    made.push_back({std::move(id), notice.event, body.text(), notice_clock()});
  }
  {
    const Lock lock(mutex_);
    for (Waiting& notice : made) queue_.push_back(std::move(notice));
    for (; queue_.size() > options_.max_waiting; ++dropped_) queue_.pop_front();
  }
  wake_.notify_all();
}

void Notices::count(std::atomic<std::uint64_t> NoticeCounters::*counter, std::uint64_t n) {
  if (farm_ != nullptr) farm_->counters().notices.*counter += n;
}

void Notices::watch(double now) {
  FarmLook look = farm_->with_scheduler([&](Scheduler& s) { return look_at(s, farm_->now()); });
  std::error_code error;
  if (const auto space = std::filesystem::space(farm_->data_folder(), error); !error) {
    look.disk_bytes = space.capacity;
    look.free_bytes = space.available;
  }
  tell(watch_.look(look, {now, farm_->now().unix_ms}));
}

bool Notices::send(const Waiting& notice) {
  const PostAnswer answer =
      poster_.post({options_.url,
                    notice.body,
                    {"Content-Type: application/json", "User-Agent: candela-master",
                     "Candela-Notice: " + notice.id, "Candela-Event: " + notice.event,
                     "Candela-Signature: sha256=" + hmac_sha256_hex(options_.secret, notice.body)},
                    options_.timeout_seconds,
                    [this] { return notice_clock() >= give_up_at_; }});
  if (answer.code >= 200 && answer.code < 300) {
    if (!last_trouble_.empty()) log::info("notices are delivered again");
    last_trouble_.clear();
    count(&NoticeCounters::sent);
    return true;
  }
  std::string trouble =
      answer.code == 0 ? answer.error : fmt::format("the receiver answered {}", answer.code);
  const bool told = trouble == last_trouble_;
  last_trouble_ = std::move(trouble);
  // An answer about this notice, which another try would not change; others are about the receiver.
  const bool refused = answer.code >= 400 && answer.code < 500 && answer.code != 408 && answer.code != 425 &&
                       answer.code != 429;
  const bool old = notice_clock() - notice.told >= options_.keep_seconds;
  if (!told || refused || old)
    log::warn(fmt::format("notice {} ({}) was not delivered{}: {}", notice.id, notice.event,
                          refused || old ? ", and is given up" : "", escape_unprintable(last_trouble_)));
  count(refused ? &NoticeCounters::refused : old ? &NoticeCounters::dropped : &NoticeCounters::retries);
  return refused || old;
}

void Notices::run() {
  ::pthread_setname_np(::pthread_self(), "notices");
  double pause = options_.first_pause, next_try = 0, next_look = 0;
  for (;;) {
    std::optional<Waiting> first;
    try {
      bool stopping = false;
      std::uint64_t dropped = 0;
      {
        Lock lock(mutex_);
        const double now = notice_clock();
        const double due = std::min(farm_ != nullptr ? next_look : now + options_.look_seconds,
                                    queue_.empty() ? now + options_.look_seconds : next_try);
        if (!stopping_ && due > now)
          wake_.wait_for(lock, std::chrono::duration<double>(due - now), [&]() CANDELA_REQUIRES(mutex_) {
            return stopping_ || (!queue_.empty() && next_try <= notice_clock());
          });
        stopping = stopping_;
        dropped = std::exchange(dropped_, 0);
        if (!queue_.empty() && (stopping || next_try <= notice_clock())) first = queue_.front();
      }
      count(&NoticeCounters::dropped, dropped);
      if (stopping && (!first || notice_clock() >= give_up_at_)) {
        if (first) log::warn(fmt::format("{} notices were not delivered before the stop", waiting()));
        return;
      }
      const double now = notice_clock();
      if (farm_ != nullptr && !stopping && now >= next_look) {
        next_look = now + options_.look_seconds;
        watch(now);
      }
      if (!first) continue;
      const bool done = send(*first);
      next_try = done ? 0 : notice_clock() + pause;
      pause = done ? options_.first_pause : std::min(2 * pause, options_.max_pause);
      if (!done && !stopping) continue;
      // A notice that failed at the stop makes way for the others.
      const Lock lock(mutex_);
      if (!queue_.empty() && queue_.front().id == first->id) queue_.pop_front();
    } catch (const std::bad_alloc&) {
      log::warn("notices are late: out of memory");
      std::this_thread::sleep_for(std::chrono::milliseconds(500));
    }
  }
}

}  // namespace candela::master
