#include "master/truth/job_truth.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "common/base/files.h"
#include "common/base/hash.h"
#include "common/wire/stored_bundle.h"
#include "master/truth/manifest.h"

namespace candela::master {
namespace {

constexpr double kReadingShare = 0.2;  // of the time, at most, that the verification of ended jobs reads
constexpr double kForgetSeconds = 2;   // before a film that was read to verify it gives its memory back
constexpr std::uint64_t kMaxManifestBytes = 64U << 20;

void add_finding(JobReport& report, std::string part, std::string text, std::string mend) {
  report.findings.push_back({std::move(part), std::move(text), std::move(mend)});
}

}  // namespace

std::filesystem::path JobTruth::folder(const std::string& job_id) const {
  return farm_.data_folder() / "jobs" / job_id;
}

Result<std::vector<UnitRow>> JobTruth::merged_rows(const std::string& job_id) {
  CANDELA_TRY(farm_.writer().flush());
  return farm_.store().merged_units(job_id);
}

Result<std::shared_ptr<JobFilm>> JobTruth::open_film(const std::string& job_id, bool use) {
  const std::shared_ptr<JobFilm> film = farm_.film_of(job_id);
  if (!film) return film;
  if (use) film->touch(farm_.now().seconds);
  const Lock opening(film->opening());
  CANDELA_ASSIGN(const JobFilm::Loading loading, film->ensure_loaded());
  if (!loading.read) return film;
  if (!loading.trouble.empty())
    farm_.with_scheduler(
        [&](Scheduler& s) { s.event(farm_.now(), job_id, "", "checkpoint-damaged", loading.trouble); });
  const JobFilm::Account held = film->account();
  const bool agrees = farm_.with_scheduler([&](Scheduler& s) {
    const Job& job = *s.job(job_id);
    if (job.merged != held.merged) return false;
    if (job.row.checkpoint_generation != film->generation())
      s.checkpointed(job_id, film->generation(), count(held.merged), farm_.now());
    return true;
  });
  if (agrees) return film;
  CANDELA_ASSIGN(std::vector<UnitRow> rows, merged_rows(job_id));
  const bool ended = farm_.with_scheduler([&](Scheduler& s) {
    s.reconcile(job_id, held.merged, held.sample_counts, std::move(rows), film->generation(), loading.trouble,
                farm_.now());
    return has_ended(s.job(job_id)->row.state);
  });
  if (ended) film->close();
  return film;
}

bool JobTruth::agree_if_short(const std::string& job_id, JobFilm& film) {
  const Lock opening(film.opening());
  if (film.discarded()) return false;
  // A merge tells the film first and the scheduler then: the scheduler's set must be asked for first.
  const auto counted = farm_.with_scheduler([&](Scheduler& s) { return s.job(job_id)->merged; });
  if (covers(film.holds(), counted)) return false;
  film.discard_ahead();
  const JobFilm::Account held = film.account();
  Result<std::vector<UnitRow>> rows = merged_rows(job_id);
  if (!rows.ok()) return false;
  farm_.with_scheduler([&](Scheduler& s) {
    s.reconcile(job_id, held.merged, held.sample_counts, std::move(*rows), film.generation(), "",
                farm_.now());
  });
  return true;
}

void JobTruth::check_scene(const JobRow& row, JobReport& report) {
  const std::string mend = "submit the scene again";
  const auto bytes = farm_.store().bundle(row.bundle_sha256);
  const auto bundle = bytes.ok() && *bytes ? wire::parse_bundle(**bytes) : input_error("missing");
  if (!bundle.ok())
    return add_finding(report, "scene", "the list of the scene's files cannot be read from the store", mend);
  if (bundle->hash() != row.bundle_sha256)
    return add_finding(report, "scene", "the list of the scene's files is not the one that was submitted",
                       mend);
  for (const bundle::File& file : bundle->files) {
    const bool there = farm_.blobs().size(file.sha256).has_value();
    const Result<bool> whole = farm_.blobs().check(file.sha256);
    if (!whole.ok()) {
      add_finding(report, "scene",
                  fmt::format("'{}' cannot be read: {}", file.path, whole.error().to_string()),
                  "see to the master's disk");
    } else if (!*whole) {
      farm_.blob_lost(file.sha256, there);  // jobs that need it hear of it before a worker asks
      add_finding(report, "scene",
                  fmt::format("'{}' ({}) is {}", file.path, file.sha256, there ? "damaged" : "missing"),
                  mend);
    }
  }
}

Result<void> JobTruth::check_ledger(const std::string& job_id, JobFilm& film, JobReport& report) {
  // Rows first: what is merged in the meantime is in the film then, and in no row yet.
  CANDELA_ASSIGN(const std::vector<UnitRow> rows, merged_rows(job_id));
  const HalfSets held = film.holds();
  HalfSets told;
  for (const UnitRow& u : rows)
    if (u.unit.half > 1 || !told[u.unit.half].insert(u.unit.begin, u.unit.end))
      add_finding(report, "ledger", fmt::format("unit {} stands in it twice, or is of no half", u.id),
                  "restart the master: it agrees the ledger with the film");
  const std::uint64_t missing = count(without(told, held));
  if (missing > 0)
    add_finding(report, "ledger", fmt::format("it tells of {} indices that the film lacks", missing),
                "restart the master: it agrees the ledger with the film");
  return {};
}

void JobTruth::check_states(const std::string& job_id, const JobFilm& film, JobReport& report) {
  const std::vector<DecidedState> held = film.states();
  const auto told = farm_.with_scheduler([&](Scheduler& s) { return s.job(job_id)->states; });
  for (std::size_t e = 0; e < std::min(held.size(), told.size()); ++e)
    if (held[e].sha256 != told[e].sha256)
      return add_finding(report, "state",
                         fmt::format("the film has another state of epoch {} than the store", e),
                         "submit the job again");
}

Result<JobReport> JobTruth::verify(const std::string& job_id) {
  JobReport report;
  const std::shared_ptr<JobFilm> known = farm_.film_of(job_id);
  if (known) {
    const bool in_memory = known->loaded();
    CANDELA_ASSIGN(const JobFilm::Verified files, known->verify_files());
    if (!files.contradiction.empty())
      add_finding(report, "state", files.contradiction, "submit the job again");
    if (!files.damage.empty()) {
      farm_.with_scheduler(
          [&](Scheduler& s) { s.event(farm_.now(), job_id, "", "checkpoint-damaged", files.damage); });
      add_finding(report, "film", files.damage,
                  in_memory ? "the film is in memory and is written again by itself"
                            : "the generation before serves; what it lacks is counted as lost");
    }
    CANDELA_ASSIGN(const std::shared_ptr<JobFilm> film, open_film(job_id));
    if (film) {  // the job was not removed meanwhile
      CANDELA_TRY(check_ledger(job_id, *film, report));
      check_states(job_id, *film, report);
    }
  }
  struct View {
    JobRow row;
    std::size_t starts = 0;
    std::uint64_t lost = 0;
  };
  const View view = farm_.with_scheduler([&](Scheduler& s) {
    const Job& job = *s.job(job_id);
    return View{job.row, job.starts.size(), count(job.lost())};
  });
  report.job_id = job_id;
  report.name = view.row.name;
  report.state = view.row.state;
  report.iterations = view.row.iterations_of(view.row.iterations);
  report.lost = view.lost;
  if (view.lost > 0 && !view.row.repairs_to)
    add_finding(report, "film", fmt::format("{} sequence indices are lost", view.lost),
                fmt::format("`candela repair {}` renders them again", job_id));
  if (view.row.chains && view.row.named_state && view.row.named_state->bootstrap_b > 0 &&
      view.starts != view.row.chains->chains)
    add_finding(
        report, "state",
        fmt::format("the starts of {} chains are known, not of {}", view.starts, view.row.chains->chains),
        "submit the job again");
  for (const Taint& taint : view.row.audit.taints)
    add_finding(report, "samples",
                fmt::format("worker {}, distrusted since {:%Y-%m-%d}, delivered {} of this job", taint.worker,
                            fmt::gmtime(static_cast<std::time_t>(taint.since_unix_ms / 1000)),
                            taint.units > 0 ? fmt::format("{} units", taint.units)
                                            : std::string("the pilot or a part of the bootstrap")),
                "render it again: submit it anew, or extend it, which looks at those units");
  check_scene(view.row, report);
  return report;
}

std::vector<std::string> JobTruth::orphans() const {
  std::vector<std::string> out;
  std::error_code code;
  for (const auto& entry : std::filesystem::directory_iterator(folder(""), code)) {
    const std::string id = entry.path().filename().string();
    if (farm_.with_scheduler([&](Scheduler& s) { return s.job(id) == nullptr; })) out.push_back(id);
  }
  std::sort(out.begin(), out.end());
  return out;
}

JobReport JobTruth::verify_store() const {
  JobReport report;
  for (const std::string& id : orphans()) {
    const auto bytes = read_file(folder(id) / kManifestFile, kMaxManifestBytes);
    const bool whole = bytes.ok() && parse_manifest(*bytes).ok();
    add_finding(report, "store", fmt::format("the folder {} belongs to no job that the store knows", id),
                whole ? fmt::format("`candela repair {}` takes the job in", id)
                      : std::string("its manifest cannot be read: keep the folder elsewhere or remove it"));
  }
  return report;
}

Result<void> JobTruth::keep_manifest(const std::string& job_id) {
  struct View {
    JobRow row;
    std::vector<std::uint64_t> starts;
  };
  const View view = farm_.with_scheduler([&](Scheduler& s) {
    const Job& job = *s.job(job_id);
    return View{job.row, job.starts};
  });
  CANDELA_ASSIGN(const std::optional<std::string> bundle, farm_.store().bundle(view.row.bundle_sha256));
  CANDELA_ASSIGN(const std::string bytes, encode_manifest(view.row, bundle.value_or(""), view.starts));
  JobRow timeless = view.row;
  timeless.elapsed_seconds = 0;
  timeless.thread_seconds_per_iteration = 0;
  CANDELA_ASSIGN(const std::string content, encode_manifest(timeless, bundle.value_or(""), view.starts));
  std::string& written = manifests_[job_id];
  const std::string hash = sha256_hex(content);
  if (written == hash) return {};
  CANDELA_TRY(make_directories(folder(job_id)));
  CANDELA_TRY(write_file_atomically(folder(job_id) / kManifestFile, bytes));
  written = hash;
  return {};
}

Result<void> JobTruth::adopt(const std::string& job_id) {
  CANDELA_ASSIGN(const std::string bytes, read_file(folder(job_id) / kManifestFile, kMaxManifestBytes));
  CANDELA_ASSIGN(Manifest manifest, parse_manifest(bytes));
  if (manifest.row.id != job_id)
    return input_error(fmt::format("the manifest in the folder is of job {}", manifest.row.id));
  const std::vector<Change> changes{PutBundle{manifest.row.bundle_sha256, manifest.bundle_bytes},
                                    PutJob{manifest.row}};
  CANDELA_TRY(farm_.store().write(changes));
  CANDELA_TRY(farm_.take_in(std::move(manifest)));
  return {};
}

Result<bool> JobTruth::repair(const std::string& job_id) {
  if (!farm_.with_scheduler([&](Scheduler& s) { return s.job(job_id) != nullptr; })) {
    const std::vector<std::string> unknown = orphans();
    if (std::find(unknown.begin(), unknown.end(), job_id) == unknown.end()) return false;
    if (auto adopted = adopt(job_id); !adopted.ok())
      return refused_error(
                 fmt::format(
                     "the store knows no job {}, and its folder does not tell enough to take it in: {}",
                     job_id, adopted.error().to_string()))
          .with_field("job_id");
    return true;
  }
  CANDELA_ASSIGN(const std::shared_ptr<JobFilm> film, open_film(job_id));
  if (film) film->reopen();
  const Result<void> changed = farm_.change(job_id, [&](Scheduler& s, Now now) -> Result<void> {
    CANDELA_TRY(s.repair(job_id, now));
    return {};
  });
  if (film && farm_.with_scheduler([&](Scheduler& s) { return has_ended(s.job(job_id)->row.state); }))
    film->close();
  CANDELA_TRY(changed);
  return true;
}

void JobTruth::verify_ended() {
  const auto ids = farm_.with_scheduler([](Scheduler& s) {
    std::vector<std::string> out;
    for (const auto& [id, job] : s.jobs())
      if (has_ended(job.row.state) && job.row.named_state) out.push_back(id);
    return out;
  });
  for (const std::string& id : ids) {
    const double started = farm_.now().seconds;
    const auto film = open_film(id, false);
    if (film.ok() && *film) (*film)->unload_if_idle(farm_.now().seconds, kForgetSeconds);
    const double wait = (farm_.now().seconds - started) * (1 / kReadingShare - 1);
    for (const double end = farm_.now().seconds + wait; farm_.now().seconds < end && !farm_.stopping();)
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    if (farm_.stopping()) return;
  }
}

}  // namespace candela::master
