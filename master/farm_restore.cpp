// Takes the data folder and its content into the farm: at a start, and when a job is taken in again.
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/resource.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "common/base/log.h"
#include "common/base/version.h"
#include "master/farm.h"
#include "master/jobs/convergence.h"
#include "master/store/private_folder.h"

namespace candela::master {
namespace {

bool address_space_is_limited() {
  rlimit limit{};
  return ::getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY;
}

}  // namespace

// The folder itself is locked as well as a file in it: a file may be removed, and its successor locked by
// another master. A file system whose folders cannot be locked (NFS) leaves the file.
Result<void> Farm::lock_data_folder() {
  const std::filesystem::path& folder = options_.master.data_dir;
  lock_fd_ = ::open((folder / "lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  folder_fd_ = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (lock_fd_ < 0 || folder_fd_ < 0)
    return input_error(fmt::format("cannot write in the data folder: {}", std::strerror(errno)))
        .at(folder.string(), 0)
        .with_field("--data");
  if (::flock(lock_fd_, LOCK_EX | LOCK_NB) != 0 ||
      (::flock(folder_fd_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK))
    return usage_error("another master uses this data folder")
        .at(folder.string(), 0)
        .with_field("--data")
        .with_mend("stop it, or give another folder");
  return {};
}

void Farm::tighten_data_folder() const {
  const std::filesystem::path& folder = options_.master.data_dir;
  const Tightened tightened = make_private(folder);
  if (tightened.changed > 0)
    log::info(fmt::format("took from other users the access to '{}': {} files and folders", folder.string(),
                          tightened.changed));
  if (!tightened.left.empty())
    log::warn(fmt::format("other users have access to '{}', which is not this user's: chmod go= {}",
                          tightened.left.string(), tightened.left.string()));
}

Result<void> Farm::restore_jobs(StoredState state) {
  const Now t = now();
  std::map<std::string, std::vector<UnitRow>> unmerged;
  for (UnitRow& u : state.unmerged_units) unmerged[u.job_id].push_back(std::move(u));
  std::map<std::string, std::vector<BootstrapRow>> bootstraps;
  for (BootstrapRow& b : state.bootstraps) bootstraps[b.job_id].push_back(std::move(b));
  struct Restored {
    JobRow row;
    std::vector<UnitRow> merged;
    RestoredStages chains;
    RestoredFilm film;  // null before the pilot
  };
  std::vector<Restored> jobs;  // their films are read before the lock is taken
  std::uint64_t read_bytes = 0;
  for (JobRow& row : state.jobs) {
    const std::string id = row.id;
    // The store has no upper end of the error; the record for people has.
    if (const auto points = read_convergence(table_->folder_of(id));
        !points.empty() && std::isfinite(row.relmse))
      row.relmse_upper = points.back().relmse_upper;
    CANDELA_ASSIGN(std::vector<UnitRow> merged, store_->merged_units(id));
    RestoredStages chains{std::move(bootstraps[id]), std::move(state.chain_starts[id]), 0,
                          std::move(state.states[id])};
    RestoredFilm film;
    if (row.named_state) {
      const bool trusted = has_ended(row.state) && row.checkpoint_iterations == row.iterations;
      // A film that is not read here is read when somebody asks for it. Those of ended jobs are verified
      // meanwhile (JobTruth::verify_ended), others wait for memory.
      const MemoryNeed need = need_of(row);
      // With a limited address space no film is read here: threads that start later need their part first.
      const bool fits = !address_space_is_limited() && read_bytes + need.all() <= memory_limit_;
      if (!trusted && fits) {
        auto restored = restore_film(row, chains);
        if (restored.ok()) {
          film = std::move(*restored);
          read_bytes += need.held();
        } else if (restored.error().kind != ErrorKind::resource) {
          return std::move(restored).error();
        } else {
          log::warn(restored.error().to_string(), {.job = id});
        }
      }
      if (!film.film) {
        film.film = table_->make_film(row);
        for (const UnitRow& u : merged)
          if (u.unit.half < 2) film.held.merged[u.unit.half].insert(u.unit.begin, u.unit.end);
        film.held.sample_counts = row.sample_counts;
      }
      if (has_ended(row.state)) film.film->close();
    }
    jobs.push_back({std::move(row), std::move(merged), std::move(chains), std::move(film)});
  }
  table_->with_films([&](Scheduler& s, JobFilms& films) {
    for (const DistrustRow& row : state.distrusted) s.restore_distrust(row);
    for (Restored& job : jobs) {
      const std::string id = job.row.id;
      if (!job.row.idempotency_token.empty()) tokens_[job.row.idempotency_token] = id;
      if (job.film.film) films[id] = job.film.film;
      if (!job.film.trouble.empty()) s.event(t, id, "", "checkpoint-damaged", job.film.trouble);
      s.restore(std::move(job.row), job.film.held.merged, job.film.held.sample_counts,
                std::move(unmerged[id]), std::move(job.merged), t, job.chains);
    }
  });
  warn_of_orphans();
  // A worker of another build would render units whose deltas are refused, until these units had failed too
  // often. Without its session and its leases it registers again, and is told why it is refused.
  std::set<std::string> others;
  for (WorkerRow& w : state.workers) {
    if (w.build_id == build_id()) continue;
    w.session.clear();
    others.insert(w.id);
  }
  for (LeaseRow& l : state.leases)
    if (others.contains(l.worker_id)) l.worker_id.clear();
  with_scheduler([&](Scheduler& s) {
    for (const WorkerRow& w : state.workers) s.restore_worker(w, t);
    for (const LeaseRow& l : state.leases) s.restore_lease(l, t);
  });
  if (!state.jobs.empty()) log::info(fmt::format("continuing with {} job(s)", state.jobs.size()));
  return {};
}

// If memory runs out (resource), nothing has changed.
Result<Farm::RestoredFilm> Farm::restore_film(JobRow& row, RestoredStages& restored) const {
  RestoredFilm out;
  out.film = table_->make_film(row);
  CANDELA_ASSIGN(const JobFilm::Loading loading, out.film->ensure_loaded());
  out.trouble = loading.trouble;
  if (auto summary = out.film->chain_summary(row.bootstrap)) row.chain_summary = std::move(*summary);
  restored.record_bytes = out.film->largest_record_bytes();
  // The store may lag behind the film after a power cut.
  for (const DecidedState& state : out.film->states())
    if (const auto there = blobs_->size(state.sha256);
        state.epoch == restored.states.size() && (there || state.size_bytes > 0))
      restored.states.push_back(
          {row.id, state.epoch, state.name, state.sha256, there.value_or(state.size_bytes)});
  out.held = out.film->account();
  row.checkpoint_iterations = count(out.held.merged);
  row.checkpoint_generation = out.film->generation();
  return out;
}

Result<void> Farm::take_in(Manifest manifest) {
  JobRow& row = manifest.row;
  const std::string id = row.id;
  RestoredStages restored{{}, std::move(manifest.chain_starts), 0, {}};
  CANDELA_ASSIGN(const RestoredFilm opened, restore_film(row, restored));
  table_->with_films([&](Scheduler& s, JobFilms& films) {
    films[id] = opened.film;
    if (!row.idempotency_token.empty()) tokens_[row.idempotency_token] = id;
    if (!opened.trouble.empty()) s.event(now(), id, "", "checkpoint-damaged", opened.trouble);
    s.adopt(std::move(row), opened.held.merged, opened.held.sample_counts, restored, now());
  });
  wake_.wake();
  return writer_->flush();
}

// Films of jobs that the store does not know: it was lost, or cut short by damage, and its jobs with it.
// Nothing else would tell, as SQLite takes a damaged end of its log for the end.
void Farm::warn_of_orphans() {
  const std::vector<std::string> orphans = truth_->orphans();
  if (orphans.empty()) return;
  const std::string text = fmt::format(
      "{} folder(s) in {} belong to no job the store knows, such as {}: the store may be damaged, or not the "
      "one they were made with; `candela verify` lists them, `candela repair ID` takes a job in",
      orphans.size(), (options_.master.data_dir / "jobs").string(), orphans.front());
  with_scheduler([&](Scheduler& s) { s.event(now(), "", "", "orphans", text); });
}

}  // namespace candela::master
