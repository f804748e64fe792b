#include "master/farm.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/random.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>

#include "common/base/files.h"
#include "common/base/log.h"
#include "common/base/memory_limit.h"
#include "common/wire/stored_bundle.h"
#include "master/jobs/job_status.h"

namespace candela::master {

namespace {

constexpr std::string_view kAlphabet = "abcdefghijkmnpqrstuvwxyz23456789";  // 32

}  // namespace

std::string id_from(std::string_view prefix, std::string_view hex_digits) {
  constexpr std::size_t kCharacters = 10;
  std::string out(prefix);
  for (std::size_t i = 0; i + 1 < hex_digits.size() && out.size() < prefix.size() + kCharacters; i += 2) {
    const auto value = [](char c) { return static_cast<unsigned>(c <= '9' ? c - '0' : c - 'a' + 10); };
    out += kAlphabet[(16 * value(hex_digits[i]) + value(hex_digits[i + 1])) & 31U];
  }
  return out;
}

std::string random_id(std::string_view prefix, int characters) {
  std::string bytes(static_cast<std::size_t>(characters), '\0');
  std::size_t have = 0;
  while (have < bytes.size()) {
    const ssize_t n = ::getrandom(bytes.data() + have, bytes.size() - have, 0);
    if (n > 0) have += static_cast<std::size_t>(n);
  }
  for (char& c : bytes) c = kAlphabet[static_cast<unsigned char>(c) & 31U];
  return std::string(prefix) + bytes;
}

namespace {

// Images that somebody asked for, and films of jobs that have ended, may each take this part of the memory.
constexpr std::uint64_t kImageShare = 4;

std::uint64_t or_default(std::uint64_t given, std::uint64_t otherwise) {
  return given > 0 ? given : otherwise;
}

}  // namespace

Farm::Farm(const FarmOptions& options)
    : options_(options),
      memory_limit_(or_default(options.master.memory_bytes, memory_limit_bytes() / 4 * 3)),
      statistics_limit_(or_default(options.master.statistics_bytes, memory_limit_ / 3)) {}

Farm::~Farm() {
  stop();
  writer_.reset();
  store_.reset();
  for (const int fd : {lock_fd_, folder_fd_})
    if (fd >= 0) ::close(fd);
}

Result<std::unique_ptr<Farm>> Farm::open(const FarmOptions& options) {
  auto farm = std::unique_ptr<Farm>(new Farm(options));
  try {
    CANDELA_TRY(farm->start());
  } catch (const std::bad_alloc&) {
    return out_of_memory("the jobs cannot be read");
  }
  return farm;
}

Result<void> Farm::start() {
  const MasterOptions& o = options_.master;
  if (o.data_dir.empty()) return usage_error("no data folder").with_field("--data");
  CANDELA_TRY(make_directories(o.data_dir / "jobs"));
  CANDELA_TRY(lock_data_folder());
  tighten_data_folder();
  CANDELA_ASSIGN(blobs_, BlobStore::open(o.data_dir / "blobs"));
  CANDELA_ASSIGN(store_, open_sqlite_store(o.data_dir / "master.sqlite"));
  CANDELA_TRY(Retention::finish_removals(*store_, o.data_dir));
  CANDELA_ASSIGN(const std::uint64_t epoch, store_->next_epoch());
  CANDELA_ASSIGN(StoredState state, store_->load());
  SchedulerOptions so;
  so.lease_seconds = o.lease_seconds;
  so.unit_seconds = o.unit_seconds;
  so.memory_bytes = memory_limit_;
  so.statistics_bytes = statistics_limit_;
  so.stuck_seconds = o.stuck_seconds;
  so.audit_share = o.audit_share;
  so.audit_secret = state.audit_secret;
  gate_ = std::make_unique<PushGate>(o.merge_queue_bytes, o.merge_threads);
  writer_ = std::make_unique<StoreWriter>(*store_, [this](const std::string& text) {
    const Lock lock(health_mutex_);
    if (text == store_trouble_) return;  // each try fails alike: once per cause
    if (text.empty())
      log::info("the store can be written again");
    else
      log::error(fmt::format("the store cannot be written, trying again: {}", text));
    store_trouble_ = text;
  });
  table_ = std::make_unique<JobTable>(
      std::make_unique<Scheduler>(so, epoch, state.next_unit_id), *writer_, o.data_dir / "jobs",
      options_.film_writer ? options_.film_writer : FileWriter(&write_file_atomically), o.observer,
      options_.listener);
  truth_ = std::make_unique<JobTruth>(*this);
  // One more than merges, so that a delta's hash is taken while another is merged.
  merging_ = std::make_unique<BulkThreads>(o.merge_threads + 1, o.bulk_niceness);
  // Images that people ask for, beside upkeep.
  keeping_ = std::make_unique<BulkThreads>(2, o.bulk_niceness);
  deltas_ = std::make_unique<DeltaIntake>(*table_, *truth_, *gate_, *merging_, counters_, wake_);
  reports_ = std::make_unique<StateReports>(*table_, *truth_);
  images_ = std::make_unique<ImageWriter>(*table_, *truth_, *store_, *reports_, *keeping_,
                                          memory_limit_ / kImageShare);
  decider_ = std::make_unique<EpochDecider>(*table_, *truth_, *blobs_, wake_);
  upkeep_ = std::make_unique<JobUpkeep>(*table_, *truth_, *images_, *keeping_, counters_, wake_,
                                        options_.master, memory_limit_ / kImageShare);
  retention_ = std::make_unique<Retention>(*table_, *truth_, *upkeep_, *blobs_, *store_, *writer_, counters_,
                                           wake_, options_.master);
  audits_ = std::make_unique<AuditKeeper>(*table_, *upkeep_, *store_, *writer_, wake_);
  CANDELA_TRY(restore_jobs(std::move(state)));
  CANDELA_TRY(writer_->flush());
  start_thread("tick", [this] { tick_loop(); });
  start_thread("upkeep", [this] { upkeep_->upkeep_loop(); });
  start_thread("decisions", [this] { decider_->decide_loop(); });
  start_thread("verification", [this] { truth_->verify_ended(); });
  start_thread("retention", [this] { retention_->loop(); });
  start_thread("audits", [this] { audits_->loop(); });
  return {};
}

// A loop that runs out of memory begins again.
void Farm::start_thread(const char* what, std::function<void()> loop) {
  threads_.emplace_back([this, what, loop = std::move(loop)] {
    constexpr auto kPause = std::chrono::milliseconds(500);
    for (;;) {
      try {
        return loop();
      } catch (const std::bad_alloc&) {
        if (stopping()) return;
        log::error(fmt::format("out of memory ({}): trying again", what));
        std::this_thread::sleep_for(kPause);
      }
    }
  });
}

namespace {

// The films in memory, for the scheduler. Precondition of its calls: the lock of `films` is held.
class LoadedFilms final : public FilmInputs {
 public:
  explicit LoadedFilms(const JobFilms& films) : films_(films) {}
  Answer chain_records(const std::string& job_id, const Unit& unit) const override {
    const auto film = films_.find(job_id);
    if (film == films_.end()) return {State::unread, {}};
    JobFilm::Starts starts = film->second->starts_of(unit);
    switch (starts.state) {
      case JobFilm::Starts::State::whole:
        return {State::whole, std::move(starts.records)};
      case JobFilm::Starts::State::unread:
        return {State::unread, {}};
      case JobFilm::Starts::State::merged:
        return {State::merged, {}};
      case JobFilm::Starts::State::lost:
        break;
    }
    return {State::lost, {}};
  }

 private:
  const JobFilms& films_;
};

}  // namespace

Result<AcquireResult> Farm::acquire(const std::string& worker_id, const std::string& session,
                                    const std::vector<std::string>& warm, LeaseWish wish,
                                    const std::function<void(const Job&, const Lease&)>& describe) {
  // A second time, if the films that the first decision lacked are in memory then.
  for (int attempt = 0;; ++attempt) {
    struct Decision {
      bool known = true;
      AcquireResult result;
    };
    Decision decision = table_->with_films([&](Scheduler& s, const JobFilms& in_memory) {
      const Now t = now();
      if (s.authenticate(worker_id, session, t) == nullptr) return Decision{false, {}};
      const LoadedFilms films(in_memory);
      Decision d{true, s.acquire(worker_id, warm, wish, t, &films)};
      if (d.result.lease) describe(*s.job(d.result.lease->row.job_id), *d.result.lease);
      return d;
    });
    if (!decision.known) return refused_error("this session is not known: register again");
    AcquireResult& result = decision.result;
    for (const std::string& id : result.lacking)
      if (const auto film = film_of(id)) truth_->agree_if_short(id, *film);
    if (result.lease || result.unread.empty() || attempt > 0) return std::move(result);
    for (const std::string& id : result.unread)
      if (auto opened = truth_->open_film(id); !opened.ok())
        log::warn(fmt::format("the film cannot be read: {}", opened.error().to_string()), {.job = id});
  }
}

Result<std::optional<std::string>> Farm::choose_id(const Scheduler& s, JobRow& row) const {
  if (const auto it = tokens_.find(row.idempotency_token);
      !row.idempotency_token.empty() && it != tokens_.end()) {
    const auto first = s.jobs().find(it->second);
    if (first != s.jobs().end() && first->second.row.content_digest == row.content_digest)
      return std::optional<std::string>(it->second);
    if (first != s.jobs().end())
      return refused_error("this token was used for another submission")
          .with_field("idempotency_token")
          .with_mend("use a new token for a new job");
  }
  if (s.jobs().size() >= SchedulerOptions{}.max_jobs)
    return resource_error(fmt::format("the farm has its limit of {} jobs", SchedulerOptions{}.max_jobs));
  CANDELA_TRY(place_in_group(s, row));
  do row.id = random_id("j", 10);
  while (s.job(row.id) != nullptr);
  return std::optional<std::string>();
}

Result<Farm::Submitted> Farm::submit(JobRow row, const std::string& bundle_bytes) {
  const Lock one(submit_mutex_);
  CANDELA_ASSIGN(const std::optional<std::string> existing,
                 with_scheduler([&](Scheduler& s) { return choose_id(s, row); }));
  if (existing) return Submitted{*existing, true};
  row.submitted_unix_ms = now().unix_ms;
  // On disk before it is known: a client that hears an id may rely on it.
  const std::vector<Change> changes{PutBundle{row.bundle_sha256, bundle_bytes}, PutJob{row}};
  CANDELA_TRY(store_->write(changes));
  const std::string id = row.id;
  with_scheduler([&](Scheduler& s) {
    if (!row.idempotency_token.empty()) tokens_[row.idempotency_token] = id;
    s.submit(std::move(row), now());
  });
  return Submitted{id, false};
}

std::optional<JobStatus> Farm::status(const std::string& job_id) {
  return with_scheduler([&](Scheduler& s) -> std::optional<JobStatus> {
    const auto job = s.jobs().find(job_id);
    if (job == s.jobs().end()) return std::nullopt;
    return status_of(s, job->second, now());
  });
}

std::optional<JobStatus> Farm::full_status(const std::string& job_id) {
  std::optional<JobStatus> out = status(job_id);
  if (!out) return out;
  out->epochs = epoch_status(job_id);
  return out;
}

std::optional<EpochStatus> Farm::epoch_status(const std::string& job_id) {
  std::optional<EpochStatus> out = reports_->status(job_id);
  if (!out) return out;
  const film::SampleCounts sample_counts = with_scheduler([&](Scheduler& s) {
    const Job* job = s.job(job_id);
    return job == nullptr ? film::SampleCounts() : job->row.sample_counts;
  });
  if (sample_counts.sampled_merges > 0)
    out->figures.emplace_back(film::kRepeatedMerges, static_cast<double>(sample_counts.repeated_merges) /
                                                         static_cast<double>(sample_counts.sampled_merges));
  return out;
}

std::vector<JobStatus> Farm::open_status() {
  return with_scheduler([&](Scheduler& s) {
    std::vector<JobStatus> out;
    for (const auto& [id, job] : s.jobs())
      if (!has_ended(job.row.state)) out.push_back(status_of(s, job, now()));
    return out;
  });
}

std::vector<WorkerStatus> Farm::all_workers() {
  return with_scheduler([&](Scheduler& s) {
    std::vector<WorkerStatus> out;
    for (const auto& [id, w] : s.workers()) out.push_back(status_of(s, w, now()));
    return out;
  });
}

std::optional<WorkerStatus> Farm::worker(const std::string& id) {
  return with_scheduler([&](Scheduler& s) -> std::optional<WorkerStatus> {
    const auto it = s.workers().find(id);
    if (it == s.workers().end()) return std::nullopt;
    return status_of(s, it->second, now());
  });
}

Result<JobStatus> Farm::change_job(const std::string& job_id,
                                   const std::function<Result<void>(Scheduler&, Now)>& change,
                                   bool refuse_unwritable) {
  if (refuse_unwritable) CANDELA_TRY(writer_->flush());
  const auto removed = [&] {
    return refused_error(fmt::format("job {} has been removed", job_id)).with_field("job_id");
  };
  CANDELA_TRY(with_scheduler([&](Scheduler& s) -> Result<void> {
    if (!s.jobs().contains(job_id)) return removed();
    return change(s, now());
  }));
  wake_.wake();
  std::optional<JobStatus> out = status(job_id);
  if (!out) return removed();
  if (out->row.state == JobState::cancelled)
    if (const auto film = film_of(job_id)) film->close();
  // Whoever hears of an error would try again, or believe that the job goes on as it was.
  if (const auto flushed = writer_->flush(); !flushed.ok())
    out->message += fmt::format("{}this is not on disk yet, and is lost if the master stops before it is: {}",
                                out->message.empty() ? "" : "; ", flushed.error().to_string());
  return std::move(*out);
}

Result<void> Farm::change(const std::string& job_id,
                          const std::function<Result<void>(Scheduler&, Now)>& change) {
  CANDELA_TRY(change_job(job_id, change));
  return {};
}

void Farm::remember_extension(const std::string& token) {
  constexpr std::size_t kExtensions = 10000;
  extensions_.push_back(token);
  if (extensions_.size() > kExtensions) extensions_.pop_front();
}

Result<JobStatus> Farm::extend(const std::string& job_id, const Extension& extension) {
  const auto known = [&](Scheduler&) {
    return !extension.token.empty() &&
           std::find(extensions_.begin(), extensions_.end(), extension.token) != extensions_.end();
  };
  if (with_scheduler(known))  // and its answer was lost
    return change_job(job_id, [](Scheduler&, Now) { return Result<void>(); });
  CANDELA_ASSIGN(const std::shared_ptr<JobFilm> film, truth_->open_film(job_id));
  if (film) film->reopen();
  Result<JobStatus> out = change_job(
      job_id,
      [&](Scheduler& s, Now t) -> Result<void> {
        if (known(s)) return {};
        CANDELA_TRY(s.extend(job_id, extension.iterations, extension.time_seconds, extension.relmse, t));
        if (!extension.token.empty()) remember_extension(extension.token);
        return {};
      },
      true);
  if (film && with_scheduler([&](Scheduler& s) { return has_ended(s.job(job_id)->row.state); }))
    film->close();
  return out;
}

Result<JobStatus> Farm::resume(const std::string& job_id) {
  const auto failed = [&] {
    return with_scheduler([&](Scheduler& s) { return s.job(job_id)->row.state == JobState::failed; });
  };
  std::shared_ptr<JobFilm> film;
  if (failed()) {
    CANDELA_ASSIGN(film, truth_->open_film(job_id));
    if (film) film->reopen();
  }
  Result<JobStatus> out = change_job(job_id, [&](Scheduler& s, Now t) { return s.resume(job_id, t); });
  if (film && failed()) film->close();
  return out;
}

std::string Farm::blob_lost(const std::string& sha256, bool found_damaged) {
  if (with_scheduler([&](Scheduler& s) { return s.lost_state(sha256, now()); })) {
    wake_.wake();
    return fmt::format("the master's copy of state {} is {}: it is decided again", sha256.substr(0, 16),
                       found_damaged ? "damaged" : "missing");
  }
  struct Needy {
    std::string job_id, bundle_sha256;
  };
  std::vector<Needy> jobs;
  bool news = false, damaged = found_damaged;
  with_scheduler([&](Scheduler& s) {
    const auto [lost, fresh] = lost_blobs_.emplace(sha256, found_damaged);
    news = fresh;
    damaged = lost->second;  // it is missing because it was set aside
    for (const auto& [id, job] : s.jobs())
      if (!has_ended(job.row.state)) jobs.push_back({id, job.row.bundle_sha256});
  });
  if (found_damaged) ++counters_.damaged_blobs;
  const auto text_for = [&](const std::string& key) {
    return fmt::format("the master's copy of {} is {}: submit the scene again, which uploads it",
                       key.empty() ? fmt::format("blob {}", sha256)
                                   : fmt::format("'{}' (blob {})", key, sha256.substr(0, 16)),
                       damaged ? "damaged and was set aside in blobs/damaged" : "missing");
  };
  std::string named;                                       // as one of the bundles names it
  std::map<std::string, std::optional<std::string>> keys;  // by bundle; none: it has no such file
  for (const Needy& needy : jobs) {
    auto [key, fresh] = keys.try_emplace(needy.bundle_sha256);
    if (fresh) {
      const auto bytes = store_->bundle(needy.bundle_sha256);
      if (bytes.ok() && *bytes)
        if (const auto bundle = wire::parse_bundle(**bytes); bundle.ok())
          for (const bundle::File& file : bundle->files)
            if (file.sha256 == sha256) key->second = file.path;
    }
    if (!key->second) continue;
    named = *key->second;
    with_scheduler([&](Scheduler& s) {
      const std::string text = text_for(named);
      if (s.lack_blob(needy.job_id, sha256, text, now()))
        s.event(now(), needy.job_id, "", damaged ? "blob-damaged" : "blob-missing", text);
    });
  }
  if (named.empty() && news)
    with_scheduler([&](Scheduler& s) {
      s.event(now(), "", "", damaged ? "blob-damaged" : "blob-missing", text_for({}));
    });
  return text_for(named);
}

void Farm::blob_found(const std::string& sha256) {
  with_scheduler([&](Scheduler& s) {
    if (lost_blobs_.erase(sha256) > 0) s.blob_arrived(sha256, now());
  });
}

Result<Ledger> Farm::ledger(const std::string& job_id) {
  // Reading all units of a job twice around the film's copy would still race with merges; waiting for the
  // queue makes the rows complete for everything merged before, and rows newer than the copy are left out.
  Ledger out;
  std::shared_ptr<const film::MergedFilm> copy;
  CANDELA_ASSIGN(const std::shared_ptr<JobFilm> film, truth_->open_film(job_id));
  if (film) {
    JobFilm::Snapshot snapshot = film->snapshot();
    copy = std::move(snapshot.film);
    out.chain_segments = snapshot.chain_segments;
  }
  // A delta in the film whose row is being queued this instant: its thread needs the scheduler's lock only.
  table_->wait_for(0.2, [&](const Scheduler& s) {
    const Job* job = s.job(job_id);
    for (std::uint32_t h = 0; copy && h < 2; ++h)
      if (!covers(job->merged[h], copy->merged(h))) return false;
    return true;
  });
  CANDELA_TRY(writer_->flush());
  CANDELA_ASSIGN(std::vector<UnitRow> rows, store_->merged_units(job_id));
  for (UnitRow& u : rows) {
    if (copy && u.unit.half < 2 && !copy->merged(u.unit.half).intersects(u.unit.begin, u.unit.end)) {
      const bool newer = with_scheduler([&](Scheduler& s) {
        return s.job(job_id)->merged[u.unit.half].intersects(u.unit.begin, u.unit.end) &&
               !has_ended(s.job(job_id)->row.state);
      });
      if (newer) continue;  // merged after the copy was made
    }
    out.merged.push_back(std::move(u));
  }
  for (std::uint32_t h = 0; copy && h < 2; ++h) {
    for (const auto& [begin, end] : copy->merged(h).ranges()) out.film.push_back({h, begin, end});
    out.film_eye_samples += copy->sample_counts(h).eye_samples;
  }
  return out;
}

std::string Farm::trouble() {
  {
    const Lock lock(health_mutex_);
    if (!store_trouble_.empty()) return "store: " + store_trouble_;
  }
  return with_scheduler([&](Scheduler& s) {
    for (const auto& [id, job] : s.jobs())
      if (!job.note.empty() && !has_ended(job.row.state)) return "job " + id + ": " + job.note;
    for (const auto& [id, job] : s.jobs()) {
      if (!job.lacks.empty() && !has_ended(job.row.state))
        return "job " + id + ": " + job.lacks.begin()->second;
      if (const std::uint64_t lost = count(job.lost()); lost > 0 && has_ended(job.row.state))
        return fmt::format("job {}: {} samples' indices are lost; `candela repair {}` renders them again", id,
                           lost, id);
    }
    for (const auto& [id, job] : s.jobs())
      if (std::string text = s.dispute_text(job); !text.empty()) return fmt::format("job {}: {}", id, text);
    for (const auto& [id, worker] : s.workers())
      if (s.worker_state_name(worker, now()) == "distrusted")
        return fmt::format("worker {} ({}) is distrusted: {}", worker.row.name, id,
                           s.distrusted().at(identity(worker.row)).reason);
    for (const auto& [id, worker] : s.workers())
      if (s.worker_state_name(worker, now()) == "stuck")
        return fmt::format("worker {} ({}) is stuck: {}", worker.row.name, id, s.stuck_text(worker, now()));
    return std::string();
  });
}

// Ends what nobody waits for any more: leases that ran out, senders that hang, images that were sent.
void Farm::tick_loop() {
  constexpr double kTickSeconds = 0.05;
  while (!stopping()) {
    with_scheduler([&](Scheduler& s) { s.tick(now()); });
    gate_->cancel_hung(now().seconds, options_.push_idle_seconds);
    images_->recent().expire(now().seconds);
    std::this_thread::sleep_for(std::chrono::duration<double>(kTickSeconds));
  }
}

void Farm::stop() {
  if (stopped_.exchange(true)) return;
  begin_stop();
  for (std::thread& t : threads_)
    if (t.joinable()) t.join();
  threads_.clear();
  if (!upkeep_) return;  // it never started
  upkeep_->last_checkpoints();
  if (auto flushed = writer_->flush(); !flushed.ok())
    log::error(fmt::format("the store could not be written: {}", flushed.error().to_string()));
}

}  // namespace candela::master
