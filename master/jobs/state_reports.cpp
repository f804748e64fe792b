#include "master/jobs/state_reports.h"

#include <fmt/format.h>

#include <utility>

#include "common/base/log.h"
#include "common/stages/epochs.h"

namespace candela::master {
namespace {

Result<StateReport> report_of(const JobFilm& film, const JobFilm::Latest& latest, bool with_layers) {
  const EpochPlan& plan = *film.epoch_plan();
  CANDELA_ASSIGN(const DecisionRule rule, find_rule(plan.rule));
  if (rule.describe == nullptr) return StateReport{};
  const film::Layout& layout = film.layout();
  CANDELA_ASSIGN(StateReport report, rule.describe(plan, latest.decisions - 1, layout.width, layout.height,
                                                   *latest.state, *latest.carry, with_layers));
  for (const StateReport::Layer& layer : report.layers)
    if (layer.values.size() != layout.pixel_count())
      return failed_error(
          fmt::format("the rule '{}' made a layer '{}' of another size", rule.name, layer.name));
  return report;
}

}  // namespace

std::optional<EpochStatus> StateReports::status(const std::string& job_id) {
  const std::shared_ptr<JobFilm> film = table_.film_of(job_id);
  if (!film || !film->epoch_plan()) return std::nullopt;
  {
    const Lock lock(mutex_);
    const auto told = told_.find(job_id);
    if (told != told_.end() && !film->loaded()) {
      EpochStatus status = told->second.status;
      status.statistics_bytes = 0;
      return status;
    }
  }
  if (!film->loaded())
    if (auto opened = truth_.open_film(job_id, false); !opened.ok()) return std::nullopt;
  const JobFilm::Latest latest = film->latest();
  if (latest.decisions == 0) return std::nullopt;
  const auto completed = [&](EpochStatus status) {
    status.statistics_bytes = latest.statistics_bytes;
    status.received_bytes = film->received_statistics_bytes();
    return status;
  };
  {
    const Lock lock(mutex_);
    const auto told = told_.find(job_id);
    if (told != told_.end() && told->second.decisions == latest.decisions)
      return completed(told->second.status);
  }
  EpochStatus status;
  const std::uint64_t epoch = latest.decisions - 1;
  const Epochs epochs(film->epoch_plan()->first, film->epoch_plan()->growth);
  status.epoch = epoch;
  status.first_iteration = epochs.begin(epoch);
  status.iterations = epochs.begin(epoch + 1) - epochs.begin(epoch);
  const auto report = report_of(*film, latest, false);
  if (!report.ok()) log::warn(report.error().to_string(), {.job = job_id});
  if (report.ok()) status.figures.assign(report->figures.begin(), report->figures.end());
  {
    const Lock lock(mutex_);
    told_[job_id] = {latest.decisions, status};
  }
  return completed(std::move(status));
}

Result<std::vector<StateReport::Layer>> StateReports::layers(const JobFilm& film) {
  const JobFilm::Latest latest = film.latest();
  if (!film.epoch_plan() || latest.decisions == 0) return std::vector<StateReport::Layer>();
  CANDELA_ASSIGN(StateReport report, report_of(film, latest, true));
  return std::move(report.layers);
}

}  // namespace candela::master
