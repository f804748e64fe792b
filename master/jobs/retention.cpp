#include "master/jobs/retention.h"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <system_error>
#include <vector>

#include "common/base/files.h"
#include "common/base/log.h"
#include "common/wire/stored_bundle.h"

namespace candela::master {
namespace {

namespace fs = std::filesystem;

constexpr double kSleepSeconds = 0.1;
constexpr double kMaxRoundSeconds = 60;
constexpr double kMaxWaitSeconds = 6 * 3600;  // of an old job before it goes
constexpr double kWaitShare = 0.1;            // of the time that finished jobs are kept

fs::path removed_folder(const fs::path& data_folder) {
  return data_folder / "removed";
}

void sync_folder(const fs::path& folder) {
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  ::fsync(fd);
  ::close(fd);
}

void delete_folder(const fs::path& folder, const std::string& job_id) {
  std::error_code code;
  fs::remove_all(folder, code);
  if (code)
    log::warn(fmt::format("{} is tried again at the next start: {}", folder.string(), code.message()),
              {.job = job_id});
}

std::string days(double seconds) {
  if (seconds >= 86400) return fmt::format("{:.3g} days", seconds / 86400);
  return seconds >= 3600 ? fmt::format("{:.3g} hours", seconds / 3600) : fmt::format("{:.3g} s", seconds);
}

}  // namespace

Result<void> Retention::finish_removals(Store& store, const fs::path& data_folder) {
  const fs::path removed = removed_folder(data_folder);
  std::error_code code;
  if (!fs::exists(removed, code)) return {};
  for (fs::directory_iterator entry(removed, code), end; !code && entry != end; entry.increment(code)) {
    const std::string id = entry->path().filename().string();
    CANDELA_TRY(store.write(std::vector<Change>{DropJob{id}}));
    log::info("the removal that a crash broke off is finished", {.job = id});
    delete_folder(entry->path(), id);
  }
  return {};
}

void Retention::restore_waits() {
  const auto rows = store_.overdue();
  if (!rows.ok()) return log::warn("old jobs wait anew: " + rows.error().to_string());
  waits_kept_ = !rows->empty();
  if (options_.keep_finished_seconds <= 0) return keep_waits();  // none waits any more
  for (const OverdueRow& row : *rows) old_[row.job_id] = {row.finished_unix_ms, row.waited_seconds};
}

void Retention::keep_waits() {
  if (old_.empty() && !waits_kept_) return;
  PutOverdue all;
  for (const auto& [id, entry] : old_) all.rows.push_back({id, entry.finished_unix_ms, entry.waited_seconds});
  waits_kept_ = !all.rows.empty();
  writer_.enqueue({std::move(all)});
}

void Retention::loop() {
  restore_waits();
  const double keep = options_.keep_finished_seconds;
  const double round = std::clamp(keep * kWaitShare / 4, kSleepSeconds, kMaxRoundSeconds);
  double next_removal = 0, next_collection = 0;
  while (!wake_.stopping()) {
    const double now = JobTable::now().seconds;
    if (keep > 0 && now >= next_removal) {
      const std::uint64_t before = counters_.jobs_removed;
      remove_old_jobs();
      if (counters_.jobs_removed != before) next_collection = 0;  // what they alone needed may go
      next_removal = now + round;
    }
    if (now >= next_collection) {
      collect_blobs();
      next_collection = now + options_.blob_grace_seconds;
    }
    wake_.sleep(kSleepSeconds);
  }
}

void Retention::remove_old_jobs() {
  const Now t = JobTable::now();
  const double keep = options_.keep_finished_seconds;
  const double wait = std::min(keep * kWaitShare, kMaxWaitSeconds);
  const double passed = t.seconds - last_round_.value_or(t.seconds);
  last_round_ = t.seconds;
  std::map<std::string, Old> old;
  table_.with_scheduler([&](Scheduler& s) {
    for (const auto& [id, job] : s.jobs()) {
      const std::int64_t end = job.row.finished_unix_ms;
      if (has_ended(job.row.state) && end > 0 && static_cast<double>(t.unix_ms - end) >= keep * 1000)
        old[id] = {end, 0};
    }
  });
  std::size_t fresh = 0;
  for (auto& [id, entry] : old) {
    const auto known = old_.find(id);
    if (known != old_.end() && known->second.finished_unix_ms == entry.finished_unix_ms)
      entry.waited_seconds = known->second.waited_seconds + passed;
    else
      ++fresh;
  }
  const std::size_t young = static_cast<std::size_t>(
      std::count_if(old_.begin(), old_.end(), [&](const auto& entry) { return !old.contains(entry.first); }));
  old_ = std::move(old);
  if (fresh > 0) {
    const std::string text =
        fmt::format("{} job(s) ended more than {} ago, such as {}: they are removed in {}", fresh, days(keep),
                    old_.begin()->first, days(wait));
    table_.with_scheduler([&](Scheduler& s) { s.event(t, "", "", "keep-finished", text); });
  }
  if (young > 0)
    log::warn(fmt::format(
        "{} job(s) that were to be removed stay: they were extended, or the clock was set back", young));
  for (auto it = old_.begin(); it != old_.end() && !wake_.stopping();) {
    if (it->second.waited_seconds < wait) {
      ++it;
      continue;
    }
    if (!remove(it->first, it->second.finished_unix_ms)) {
      ++it;  // tried again in the next round
      continue;
    }
    it = old_.erase(it);
  }
  keep_waits();
}

bool Retention::remove(const std::string& job_id, std::int64_t finished_unix_ms) {
  const fs::path folder = table_.folder_of(job_id);
  const fs::path removed = removed_folder(options_.data_dir) / job_id;
  if (auto made = make_directories(removed.parent_path()); !made.ok()) {
    log::warn(fmt::format("no job can be removed: {}", made.error().to_string()));
    return false;
  }
  bool done = false;
  upkeep_.without(job_id, [&] {
    const Now t = JobTable::now();
    if (!table_.with_scheduler([&](Scheduler& s) { return s.withdraw(job_id, finished_unix_ms, t); })) return;
    // A job without a film may have no folder.
    if (::rename(folder.c_str(), removed.c_str()) != 0 && errno != ENOENT) {
      log::warn(fmt::format("the job cannot be removed: {}: {}", folder.string(), std::strerror(errno)),
                {.job = job_id});
      table_.with_scheduler([&](Scheduler& s) { s.put_back(job_id); });
      return;
    }
    sync_folder(removed.parent_path());
    sync_folder(folder.parent_path());
    table_.with_films([&](Scheduler& s, JobFilms& films) {
      const JobRow& row = s.job(job_id)->row;
      const std::string text = fmt::format(
          "'{}', {} since {:%Y-%m-%d %H:%M:%S}Z, with {} iterations: finished jobs are kept for {}", row.name,
          name(row.state), fmt::gmtime(static_cast<std::time_t>(row.finished_unix_ms / 1000)),
          row.iterations_of(row.iterations), days(options_.keep_finished_seconds));
      films.erase(job_id);
      s.forget(job_id, text, t);
    });
    done = true;
  });
  if (!done) return false;
  ++counters_.jobs_removed;
  if (auto written = writer_.flush(); !written.ok()) return true;  // the next start deletes the folder
  delete_folder(removed, job_id);
  return true;
}

std::optional<std::set<std::string>> Retention::needed_blobs() {
  const auto keep_all = [&](const std::string& why) {
    if (blobs_kept_because_ != why) log::warn("scene files that no job needs are not collected: " + why);
    blobs_kept_because_ = why;
    return std::nullopt;
  };
  // Their scene files may be all that a lost store leaves of them.
  if (const auto orphans = truth_.orphans(); !orphans.empty())
    return keep_all(fmt::format("{} folder(s) belong to no job the store knows, such as {}", orphans.size(),
                                orphans.front()));
  std::set<std::string> bundles, needed;
  table_.with_scheduler([&](Scheduler& s) {
    for (const auto& [id, job] : s.jobs()) {
      bundles.insert(job.row.bundle_sha256);
      for (const StateRow& state : job.states) needed.insert(state.sha256);
      needed.insert(job.known_states.begin(), job.known_states.end());
    }
  });
  for (const std::string& sha256 : bundles) {
    const auto bytes = store_.bundle(sha256);
    // A job may have been removed since: its bundle is gone, and needed by nobody.
    if (bytes.ok() && !*bytes && !table_.with_scheduler([&](Scheduler& s) {
          return std::any_of(s.jobs().begin(), s.jobs().end(),
                             [&](const auto& job) { return job.second.row.bundle_sha256 == sha256; });
        }))
      continue;
    const auto bundle = bytes.ok() && *bytes ? wire::parse_bundle(**bytes) : input_error("missing");
    if (!bundle.ok())
      return keep_all(fmt::format("the list of files of bundle {} cannot be read", sha256.substr(0, 16)));
    for (const bundle::File& file : bundle->files) needed.insert(file.sha256);
  }
  blobs_kept_because_.clear();
  return needed;
}

void Retention::collect_blobs() {
  const auto needed = needed_blobs();
  if (!needed) return;
  const auto collected = blobs_.collect(*needed, options_.blob_grace_seconds);
  if (!collected.ok()) return log::warn("scene files: " + collected.error().to_string());
  counters_.blobs = collected->kept;
  counters_.blob_bytes = collected->kept_bytes;
  counters_.blobs_collected += collected->removed;
  counters_.blob_bytes_collected += collected->removed_bytes;
  if (collected->removed > 0)
    log::info(fmt::format("{} scene file(s) of {:.1f} MB that no job needs are removed; {} of {:.1f} MB stay",
                          collected->removed, static_cast<double>(collected->removed_bytes) * 1e-6,
                          collected->kept, static_cast<double>(collected->kept_bytes) * 1e-6));
}

}  // namespace candela::master
