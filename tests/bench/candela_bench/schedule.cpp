#include "tests/bench/candela_bench/schedule.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace candela::bench {
namespace {

// One run on its way.
class Progress {
 public:
  Progress(const RunSpec& run, const Schedule& schedule, const EstimatorFactory& factory,
           const ReferenceSource& references, const Store* store)
      : schedule_(schedule), factory_(factory), references_(references), store_(store) {
    result_.run = run;
    if (schedule.budget.iterations > 0)
      unit_points_ = iteration_points(schedule.budget.iterations, schedule.budget.points_per_doubling);
    else
      second_points_ = time_points(schedule.budget.first_seconds, schedule.budget.seconds,
                                   schedule.budget.points_per_doubling);
  }

  bool finished() const { return finished_; }
  RunResult take() { return std::move(result_); }

  // Another slice; the first time the run is started.
  void turn() {
    if (auto done = started_ ? slice() : start(); !done.ok()) give_up(std::move(done).error());
  }

 private:
  void give_up(Error error) {
    result_.error = std::move(error);
    finish();
  }
  void finish() {
    finished_ = true;
    estimator_.reset();
  }

  double seconds() const { return schedule_.budget.wall_clock ? cost_.wall_seconds : cost_.cpu_seconds; }
  // True if all points that are reached are the last.
  bool complete() const {
    return unit_points_.empty() ? seconds() >= second_points_.back() : cost_.units >= unit_points_.back();
  }
  // The first point beyond what is done.
  std::uint64_t next_units() const {
    return *std::upper_bound(unit_points_.begin(), unit_points_.end(), cost_.units);
  }
  double next_seconds() const {
    return *std::upper_bound(second_points_.begin(), second_points_.end(), seconds());
  }

  Result<void> start() {
    started_ = true;
    std::string state;
    if (store_ != nullptr) {
      CANDELA_ASSIGN(Store::Kept kept, store_->read(result_.run));
      result_.rows = std::move(kept.rows);
      state = std::move(kept.state);
    }
    if (!result_.rows.empty()) cost_ = result_.rows.back().cost;
    CANDELA_TRY(judge_again());
    if (complete()) {
      finish();
      return {};
    }
    CANDELA_ASSIGN(reference_, references_(result_.run.reference));
    if (reference_->width() != result_.run.job.width || reference_->height() != result_.run.job.height)
      return input_error("the reference has another size than the run").at(result_.run.reference, 0);
    CANDELA_ASSIGN(estimator_, factory_(result_.run));
    if (!result_.rows.empty()) {
      // Without its state a run begins again: its rows would be the same but for the times.
      const auto restored = estimator_->restore(state);
      if (restored.ok() && restored->units == cost_.units) {
        cost_ = *restored;
      } else {
        say(fmt::format("{}: its kept state cannot be used, it begins again", name()));
        result_.rows.clear();
        cost_ = {};
        CANDELA_ASSIGN(estimator_, factory_(result_.run));
      }
    }
    return {};
  }

  // Kept rows by the factor that is asked for now.
  Result<void> judge_again() {
    bool changed = false;
    for (Row& row : result_.rows) {
      const std::string truth =
          truth_of(row.reference_factor, row.truth != "unknown", schedule_.reference_factor);
      changed |= truth != row.truth || row.least_factor != schedule_.reference_factor;
      row.truth = truth;
      row.least_factor = schedule_.reference_factor;
    }
    if (!changed || store_ == nullptr) return {};
    CANDELA_ASSIGN(const auto reference, references_(result_.run.reference));
    return store_->write(result_.run, result_.rows, {}, *reference);
  }

  Result<void> slice() {
    const double slice_seconds = schedule_.budget.slice_seconds;
    const double rate = cost_.units > 0 ? seconds() / static_cast<double>(cost_.units) : 0;  // a unit's
    std::uint64_t target = cost_.units + 1;
    double point_seconds = 0;
    if (!unit_points_.empty()) {
      if (rate > 0) target = cost_.units + whole(slice_seconds / rate);
      target = std::min(target, next_units());
    } else {
      point_seconds = next_seconds();
      if (rate > 0) target = cost_.units + whole(std::min(slice_seconds, point_seconds - seconds()) / rate);
    }
    const std::uint64_t point_units = unit_points_.empty() ? 0 : next_units();
    CANDELA_ASSIGN(cost_, estimator_->advance(target));
    if (unit_points_.empty() ? seconds() >= point_seconds : cost_.units >= point_units) CANDELA_TRY(record());
    if (complete()) finish();
    return {};
  }
  // At least one, and no more than doubles what is done: the first units may not be like the others.
  std::uint64_t whole(double units) const {
    return std::clamp<std::uint64_t>(static_cast<std::uint64_t>(std::min(units, 1e12)), 1,
                                     std::max<std::uint64_t>(1, cost_.units));
  }

  Result<void> record() {
    CANDELA_ASSIGN(const Snapshot snapshot, estimator_->snapshot());
    if (snapshot.image.size() != reference_->rgb().size())
      return internal_error("an image that is not of the run's size");
    Row row;
    row.cost = cost_;
    row.unit = estimator_->unit_name();
    row.figures = reference_->figures_of(snapshot.image);
    row.own_relmse = snapshot.own_relmse;
    row.reference_factor = reference_->factor_of(row.figures);
    row.least_factor = schedule_.reference_factor;
    row.truth = truth_of(row.reference_factor, !std::isnan(row.reference_factor), row.least_factor);
    row.machine = schedule_.machine;
    row.flip = schedule_.flip;
    result_.rows.push_back(row);
    say(fmt::format(
        "{}: {} {}, {:.3g} s, relMSE {:.3e}{}", name(), cost_.units, row.unit, seconds(), row.figures.relmse,
        row.truth == "noisy"
            ? fmt::format(", of which the reference has 1/{:.2g}: not good enough", row.reference_factor)
            : ""));
    if (store_ == nullptr) return {};
    CANDELA_ASSIGN(const std::string state, estimator_->save());
    CANDELA_TRY(store_->write(result_.run, result_.rows, state, *reference_));
    return store_->write_image(result_.run.id(), reference_->width(), reference_->height(), snapshot.image);
  }

  std::string name() const {
    return fmt::format("{} {} seed {}", result_.run.scene, result_.run.variant, result_.run.job.seed);
  }
  void say(const std::string& line) const {
    if (schedule_.say) schedule_.say(line);
  }

  const Schedule& schedule_;
  const EstimatorFactory& factory_;
  const ReferenceSource& references_;
  const Store* store_;
  RunResult result_;
  std::shared_ptr<const Reference> reference_;
  std::unique_ptr<Estimator> estimator_;
  std::vector<std::uint64_t> unit_points_;  // one of these two is empty
  std::vector<double> second_points_;
  Cost cost_;
  bool started_ = false, finished_ = false;
};

}  // namespace

std::vector<std::uint64_t> iteration_points(std::uint64_t last, int per_doubling) {
  std::vector<std::uint64_t> points;
  for (int k = 0;; ++k) {
    const auto point =
        static_cast<std::uint64_t>(std::llround(std::exp2(static_cast<double>(k) / per_doubling)));
    if (point >= last) break;
    if (points.empty() || point > points.back()) points.push_back(point);
  }
  points.push_back(last);
  return points;
}

std::vector<double> time_points(double first, double last, int per_doubling) {
  std::vector<double> points;
  for (int k = 0;; ++k) {
    const double point = first * std::exp2(static_cast<double>(k) / per_doubling);
    if (point >= last) break;
    points.push_back(point);
  }
  points.push_back(last);
  return points;
}

std::vector<RunResult> run_all(const std::vector<RunSpec>& runs, const Schedule& schedule,
                               const EstimatorFactory& factory, const ReferenceSource& references,
                               const Store* store) {
  const auto stopped = [&] {
    return schedule.stop != nullptr && schedule.stop->load(std::memory_order_relaxed);
  };
  const std::size_t beside = schedule.beside == 0 ? std::max<std::size_t>(1, runs.size()) : schedule.beside;
  std::vector<RunResult> results;
  for (std::size_t begin = 0; begin < runs.size(); begin += beside) {
    std::vector<std::unique_ptr<Progress>> group;
    for (std::size_t i = begin; i < std::min(runs.size(), begin + beside); ++i)
      group.push_back(std::make_unique<Progress>(runs[i], schedule, factory, references, store));
    for (bool working = true; working && !stopped();) {
      working = false;
      for (const auto& progress : group) {
        if (progress->finished() || stopped()) continue;
        progress->turn();
        working = true;
      }
    }
    for (const auto& progress : group) results.push_back(progress->take());
  }
  return results;
}

}  // namespace candela::bench
