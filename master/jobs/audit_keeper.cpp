#include "master/jobs/audit_keeper.h"

#include <fmt/format.h>

#include <filesystem>
#include <utility>

#include "common/base/log.h"

namespace candela::master {
namespace {

constexpr double kLookSeconds = 0.05;
constexpr double kLookAgainSeconds = 1;

}  // namespace

void AuditKeeper::loop() {
  std::string reported;
  while (!wake_.stopping()) {
    const Result<void> done = step();
    const std::string text = done.ok() ? std::string() : done.error().to_string();
    if (!text.empty() && text != reported) log::warn(fmt::format("audits wait: {}", text));
    reported = text;
    wake_.sleep(done.ok() ? kLookSeconds : kLookAgainSeconds);
  }
}

Result<void> AuditKeeper::step() {
  AuditWork work = table_.with_scheduler([](Scheduler& s) { return s.audit_work(); });
  for (AuditWork::Tainting& tainting : work.taints) taints_.push_back(std::move(tainting));
  for (const std::string& id : work.anew) CANDELA_TRY(begin_anew(id));
  for (const AuditWork::Doubt& doubt : work.doubts) CANDELA_TRY(look_for_doubts(doubt));
  while (!taints_.empty()) {
    CANDELA_TRY(taint(taints_.back()));
    taints_.pop_back();
  }
  return {};
}

Result<void> AuditKeeper::look_for_doubts(const AuditWork::Doubt& doubt) {
  CANDELA_TRY(writer_.flush());
  CANDELA_ASSIGN(const std::vector<UnitRow> rows, store_.merged_units(doubt.job_id));
  table_.with_scheduler([&](Scheduler& s) { s.doubt(doubt.job_id, doubt.doubts, rows, JobTable::now()); });
  wake_.wake();
  return {};
}

// The store knows first that the job begins anew: a master that ends in the middle of it starts here again.
Result<void> AuditKeeper::begin_anew(const std::string& job_id) {
  CANDELA_TRY(writer_.flush());
  Result<void> done;
  upkeep_.without(job_id, [&] {
    if (const std::shared_ptr<JobFilm> film = table_.film_of(job_id)) {
      const Lock opening(film->opening());
      done = film->discard();
      if (!done.ok()) return;
    }
    std::error_code code;
    for (const char* file : {"image.exr", "convergence.txt"})
      std::filesystem::remove(table_.folder_of(job_id) / file, code);
    table_.with_films([&](Scheduler& s, JobFilms& films) {
      films.erase(job_id);
      s.begin_anew(job_id, JobTable::now());
    });
  });
  wake_.wake();
  return done;
}

Result<void> AuditKeeper::taint(const AuditWork::Tainting& tainting) {
  CANDELA_TRY(writer_.flush());
  const std::string only = tainting.jobs.size() == 1 ? *tainting.jobs.begin() : std::string();
  CANDELA_ASSIGN(const auto units, store_.units_by(tainting.worker, tainting.worker_ids, only));
  table_.with_scheduler(
      [&](Scheduler& s) { s.taint(tainting.worker, units, tainting.jobs, JobTable::now()); });
  return {};
}

}  // namespace candela::master
