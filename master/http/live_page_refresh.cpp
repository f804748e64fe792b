// Makes the content of the page once for all viewers, and sends it when it has changed.
#include <fmt/format.h>
#include <pthread.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <set>
#include <utility>

#include "common/base/log.h"
#include "common/base/thread_cpu.h"
#include "common/wire/json.h"
#include "master/api/messages.h"
#include "master/farm.h"
#include "master/http/live_page.h"
#include "master/http/page_json.h"
#include "master/jobs/film_layers.h"

namespace candela::master {
namespace {

// Shares of one core, 1.6 % in all: a costly refresh comes less often. (Thumbnails:
// live_page_images.cpp.)
constexpr double kRowsShare = 0.004, kStatusShare = 0.002, kDetailsShare = 0.002, kPictureShare = 0.008;
constexpr double kLookShare = 0.001;  // of looks at the farm that only its viewers need
constexpr double kRowsPause = 1, kStatusPause = 1, kDetailsPause = 3, kPicturePause = 2;  // seconds at least
constexpr double kRowsLongest = 10;  // seconds that a list may be behind, whatever it costs
constexpr double kMixPause = 6;      // its viewers fetch all its layers
constexpr std::size_t kRowsUnderLock = 50;
constexpr std::uint32_t kMaxEvents = 200;
constexpr std::size_t kMaxListed = 500;
constexpr std::uint64_t kMaxShareUnits = 200000;  // of a job; beyond it the shares are not told
constexpr auto kRound = std::chrono::milliseconds(250);
constexpr double kListLookSeconds = 5;  // between looks at the farm while somebody has the list open

}  // namespace

void LivePage::opened(const std::string& topic) {
  {
    const Lock lock(mutex_);
    ++topics_[topic].viewers;
  }
  wake_.notify_all();
}

void LivePage::closed(const std::string& topic) {
  const Lock lock(mutex_);
  const auto it = topics_.find(topic);
  if (it == topics_.end() || --it->second.viewers > 0) return;
  topics_.erase(it);
  if (topic == "farm") {
    jobs_.clear();
    workers_.clear();
  }
}

void LivePage::run() {
  ::pthread_setname_np(::pthread_self(), "page");
  for (;;) {
    std::deque<Task> tasks;
    {
      Lock lock(mutex_);
      const auto ready = [this]() CANDELA_REQUIRES(mutex_) { return stopping_ || !tasks_.empty(); };
      if (topics_.empty() && wanted_.empty())
        wake_.wait_for(
            lock, std::chrono::duration<double>(std::max(history_.next_seconds() - farm_.now().seconds, 0.0)),
            [&]() CANDELA_REQUIRES(mutex_) { return ready() || !topics_.empty(); });
      else
        wake_.wait_for(lock, kRound, ready);
      if (stopping_) return;
      tasks.swap(tasks_);
    }
    try {
      for (const Task& task : tasks) task();
      look_at_farm();
      if (farm_.stopping()) continue;
      refresh();
      make_wanted_thumbnails();
    } catch (const std::bad_alloc&) {
      kept_.clear();
      log::warn("the page is behind: out of memory");
      std::this_thread::sleep_for(kRound);
    }
  }
}

void LivePage::refresh() {
  std::vector<std::string> names;
  {
    const Lock lock(mutex_);
    for (const auto& [name, topic] : topics_) names.push_back(name);
  }
  // As many topics share what one may spend.
  const double topics = static_cast<double>(names.size());
  for (const std::string& name : names) {
    const auto run_if_due = [&](RefreshBudget Topic::*budget, double pause, double share, const auto& what,
                                double longest = std::numeric_limits<double>::infinity()) {
      {
        const Lock lock(mutex_);
        const auto it = topics_.find(name);
        if (it == topics_.end() || !(it->second.*budget).due(farm_.now().seconds)) return;
      }
      const double before = thread_cpu_seconds();
      what();
      const Lock lock(mutex_);
      if (const auto it = topics_.find(name); it != topics_.end())
        (it->second.*budget)
            .spent(farm_.now().seconds, thread_cpu_seconds() - before, pause, share / topics, longest);
    };
    const std::size_t slash = name.find('/');
    const std::string id = slash == std::string::npos ? "" : name.substr(slash + 1);
    if (id.empty()) {
      run_if_due(
          &Topic::details, kRowsPause, kRowsShare / 2, [&] { refresh_farm(); }, kRowsLongest);
      run_if_due(&Topic::status, kRowsPause, kRowsShare / 2, [&] { refresh_running_jobs(); });
    } else if (name.starts_with("worker/")) {
      run_if_due(&Topic::details, kDetailsPause, kDetailsShare, [&] { refresh_worker(name, id); });
    } else {
      const double pause = name.starts_with("mix/") ? kMixPause : kPicturePause;
      run_if_due(&Topic::status, kStatusPause, kStatusShare, [&] {
        if (const auto status = farm_.full_status(id))
          send(name, "job", wire::page_json(to_message(*status)));
      });
      run_if_due(&Topic::picture, pause, kPictureShare, [&] { refresh_picture(name, id); });
      run_if_due(&Topic::details, kDetailsPause, kDetailsShare,
                 [&] { send(name, "details", details_of(id)); });
    }
  }
}

void LivePage::send(const std::string& topic, const std::string& kind, std::string data) {
  {
    const Lock lock(mutex_);
    const auto it = topics_.find(topic);
    if (it == topics_.end()) return;
    std::string& last = it->second.sent[kind];
    if (last == data) return;
    last = data;
  }
  out_.publish(topic, fmt::format("event: {}\ndata: {}\n\n", kind, data));
}

// The jobs of the list's first page, those that have not ended, and those that were such before: of thousands
// that ended long ago there is no news.
LivePage::Rows LivePage::job_rows() {
  std::set<std::string> chosen;
  {
    const Lock lock(mutex_);
    for (const auto& [id, row] : jobs_) chosen.insert(id);
  }
  auto ended = farm_.with_scheduler([&](Scheduler& s) {
    std::vector<std::pair<std::int64_t, std::string>> out;
    for (const auto& [id, job] : s.jobs())
      if (has_ended(job.row.state))
        out.emplace_back(-job.row.submitted_unix_ms, id);
      else
        chosen.insert(id);
    return out;
  });
  const auto newest = ended.begin() + static_cast<std::ptrdiff_t>(std::min(ended.size(), kMaxListed));
  std::partial_sort(ended.begin(), newest, ended.end());
  for (auto it = ended.begin(); it != newest; ++it) chosen.insert(it->second);
  return rows_of({chosen.begin(), chosen.end()});
}

LivePage::Rows LivePage::rows_of(const std::vector<std::string>& job_ids) {
  Rows rows;
  for (std::size_t i = 0; i < job_ids.size(); i += kRowsUnderLock)
    farm_.with_scheduler([&](Scheduler& s) {
      const Now t = farm_.now();
      for (std::size_t k = i; k < std::min(i + kRowsUnderLock, job_ids.size()); ++k)
        if (const auto job = s.jobs().find(job_ids[k]); job != s.jobs().end()) {
          rows.emplace(job_ids[k], job_line_json(s, job->second, t));
          states_[job_ids[k]] = job->second.row.state;
        }
    });
  return rows;
}

LivePage::Rows LivePage::worker_rows() {
  std::vector<std::string> ids = farm_.with_scheduler([](Scheduler& s) {
    std::vector<std::string> out;
    for (const auto& [id, worker] : s.workers()) out.push_back(id);
    return out;
  });
  Rows rows;
  for (std::size_t i = 0; i < ids.size(); i += kRowsUnderLock)
    farm_.with_scheduler([&](Scheduler& s) {
      const Now t = farm_.now();
      for (std::size_t k = i; k < std::min(i + kRowsUnderLock, ids.size()); ++k)
        if (const auto it = s.workers().find(ids[k]); it != s.workers().end())
          rows.emplace(ids[k], worker_line_json(s, it->second, t));
    });
  return rows;
}

void LivePage::tell_changed(const std::string& kind, const std::vector<std::string>& rows) {
  if (!rows.empty()) out_.publish("farm", fmt::format("event: {}\ndata: {}\n\n", kind, json_array(rows)));
}

// Rows that are new or differ, and the ids of those that are gone. The lists themselves come by GET, after
// the stream is open: the first rows are not told.
void LivePage::refresh_farm() {
  bool tell = false;
  {
    const Lock lock(mutex_);
    const auto it = topics_.find("farm");
    if (it == topics_.end()) return;
    tell = std::exchange(it->second.listed, true);
  }
  const auto publish = [&](const std::string& kind, Rows now, Rows LivePage::*last) {
    std::vector<std::string> changed, gone;
    {
      const Lock lock(mutex_);
      for (const auto& [id, row] : now)
        if (const auto it = (this->*last).find(id); it == (this->*last).end() || it->second != row)
          changed.push_back(row);
      for (const auto& [id, row] : this->*last)
        if (!now.contains(id)) gone.push_back(json_string(id));
      this->*last = std::move(now);
    }
    if (!tell) return;
    tell_changed(kind, changed);
    tell_changed(kind + "-gone", gone);
  };
  states_.clear();
  publish("jobs", job_rows(), &LivePage::jobs_);
  publish("workers", worker_rows(), &LivePage::workers_);
}

// Between two rounds over all: jobs that run, that are new, or whose state is another.
void LivePage::refresh_running_jobs() {
  std::vector<std::string> ids = farm_.with_scheduler([&](Scheduler& s) {
    std::vector<std::string> out;
    for (const auto& [id, job] : s.jobs()) {
      const JobState state = job.row.state;
      const auto known = states_.find(id);
      if (state == JobState::running || (known == states_.end() ? !has_ended(state) : known->second != state))
        out.push_back(id);
    }
    return out;
  });
  Rows now = rows_of(ids);
  std::vector<std::string> changed;
  {
    const Lock lock(mutex_);
    const auto it = topics_.find("farm");
    if (it == topics_.end() || !it->second.listed) return;
    for (auto& [id, row] : now) {
      std::string& last = jobs_[id];
      if (last == row) continue;
      changed.push_back(row);
      last = std::move(row);
    }
  }
  tell_changed("jobs", changed);
}

void LivePage::look_at_farm() {
  bool watched = false;
  {
    const Lock lock(mutex_);
    watched = topics_.contains("farm");
  }
  const Now now = farm_.now();
  if (now.seconds < history_.next_seconds() && (!watched || now.seconds < look_at_)) return;
  const double before = thread_cpu_seconds();
  newest_ = farm_.with_scheduler([&](Scheduler& s) { return history_.look(s, now); });
  look_at_ = now.seconds + std::max(kListLookSeconds, (thread_cpu_seconds() - before) / kLookShare);
  const bool kept = history_.keep_if_due(newest_, now);
  if (watched)
    out_.publish("farm",
                 fmt::format("event: throughput\ndata: {}\n\n",
                             JsonObject().flag("kept", kept).json("point", point_json(newest_)).text()));
}

std::string LivePage::throughput_json() const {
  std::vector<std::string> points;
  for (const FarmPoint& point : history_.points()) points.push_back(point_json(point));
  return JsonObject()
      .number("step_seconds", static_cast<std::int64_t>(FarmHistory::kStepSeconds))
      .json("points", json_array(points))
      .json("now", newest_.unix_ms > 0 ? point_json(newest_) : "null")
      .text();
}

HttpAnswer LivePage::list_jobs(const std::map<std::string, std::string>& query) {
  std::size_t offset = 0;
  if (const auto it = query.find("offset"); it != query.end()) {
    if (it->second.empty() || it->second.size() > 9 ||
        it->second.find_first_not_of("0123456789") != std::string::npos)
      return error_answer(400, "offset must be an integer");
    offset = static_cast<std::size_t>(std::stoul(it->second));
  }
  const auto wanted = query.find("order");
  if (wanted != query.end() && wanted->second != "wall")
    return error_answer(400, "order must be wall, or missing: the newest first");
  bool unlisted = false;
  {
    const Lock lock(mutex_);
    const auto it = topics_.find("farm");
    unlisted = it != topics_.end() && !it->second.listed;
  }
  if (unlisted) refresh_farm();  // so that what changes after this answer is told
  const bool wall = wanted != query.end();
  std::vector<WallPlace> places = farm_.with_scheduler([&](Scheduler& s) {
    if (wall) return wall_places(s);
    std::vector<WallPlace> newest;
    for (const auto& [id, job] : s.jobs()) newest.push_back({.age = -job.row.submitted_unix_ms, .id = id});
    return newest;
  });
  const std::vector<std::string> order = wall_order(std::move(places));
  std::vector<std::string> rows;
  const std::size_t end = std::min(order.size(), offset + kMaxListed);
  for (std::size_t i = offset; i < end; i += kRowsUnderLock)
    farm_.with_scheduler([&](Scheduler& s) {
      for (std::size_t k = i; k < std::min(i + kRowsUnderLock, end); ++k)
        if (const Job* job = s.job(order[k])) rows.push_back(job_line_json(s, *job, farm_.now()));
    });
  return {.type = "application/json",
          .body = JsonObject()
                      .count("total", order.size())
                      .count("offset", offset)
                      .json("jobs", json_array(rows))
                      .text() +
                  "\n"};
}

void LivePage::refresh_worker(const std::string& topic, const std::string& id) {
  if (const auto status = farm_.worker(id)) send(topic, "worker", wire::page_json(to_message(*status)));
  auto events = farm_.store().events("", 10 * kMaxEvents);
  if (!events.ok()) return;
  std::erase_if(*events, [&](const EventRow& e) { return e.worker_id != id; });
  send(topic, "events", events_page_json(*events));
}

Result<std::shared_ptr<Picture>> LivePage::picture_of(const std::string& topic, const std::string& id,
                                                      std::uint64_t indices) {
  for (const Kept& kept : kept_)
    if (kept.topic == topic && kept.indices == indices) return kept.picture;
  std::erase_if(kept_, [&](const Kept& kept) { return kept.topic == topic; });
  const PictureKind kind = kind_of_topic(topic);
  const std::uint64_t bytes = farm_.with_scheduler([&](Scheduler& s) {
    const JobRow& row = s.job(id)->row;
    return kind.kind == PictureKind::Kind::mix
               ? Picture::mix_memory_bytes(row.settings.width, row.settings.height, partition_of(row).size())
               : Picture::memory_bytes(row.settings.width, row.settings.height);
  });
  Result<ImageMemory::Place> place = picture_memory_.take(bytes);
  for (auto kept = kept_.end(); !place.ok() && kept != kept_.begin();) {  // the oldest that nobody looks at
    --kept;
    if (kept->picture.use_count() > 1) continue;
    kept = kept_.erase(kept);
    place = picture_memory_.take(bytes);
  }
  if (!place.ok())
    return resource_error("the page shows as many pictures as the master has memory for")
        .with_mend("close the pages of other jobs");
  struct Made {
    ImageMemory::Place place;
    std::shared_ptr<Picture> picture;
  };
  CANDELA_ASSIGN(std::shared_ptr<Picture> picture, make_picture(farm_, id, kind));
  const auto made = std::make_shared<Made>(Made{std::move(*place), std::move(picture)});
  kept_.push_front({topic, indices, std::shared_ptr<Picture>(made, made->picture.get())});
  return kept_.front().picture;
}

void LivePage::refresh_picture(const std::string& topic, const std::string& id) {
  const std::uint64_t indices = farm_.with_scheduler([&](Scheduler& s) {
    const Job* job = s.job(id);
    return job == nullptr ? 0 : job->row.iterations;
  });
  {
    const Lock lock(mutex_);
    const auto it = topics_.find(topic);
    if (it == topics_.end() || (it->second.picture_made && it->second.iterations == indices)) return;
  }
  auto made = indices == 0 ? Result<std::shared_ptr<Picture>>(refused_error("nothing is merged yet"))
                           : picture_of(topic, id, indices);
  if (!made.ok()) {
    send(topic, "nopicture", JsonObject().add("message", made.error().to_string()).text());
    return;
  }
  const Picture& picture = **made;
  std::vector<std::string> levels;
  for (const Picture::Level& level : picture.levels())
    levels.push_back(JsonObject().count("width", level.width).count("height", level.height).text());
  std::vector<std::string> layers, partition;
  for (const Picture::LayerName& layer : picture.facts().layers)
    layers.push_back(JsonObject().add("name", layer.name).add("letters", layer.letters).text());
  for (const std::string& name : picture.facts().partition) partition.push_back(json_string(name));
  const std::string data = JsonObject()
                               .count("iterations", picture.iterations())
                               .json("levels", json_array(levels))
                               .count("first", picture.first())
                               .add("letters", picture.facts().letters)
                               .json("layers", json_array(layers))
                               .json("partition", json_array(partition))
                               .text();
  {
    const Lock lock(mutex_);
    const auto it = topics_.find(topic);
    if (it == topics_.end()) return;
    it->second.iterations = indices;
    it->second.picture_made = std::move(*made);
    it->second.sent.erase("picture");  // another picture of as many iterations is news
    it->second.sent.erase("nopicture");
  }
  send(topic, "picture", data);
}

std::string LivePage::details_of(const std::string& id) {
  std::map<std::string, double> seconds;  // by worker
  std::map<std::string, std::uint64_t> units;
  const std::uint64_t merged = farm_.with_scheduler([&](Scheduler& s) {
    const Job* job = s.job(id);
    return job == nullptr ? 0 : job->row.units_merged;
  });
  if (merged <= kMaxShareUnits)
    if (auto rows = farm_.store().merged_units(id); rows.ok())
      for (const UnitRow& row : *rows) {
        seconds[row.worker_id] += row.seconds;
        ++units[row.worker_id];
      }
  std::vector<std::string> shares;
  for (const auto& [worker, time] : seconds) {
    const auto status = farm_.worker(worker);
    shares.push_back(JsonObject()
                         .add("worker", worker)
                         .add("name", status ? status->row.name : worker)
                         .count("units", units[worker])
                         .add("seconds", time)
                         .text());
  }
  auto events = farm_.store().events(id, kMaxEvents);
  return JsonObject()
      .json("shares", json_array(shares))
      .json("events", events.ok() ? events_page_json(*events) : "[]")
      .json("convergence", convergence_json(read_convergence(farm_.data_folder() / "jobs" / id)))
      .text();
}

}  // namespace candela::master
