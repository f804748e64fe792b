// Which unit comes next, and how large it is.
#include <algorithm>
#include <cmath>

#include "master/scheduler/free_segments.h"
#include "master/scheduler/scheduler.h"
#include "master/scheduler/sizing.h"

namespace candela::master {
namespace {

constexpr double kPilotFloor =
    60;  // seconds before a pilot (with the scene's compilation) counts as a straggler

}  // namespace

UnitState& Scheduler::add_unit(Job& job, const Unit& unit) {
  UnitState state;
  state.row.id = next_unit_id_++;
  state.row.job_id = job.row.id;
  state.row.unit = unit;
  return job.units.emplace(state.row.id, std::move(state)).first->second;
}

UnitState* Scheduler::pick(Job& job, const WorkerState& worker, bool prefetch, Now now) {
  if (!job.row.named_state && !job.row.chains) {
    if (job.units.empty()) return &add_unit(job, Unit{Unit::Kind::pilot, 0, 0, 0});
    UnitState& pilot = job.units.begin()->second;
    return offered(job, pilot, worker, now) ? &pilot : nullptr;
  }
  return cut(job, worker, prefetch, now);
}

// Whether `worker`, were it free, could have a unit of the job.
bool Scheduler::has_work(const Job& job, const WorkerState& worker, Now now) const {
  if (job.in_bootstrap()) {
    if (job.bootstrap_taken.count() < job.row.chains->bootstrap_samples) return true;
  } else if (!job.row.named_state) {
    return false;
  } else if (job.row.chains) {
    for (std::uint32_t h = 0; h < 2; ++h)
      if (free_segments(job.merged[h], job.taken[h], job.per_round(), job.target(h), 1).length > 0)
        return true;
  } else {
    for (std::uint32_t h = 0; h < 2; ++h)
      if (!contains(job.taken[h], 0, job.target(h))) return true;
  }
  return std::any_of(job.units.begin(), job.units.end(),
                     [&](const auto& entry) { return offered(job, entry.second, worker, now); });
}

namespace {

// Indices of a job not cut into units yet, and those that are.
struct Extent {
  std::uint64_t remaining = 0, cut = 0;
};
Extent extent_of(const Job& job) {
  Extent out;
  if (job.in_bootstrap()) {
    out.cut = job.bootstrap_taken.count();
    out.remaining = job.row.chains->bootstrap_samples - out.cut;
    return out;
  }
  for (std::uint32_t h = 0; h < 2; ++h) {
    const std::uint64_t taken = job.taken[h].count();
    out.cut += taken;
    out.remaining += job.target(h) - std::min(job.target(h), taken);
  }
  return out;
}

}  // namespace

// An open unit that came back, else a new one.
UnitState* Scheduler::cut(Job& job, const WorkerState& worker, bool prefetch, Now now) {
  const auto [remaining, cut_so_far] = extent_of(job);
  const std::uint64_t active = std::max<std::uint64_t>(active_workers(job, now), 1);
  const bool bounded = job.row.stop.iterations > 0 || job.in_bootstrap();

  SizingInput in;
  in.unit_seconds = options_.unit_seconds;
  in.seconds_per_iteration = seconds_per_iteration(job, worker);
  if (job.in_bootstrap()) in.seconds_per_iteration /= static_cast<double>(job.row.chains->segment_mutations);
  in.overhead_seconds = job.overhead_seconds;
  in.active_workers = active;
  in.remaining = bounded ? remaining : 0;
  if (!job.in_bootstrap()) {
    if (job.row.stop.time_seconds > 0)
      in.seconds_left = std::max(job.row.stop.time_seconds - job.row.elapsed_seconds, 1e-3);
    in.open_end = job.row.stop.time_seconds > 0 || job.row.stop.relmse > 0;
  }
  in.cut_so_far = cut_so_far;

  UnitState* open = nullptr;
  std::uint64_t open_count = 0;
  for (auto& [id, u] : job.units) {
    if (!u.leases.empty() || u.waits(now.seconds)) continue;
    ++open_count;
    if (open == nullptr && offered(job, u, worker, now)) open = &u;
  }
  if (prefetch && bounded) {
    // What a full-size unit would be, not the guided one: else there are always two a worker left.
    SizingInput full = in;
    full.remaining = 0;
    std::uint64_t size = unit_iterations(full);
    if (job.row.chains && !job.in_bootstrap()) size = std::min(size, most_segments(job, active));
    if (open_count + remaining / size <= 2 * active) return nullptr;
  }
  if (open != nullptr) return open;
  if (remaining == 0) return nullptr;
  const std::uint64_t want = unit_iterations(in);
  const std::optional<Unit> unit = job.in_bootstrap() ? next_samples(job, want)
                                   : job.row.chains   ? next_segments(job, want, active)
                                                      : next_iterations(job, want);
  return unit ? &add_unit(job, *unit) : nullptr;
}

// The halves advance together, so that an error estimate is there early.
std::optional<Unit> Scheduler::next_iterations(Job& job, std::uint64_t want) {
  std::uint32_t half = job.taken[0].count() <= job.taken[1].count() ? 0 : 1;
  for (int i = 0; i < 2; ++i, half = 1 - half) {
    const auto [begin, end] = job.taken[half].first_gap(0, job.target(half));
    if (begin == end) continue;
    const Unit unit{Unit::Kind::iterations, half, begin, begin + std::min(want, end - begin)};
    job.taken[half].insert(unit.begin, unit.end);
    return unit;
  }
  return std::nullopt;
}

// A unit that takes much longer than it should, when there is nothing else to do.
UnitState* Scheduler::straggler(Job& job, const WorkerState& worker, Now now) {
  UnitState* slowest = nullptr;
  double slowest_late = 0;
  for (auto& [id, u] : job.units) {
    if (u.leases.size() != 1 || u.speculated) continue;
    const Lease& lease = leases_.at(u.leases[0]);
    if (lease.row.worker_id == worker.row.id) continue;
    if (u.waits(now.seconds) || barred(job, u, worker, now)) continue;
    const double floor =
        u.row.unit.kind == Unit::Kind::pilot ? kPilotFloor : std::max(options_.unit_seconds, 1.0);
    const double late = now.seconds - lease.granted - std::max(2 * lease.due_seconds, floor);
    if (late > slowest_late) {
      slowest_late = late;
      slowest = &u;
    }
  }
  return slowest;
}

double Scheduler::expected_seconds(const Job& job, const WorkerState& worker, const Unit& unit) const {
  if (unit.kind == Unit::Kind::pilot) return 0;
  const double seconds = seconds_per_iteration(job, worker) * static_cast<double>(unit.end - unit.begin);
  return unit.kind == Unit::Kind::bootstrap ? seconds / static_cast<double>(job.row.chains->segment_mutations)
                                            : seconds;
}

}  // namespace candela::master
